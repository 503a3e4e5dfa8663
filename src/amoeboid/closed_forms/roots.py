"""All roots of a function of one positive variable, found by scanning and then refining."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.bracketed import bounded_minimum, bracketed_root
from amoeboid.validation import InvalidInput

DECADES = 8
SAMPLES_PER_DECADE = 200
# A sign change at which the function does not go to zero, on this scale, is a pole.
POLE = 1e-6
# Roots are sought where products with other quantities neither vanish nor overflow.
SMALLEST = 1e-150
PROBES = 8

Function = Callable[[Array], Array]


def roots_about(function: Function, scale: float) -> Iterator[float]:
    """Every x > 0 within 8 decades of `scale` at which the function vanishes, ascending.

    Pairs of roots closer than 1 % are found from the extremum between them, and so is a double
    root. Where the function is refused (InvalidInput) there is no root.
    """
    exponents = np.linspace(-DECADES, DECADES, 2 * DECADES * SAMPLES_PER_DECADE + 1)
    with np.errstate(over="ignore", under="ignore"):
        x = scale * 10.0**exponents
    x = x[(x > SMALLEST) & (x < 1 / SMALLEST)]
    if x.size < 3:
        return
    y = _samples(function, x)
    sign = np.sign(y)
    crosses = np.append(sign[:-1] * sign[1:] < 0, False)
    turns = _turns_near_zero(y)
    for i in np.flatnonzero((y == 0) | crosses | turns):
        if y[i] == 0:
            yield float(x[i])
        elif crosses[i]:
            yield from _bracketed(function, x[i], x[i + 1])
        else:
            yield from _about_extremum(function, x[i - 1], x[i + 1], float(sign[i]))


def _turns_near_zero(y: Array) -> Array:
    """Samples at which the function turns back just before zero.

    Only where the parabola through three samples comes near zero can roots hide between them.
    """
    found = np.zeros(y.shape, dtype=bool)
    with np.errstate(invalid="ignore", over="ignore"):
        left, mid, right = y[:-2], y[1:-1], y[2:]
        one_sign = (np.sign(left) == np.sign(mid)) & (np.sign(mid) == np.sign(right)) & (mid != 0)
        lowest = np.abs(mid) <= np.minimum(np.abs(left), np.abs(right))
        found[1:-1] = one_sign & lowest & (np.abs(mid) <= 2 * np.abs(left - 2 * mid + right))
    return found


def _samples(function: Function, x: Array) -> Array:
    """Values on the grid, NaN (which no comparison accepts) where the function is refused.

    A stretch that is refused as a whole is halved; it is given up when single samples spread over
    it are all refused.
    """
    try:
        return np.asarray(function(x), dtype=float) + np.zeros_like(x)
    except InvalidInput:
        pass
    if x.size <= PROBES:
        return np.array([_sample(function, v) for v in x])
    probes = [_sample(function, v) for v in x[np.linspace(0, x.size - 1, PROBES, dtype=int)]]
    if np.all(np.isnan(probes)):
        return np.full(x.shape, np.nan)
    half = x.size // 2
    return np.append(_samples(function, x[:half]), _samples(function, x[half:]))


def _sample(function: Function, x: float) -> float:
    try:
        return float(function(np.asarray(x)))
    except InvalidInput:
        return float("nan")


def _bracketed(function: Function, low: float, high: float) -> list[float]:
    def scalar(v: float) -> float:
        return _sample(function, v)

    try:
        root = bracketed_root(scalar, low, high, xtol=1e-300, rtol=1e-14)
    except ValueError:  # NaN in between: the function is refused there
        return []
    ends = max(abs(scalar(low)), abs(scalar(high)))
    near = [scalar(root * (1 - 1e-12)), scalar(root * (1 + 1e-12))]
    return [root] if max(map(abs, near)) <= POLE * ends or scalar(root) == 0.0 else []


def _about_extremum(function: Function, low: float, high: float, sign: float) -> list[float]:
    def distance(v: float) -> float:
        return sign * _sample(function, v)

    nearest, value = bounded_minimum(distance, low, high, xtol=0.0)
    if value < 0:
        return _bracketed(function, low, nearest) + _bracketed(function, nearest, high)
    touches = value <= 1e-12 * max(distance(low), distance(high))
    return [nearest] if touches else []
