"""All roots of a function of one positive variable, found by scanning and then refining."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from amoeboid.polymerization import Array
from amoeboid.validation import InvalidInput

DECADES = 8
SAMPLES_PER_DECADE = 200
# A sign change at which the function does not go to zero, on this scale, is a pole.
POLE = 1e-6
# Roots are sought where products with other quantities neither vanish nor overflow.
SMALLEST = 1e-150

Function = Callable[[Array], Array]


def roots_about(function: Function, scale: float) -> list[float]:
    """Every x > 0 within 8 decades of `scale` at which the function vanishes, ascending.

    Pairs of roots closer than 1 % are found from the extremum between them, and so is a double
    root. Where the function is refused (InvalidInput) there is no root.
    """
    exponents = np.linspace(-DECADES, DECADES, 2 * DECADES * SAMPLES_PER_DECADE + 1)
    with np.errstate(over="ignore", under="ignore"):
        x = scale * 10.0**exponents
    x = x[(x > SMALLEST) & (x < 1 / SMALLEST)]
    y = _samples(function, x)
    sign = np.sign(y)
    found = {float(v) for v in x[y == 0.0]}
    for i in range(len(x) - 1):
        if sign[i] * sign[i + 1] < 0:
            found.update(_bracketed(function, x[i], x[i + 1]))
    for i in range(1, len(x) - 1):
        one_sign = sign[i - 1] == sign[i] == sign[i + 1] != 0
        turns = abs(y[i]) <= min(abs(y[i - 1]), abs(y[i + 1]))
        # Only where the parabola through three samples comes near zero can roots hide between them.
        if one_sign and turns and abs(y[i]) <= 2 * abs(y[i - 1] - 2 * y[i] + y[i + 1]):
            found.update(_about_extremum(function, x[i - 1], x[i + 1], float(sign[i])))
    return sorted(found)


def _samples(function: Function, x: Array) -> Array:
    """Values on the grid, NaN (which no comparison accepts) where the function is refused."""
    try:
        return np.asarray(function(x), dtype=float)
    except InvalidInput:
        return np.array([_sample(function, v) for v in x])


def _sample(function: Function, x: float) -> float:
    try:
        return float(function(np.asarray(x)))
    except InvalidInput:
        return float("nan")


def _bracketed(function: Function, low: float, high: float) -> list[float]:
    def scalar(v: float) -> float:
        return _sample(function, v)

    root = float(brentq(scalar, low, high, xtol=1e-300, rtol=1e-14))
    ends = max(abs(scalar(low)), abs(scalar(high)))
    near = [scalar(root * (1 - 1e-12)), scalar(root * (1 + 1e-12))]
    return [root] if max(map(abs, near)) <= POLE * ends or scalar(root) == 0.0 else []


def _about_extremum(function: Function, low: float, high: float, sign: float) -> list[float]:
    def distance(v: float) -> float:
        return sign * _sample(function, v)

    best = minimize_scalar(distance, bounds=(low, high), method="bounded", options={"xatol": 0.0})
    nearest, value = float(best.x), float(best.fun)
    if value < 0:
        return _bracketed(function, low, nearest) + _bracketed(function, nearest, high)
    touches = value <= 1e-12 * max(distance(low), distance(high))
    return [nearest] if touches else []
