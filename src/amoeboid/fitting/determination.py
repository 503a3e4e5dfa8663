"""What data determine: errors and correlations of the unknowns, and combinations left open.

Of the sensitivity matrix J = d(residuals)/dy, with y the logarithms of the unknowns, the singular
value decomposition J = U S V^T gives the standard deviation 1/s of the combination of unknowns
along each column of V.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from amoeboid.arrays import Array
from amoeboid.fitting.problem import Problem
from amoeboid.model.parameters import DIMENSIONS
from amoeboid.model.units import exponents

UNDETERMINED = 1.0
"""Standard deviation of the logarithm from which a combination is not determined."""

ZERO = 1e-7
"""A singular value this much smaller than the largest is zero, to the accuracy of sensitivities."""

SMALL_POWER = 0.02
"""Powers of unknowns that are left out of words."""

BASE = "LTMN"


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The singular value decomposition of the sensitivity matrix of unknowns."""

    values: Array
    """Singular values, largest first (k,)."""
    directions: Array
    """Rows: the combinations of unknowns (k, k)."""

    @classmethod
    def of(cls, jacobian: Array) -> Sensitivity:
        """That of residuals (m,) to no more unknowns (k,)."""
        _, s, right = np.linalg.svd(jacobian, full_matrices=False)
        return cls(s, right)

    @property
    def determined(self) -> Array:
        """Which singular values are not zero (k,)."""
        return self.values > ZERO * self.values[0]

    @property
    def deviations(self) -> Array:
        """Standard deviation of the logarithm along each combination, inf where s = 0 (k,)."""
        with np.errstate(divide="ignore"):
            return np.where(self.determined, 1.0 / self.values, np.inf)

    @property
    def covariance(self) -> Array:
        """Covariance of the determined part of y (k, k)."""
        scaled = self.directions[self.determined] / self.values[self.determined][:, None]
        return scaled.T @ scaled

    @property
    def errors(self) -> Array:
        """Standard deviation of each unknown's logarithm, inf where it is left open (k,)."""
        spread = np.sqrt(np.diag(self.covariance))
        lost = np.abs(self.directions[~self.determined]) > SMALL_POWER
        return np.where(lost.any(axis=0), np.inf, spread)

    @property
    def correlation(self) -> Array:
        """Correlations of the unknowns (k, k); those of a zero singular value are its limit."""
        s = np.maximum(self.values, ZERO * self.values[0])
        scaled = self.directions / s[:, None]
        covariance = scaled.T @ scaled
        size = np.sqrt(np.diag(covariance))
        return covariance / np.outer(size, size)


@dataclass(frozen=True)
class Combination:
    """Unknowns that can be changed together and leave the data as they are, within the errors.

    Multiplying each unknown by f to the power given in `powers` is what the data do not tell;
    `relative_sd` is the standard deviation of ln f, None if it is infinite. `text` says so in
    words. `exact`: a consequence of units, whatever the data.
    """

    powers: dict[str, float]
    relative_sd: float | None
    exact: bool
    text: str

    def __repr__(self) -> str:
        return f"Combination({self.text[:900]})"


def scalings(problem: Problem, unknowns: Sequence[str], dimensions: dict[str, str]) -> Array:
    """Directions in y that a change of units makes, which no fixed number and no datum tells.

    `dimensions` holds those of the data by name. Rows (r, k), the simplest that span them.
    """
    p = problem.start
    told = [
        _powers(dimension)
        for name, dimension in DIMENSIONS.items()
        if name not in problem.names and p.value(name) != 0
    ]
    told += [
        _powers(p.dimension(name) or "")
        for name in p.names
        if "." in name and name not in problem.names
    ]
    told += [_powers(dimensions[t.name]) for t in problem.targets if t.factor is None]
    units = null_space(np.array(told).reshape(-1, len(BASE)), rcond=1e-9).T
    effect = [_powers(p.dimension(name) or "") for name in problem.names]
    effect += [-_powers(dimensions[t.name]) for t in problem.targets if t.factor is not None]
    return _simplest(units @ np.array(effect).T, len(unknowns))


def _powers(dimension: str) -> Array:
    found = dict(exponents(dimension))
    return np.array([float(found.get(symbol, 0)) for symbol in BASE])


def _simplest(rows: Array, count: int) -> Array:
    """Reduced row echelon form, without rows of zeros."""
    rows = np.array(rows, dtype=float).reshape(-1, count)
    done = 0
    for k in range(count):
        if done == rows.shape[0]:
            break
        pivot = done + int(np.argmax(np.abs(rows[done:, k])))
        if abs(rows[pivot, k]) < 1e-9:
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, k]
        for other in range(rows.shape[0]):
            if other != done:
                rows[other] -= rows[other, k] * rows[done]
        done += 1
    return rows[:done]


def changes_nothing(jacobian: Array, direction: Array) -> bool:
    """Whether the residuals do not change along a direction in y."""
    size = np.linalg.norm(jacobian, 2) * np.linalg.norm(direction)
    return bool(np.linalg.norm(jacobian @ direction) < ZERO * size)


def in_words(unknowns: Sequence[str], direction: Array, factor: float = 2.0) -> str:
    """A change along a direction, of `factor` to its powers: "multiplying D by 2 and c0 by 1.1"."""
    parts = [
        f"{unknowns[k]} by {factor ** direction[k]:.4g}"
        for k in np.argsort(-np.abs(direction), kind="stable")
        if abs(direction[k]) > SMALL_POWER
    ]
    return f"multiplying {', '.join(parts[:-1])}{' and ' if len(parts) > 1 else ''}{parts[-1]}"
