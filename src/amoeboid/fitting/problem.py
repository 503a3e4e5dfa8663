"""The least-squares problem: measured values in the units of the solver, and their residuals.

The unknowns y are the logarithms of the free parameters over their values at the start, followed by
those of the factors of profiles in arbitrary units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array
from amoeboid.fitting.followed import FollowedState
from amoeboid.fitting.measurements import Measurements
from amoeboid.fitting.predictions import Prediction, predicted, prediction
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.least_squares import Minimum, minimum, unwatched
from amoeboid.validation import InvalidInput

MAX_WEIGHINGS, SETTLED = 20, 1e-3
"""How often errors are estimated from the residuals, and the relative change that ends it."""


@dataclass(frozen=True, eq=False)
class Target:
    """A quantity in the units of the solver; `factor` is the place of its factor in y, or None.

    `estimated` says that the errors come from the residuals.
    """

    name: str
    theta: Array | None
    values: Array
    errors: Array
    factor: int | None
    estimated: bool

    def residuals(self, state: FollowedState, y: Array) -> Array:
        """(prediction - value)/error."""
        found = predicted(state.solution, self.name, self.theta)
        return (self._factor(y) * found - self.values) / self.errors

    def slopes(self, state: FollowedState, y: Array) -> Array:
        """Their derivatives to all of y."""
        return self.predicted(state, y, self.theta).slopes / self.errors[:, None]

    def _factor(self, y: Array) -> float:
        return 1.0 if self.factor is None else float(np.exp(y[self.factor]))

    def predicted(self, state: FollowedState, y: Array, theta: Array | None) -> Prediction:
        """The prediction in the units of `values`, with its derivatives to all of y."""
        found = prediction(state, self.name, theta)
        slopes = np.zeros((found.values.size, y.size))
        factor = self._factor(y)
        slopes[:, : state.y.size] = factor * found.slopes
        if self.factor is not None:
            slopes[:, self.factor] = factor * found.values
        return Prediction(factor * found.values, slopes)


@dataclass(frozen=True, eq=False)
class Point:
    """The problem at one y: the state there, residuals and their exact derivatives."""

    targets: tuple[Target, ...]
    y: Array
    state: FollowedState

    @cached_property
    def _residuals(self) -> list[Array]:
        return [target.residuals(self.state, self.y) for target in self.targets]

    @cached_property
    def residuals(self) -> Array:
        """(prediction - value)/error of all targets, one after the other (m,)."""
        return np.concatenate(self._residuals)

    @cached_property
    def jacobian(self) -> Array:
        """Their derivatives to y (m, k)."""
        return np.vstack([target.slopes(self.state, self.y) for target in self.targets])

    @property
    def chi2(self) -> float:
        """Sum of the squares of the residuals."""
        return float(self.residuals @ self.residuals)

    def residuals_of(self, k: int) -> Array:
        """The residuals of target k."""
        return self._residuals[k]


Shown = Callable[[int, Point], None]
"""A callback that gets the number of an iteration and its point."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Targets, unknowns and their bounds."""

    start: Parameters
    names: tuple[str, ...]
    targets: tuple[Target, ...]
    lower: Array
    upper: Array

    def evaluated(self, y: Array, near: Point) -> Point | None:
        """The point at y, reached from one nearby; None where no polarized state leads there."""
        state = near.state.at(y[: len(self.names)])
        return None if state is None else Point(self.targets, y, state)

    def minimum(
        self, begin: Point, watch: Shown = unwatched, enough: float = 0.0
    ) -> Minimum[Point]:
        """The local minimum of chi2 from `begin` downhill, to within `enough`."""
        return minimum(self.evaluated, begin, self.lower, self.upper, watch, enough)

    def with_fixed(self, k: int, value: float) -> Problem:
        """The problem with y_k held at a value."""
        lower, upper = self.lower.copy(), self.upper.copy()
        lower[k] = upper[k] = value
        return replace(self, lower=lower, upper=upper)

    def reweighted(self, point: Point) -> tuple[Problem, float]:
        """The problem with errors estimated from the residuals, and their largest change.

        The error of a quantity without errors is the root of its sum of squared residuals over
        its number of values, less its share of the unknowns.
        """
        largest, targets = 0.0, []
        share = 1.0 - point.y.size / point.residuals.size
        for k, target in enumerate(self.targets):
            if target.estimated:
                ratio = float(np.sqrt(np.mean(point.residuals_of(k) ** 2) / share))
                # a perfect description would leave no error at all: rounding sets the least
                ratio = max(ratio, 1e-12 * np.abs(target.values).max() / target.errors[0])
                largest = max(largest, abs(np.log(ratio)))
                target = replace(target, errors=target.errors * ratio)
            targets.append(target)
        return replace(self, targets=tuple(targets)), largest


def targets_of(
    data: Measurements, p: Parameters, free: int, state: FollowedState, mirrored: bool
) -> tuple[tuple[Target, ...], Array, tuple[str, ...]]:
    """The targets of the measurements, the first logarithms of the factors, their names.

    `mirrored`: theta counts from the other pole. Raises InvalidInput for a profile in arbitrary
    units that no positive factor fits.
    """
    targets: list[Target] = []
    factors: list[float] = []
    names: list[str] = []
    for q in data:
        theta = None if q.theta is None else (np.pi - q.theta if mirrored else q.theta)
        size = q.size(p)
        values = q.values * size
        spread = float(np.abs(values).max()) or 1.0
        errors = np.full(values.size, spread) if q.errors is None else q.errors * size
        target = Target(q.name, theta, values, errors, None, q.errors is None)
        if q.arbitrary:
            target = replace(target, factor=free + len(factors))
            expected = predicted(state.solution, q.name, theta)
            factor = float(values / errors @ (expected / errors)) / float(
                expected / errors @ (expected / errors)
            )
            if factor <= 0:
                raise InvalidInput(
                    f"{q.name} [a.u.] must be positive where the prediction is, the best factor "
                    f"is {factor:.3g}; take u positive from front to rear"
                )
            factors.append(float(np.log(factor)))
            names.append(f"factor of {q.name}")
        targets.append(target)
    return tuple(targets), np.array(factors), tuple(names)


def solved(
    problem: Problem, begin: Point, watch: Shown = unwatched
) -> tuple[Problem, Minimum[Point]]:
    """The minimum from `begin`, and the problem with the errors that it estimates."""
    for _ in range(MAX_WEIGHINGS):
        found = problem.minimum(begin, watch)
        if not any(target.estimated for target in problem.targets):
            break
        problem, change = problem.reweighted(found.point)
        begin = replace(found.point, targets=problem.targets)
        found = replace(found, point=begin)
        if change < SETTLED:
            break
    return problem, found
