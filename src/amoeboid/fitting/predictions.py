"""What a polarized state predicts for a measured profile or number, and how that changes with y.

theta is the angle at the center of volume between the axis and a point of the surface, 0 at the
front. The retrograde flow u counts from front to rear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.fitting.followed import DIFFERENCE, FollowedState
from amoeboid.studies import observed

PROFILES = {"u": "L/T", "c": "N/L^2"}
"""Quantities that are measured along the meridian, and their dimensions."""

STEP = 1e-4
"""Step in x of central differences along the meridian."""

INVERSIONS = 8


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted values (m,) and their derivatives to y (m, k)."""

    values: Array
    slopes: Array


def predicted(state: SteadySolution, name: str, theta: Array | None) -> Array:
    """The values of a profile at angles `theta` from the front (m,), or of an observable (1,)."""
    if theta is None:
        return np.array([observed.observed(state, name)])
    return _PROFILE[name](state, arclengths(state, theta))


def prediction(state: FollowedState, name: str, theta: Array | None) -> Prediction:
    """The same with its derivatives to y."""
    if theta is None:
        return _prediction(state, lambda s: predicted(s, name, None))
    x = arclengths(state.solution, theta)
    field = _PROFILE[name]
    at_rest = _prediction(state, lambda s: field(s, x))
    turning = _prediction(state, lambda s: angles(s, x) - theta)

    def along(function: Callable[[Array], Array]) -> Array:
        return (function(x + STEP) - function(x - STEP)) / (2 * STEP)

    solution = state.solution
    shift = along(lambda x: field(solution, x)) / along(lambda x: angles(solution, x) - theta)
    return Prediction(at_rest.values, at_rest.slopes - shift[:, None] * turning.slopes)


def _prediction(state: FollowedState, measure: Callable[[SteadySolution], Array]) -> Prediction:
    """A measure of a state, and its differences along the tangents."""
    slopes = [(measure(a) - measure(b)) / (2 * DIFFERENCE) for a, b in state.neighbors]
    values = measure(state.solution)
    return Prediction(values, np.array(slopes).reshape(-1, values.size).T)


def angles(state: SteadySolution, x: Array) -> Array:
    """theta at scaled arclengths x, from the front; continuous where x passes a pole."""
    cell = state.cell
    r, z = state.position(np.append(x, cell.shape.grid.x[0]))
    r, z = r[:-1], z[:-1] - (z[-1] - cell.x[0, 2])  # now zero at the center of volume
    nearby = np.pi - x
    turned = np.arctan2(r, -z) - nearby
    return np.asarray(nearby + (turned + np.pi) % (2 * np.pi) - np.pi)


def arclengths(state: SteadySolution, theta: Array) -> Array:
    """The scaled arclengths of angles theta from the front, by Newton's method."""
    x = np.pi - theta
    for _ in range(INVERSIONS):
        misfit = angles(state, x) - theta
        if np.abs(misfit).max() < 1e-12:
            break
        slope = (angles(state, x + STEP) - angles(state, x - STEP)) / (2 * STEP)
        x = x - misfit / slope
    return x


def _flow(state: SteadySolution, x: Array) -> Array:
    return -state.flow(x)


def _concentration(state: SteadySolution, x: Array) -> Array:
    return state.concentration(x)


_PROFILE: dict[str, Callable[[SteadySolution, Array], Array]] = {
    "u": _flow,
    "c": _concentration,
}
