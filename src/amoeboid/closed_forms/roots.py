"""All roots of a function of one positive variable, found by scanning and then refining."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.bracketed import bounded_minimum
from amoeboid.validation import InvalidInput

DECADES = 8
SAMPLES_PER_DECADE = 200
# A sign change at which the function does not go to zero, on this scale, is a pole.
POLE = 1e-6
# Roots are sought where products with other quantities neither vanish nor overflow.
SMALLEST = 1e-150
PROBES = 8
# A root is met to this precision. Every call of the function takes points all over the bracket, and
# others about where the samples so far have the root, at these parts of the width of the bracket.
PRECISION = 1e-14
OFFSETS = np.array([1e-3, 1e-6, 1e-9])
MAX_CALLS = 40

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
    """The root between two values of different sign; none at a pole, or where one is refused."""
    x = np.array([low, high])
    y = _samples(function, x)
    ends = np.abs(y).max()
    for _ in range(MAX_CALLS):
        if np.any(np.isnan(y)):
            return []
        changes = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) <= 0)
        if not changes.size:  # a value that is rounding has another sign among other points
            return _met(function, x[np.abs(y).argmin()], ends)
        k = int(changes[0])
        a, b = x[k], x[k + 1]
        nearest = a if abs(y[k]) <= abs(y[k + 1]) else b
        if 0.0 in (y[k], y[k + 1]) or b - a <= PRECISION * abs(nearest):
            return _met(function, nearest, ends)
        some = slice(max(k - 1, 0), k + 3)
        guess = _inverse(x[some], y[some])
        guess = guess if a < guess < b else a + (b - a) / 2
        apart = np.append(OFFSETS * (b - a), PRECISION / 3 * abs(guess))
        near = np.concatenate([guess - apart, [guess], guess + apart])
        inside = np.concatenate([np.linspace(a, b, PROBES)[1:-1], near[(near > a) & (near < b)]])
        x = np.unique(np.concatenate([x[some], inside]))
        y = _samples(function, x)
    return []


def _met(function: Function, x: float, ends: float) -> list[float]:
    """The root x between values of the size of `ends`; none if the function is large about it."""
    around = _samples(function, x * (1 + np.array([-1e-12, 0.0, 1e-12])))
    small = max(abs(around[0]), abs(around[2])) <= POLE * ends or around[1] == 0.0
    return [float(x)] if small else []


def _inverse(x: Array, y: Array) -> float:
    """Where y = 0 by interpolation of x as a polynomial of y."""
    apart = y[:, None] - y
    np.fill_diagonal(apart, 1.0)
    with np.errstate(all="ignore"):
        shares = -y / apart
        np.fill_diagonal(shares, 1.0)
        return float(np.sum(x * np.prod(shares, axis=1)))


def _about_extremum(function: Function, low: float, high: float, sign: float) -> list[float]:
    def distance(v: float) -> float:
        return sign * _sample(function, v)

    nearest, value = bounded_minimum(distance, low, high, xtol=0.0)
    if value < 0:
        return _bracketed(function, low, nearest) + _bracketed(function, nearest, high)
    touches = value <= 1e-12 * max(distance(low), distance(high))
    return [nearest] if touches else []
