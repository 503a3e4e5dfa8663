"""Nonlinear least squares: Gauss-Newton steps within a trust region and bounds.

The step comes from the singular values of the Jacobian, so that directions which the residuals do
not depend on are left alone. The function may be undefined beyond an edge that is not known ahead.
Source: Nocedal & Wright, *Numerical Optimization*, 2nd ed. 2006, chapters 4 and 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from amoeboid.arrays import Array

TOLERANCE = 1e-8
"""Converged: a full Gauss-Newton step would lower the sum of squares by less than this share."""

NEGLIGIBLE = 1e-10
"""A singular value this much smaller than the largest one is zero."""

UNSEEN = 1e-9
"""A singular value this much smaller than the residuals is zero: the longest step along it lowers
the sum of squares by less than TOLERANCE."""

FIRST_RADIUS, MAX_RADIUS, MIN_RADIUS = 0.5, 2.0, 1e-9
MAX_ITERATIONS = 100

AT_EDGE = 1e-3
"""Radius of steps that is small enough where the function is undefined a little further."""


class Evaluation(Protocol):
    """The residuals (m,) and their Jacobian (m, k) at a point y (k,)."""

    @property
    def y(self) -> Array:
        """The point."""

    @property
    def residuals(self) -> Array:
        """The residuals there."""

    @property
    def jacobian(self) -> Array:
        """Their derivatives to y."""


P = TypeVar("P", bound=Evaluation)


@dataclass(frozen=True)
class Minimum(Generic[P]):
    """Where the iteration ended. `edge`: the function is undefined beyond it, downhill.

    `at_bound` marks the components that a bound holds (k,).
    """

    point: P
    converged: bool
    edge: bool
    at_bound: Array
    iterations: int


def unwatched(*_: object) -> None:
    """No-op callback."""


def minimum(
    evaluate: Callable[[Array, P], P | None],
    start: P,
    lower: Array,
    upper: Array,
    watch: Callable[[int, P], None] = unwatched,
    enough: float = 0.0,
) -> Minimum[P]:
    """A local minimum of the sum of squares of the residuals, from `start` downhill.

    `evaluate` gives the evaluation at a point, from one nearby; None where the function is
    undefined. Components with equal bounds stay fixed. A sum of squares that is larger than the
    minimum by `enough` is small enough.
    """
    point, radius, edge = start, FIRST_RADIUS, False
    held = np.zeros(start.y.size, dtype=bool)
    for iteration in range(MAX_ITERATIONS):
        watch(iteration, point)
        r, jacobian = point.residuals, point.jacobian
        here = float(r @ r)
        held = _held(point.y, jacobian.T @ r, lower, upper)
        step, gain = _step(jacobian[:, ~held], r, radius)
        if gain <= max(TOLERANCE * here, enough):
            return Minimum(point, True, False, held, iteration)
        target = point.y.copy()
        target[~held] += step
        target = np.clip(target, lower, upper)
        length = float(np.linalg.norm(target - point.y))
        found = evaluate(target, point)
        change = r + jacobian @ (target - point.y)
        expected = here - float(change @ change)
        gained = -np.inf if found is None else here - float(found.residuals @ found.residuals)
        edge = found is None or (edge and gained <= 0)
        radius = _next_radius(radius, length, gained / expected if expected > 0 else -1.0)
        if found is not None and gained > 0:
            point, edge = found, False
        if radius < (AT_EDGE if edge else MIN_RADIUS):
            # without an edge, rounding alone is left
            return Minimum(point, not edge, edge, held, iteration)
    return Minimum(point, False, edge, held, MAX_ITERATIONS)


def _held(y: Array, slope: Array, lower: Array, upper: Array) -> Array:
    """Which components lie at a bound that the sum of squares falls beyond."""
    return np.asarray(
        (lower == upper) | ((y <= lower) & (slope > 0)) | ((y >= upper) & (slope < 0))
    )


def _step(jacobian: Array, r: Array, radius: float) -> tuple[Array, float]:
    """The step within the radius, and what a full one would gain."""
    if jacobian.shape[1] == 0:
        return np.zeros(0), 0.0
    left, s, right = np.linalg.svd(jacobian, full_matrices=False)
    counts = s > max(NEGLIGIBLE * float(s[0]), UNSEEN * float(np.linalg.norm(r)))
    if not counts.any():
        return np.zeros(jacobian.shape[1]), 0.0
    g, s, right = (left.T @ r)[counts], s[counts], right[counts]

    def components(damping: float) -> Array:
        return -s * g / (s * s + damping)

    low, high = 0.0, 0.0
    if np.linalg.norm(components(0.0)) > radius:
        high = float(np.linalg.norm(s * g)) / radius
        low = 1e-16 * high
        for _ in range(60):
            middle = np.sqrt(low * high)
            if np.linalg.norm(components(middle)) > radius:
                low = middle
            else:
                high = middle
    return right.T @ components(high), float(g @ g)


def _next_radius(radius: float, length: float, ratio: float) -> float:
    if ratio < 0.25:
        return length / 4
    return min(max(radius, 2 * length), MAX_RADIUS) if ratio > 0.75 else radius
