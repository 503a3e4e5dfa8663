"""Roots and minima of functions of one variable between two numbers.

A root is sought here: to import `scipy.optimize` takes longer than most commands that need one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

MAX_ITERATIONS = 400
MIN_RTOL = 4 * 2.0**-52


def bracketed_root(
    function: Callable[[float], Any],
    low: float,
    high: float,
    xtol: float = 2e-12,
    rtol: float = MIN_RTOL,
) -> float:
    """A root between two numbers at which the signs differ, to within xtol + rtol |root|.

    By inverse quadratic interpolation where the last three values allow it, else by bisection
    (T. R. Chandrupatla, Adv. Eng. Softw. 28, 145, 1997). The root is a number that the function was
    called with. Raises ValueError where the signs are the same, and if a value is NaN, and
    ArithmeticError if it is not found, as between numbers that differ by hundreds of decades.

    >>> bracketed_root(lambda x: x**2 - 2.0, 0.0, 2.0)
    1.4142135623730951
    """
    a, b = float(low), float(high)
    fa, fb = float(function(a)), float(function(b))
    same = (fa > 0.0) == (fb > 0.0) and fa != 0.0 and fb != 0.0
    if same or math.isnan(fa) or math.isnan(fb):
        raise ValueError(f"no change of sign between {a!r} and {b!r}, got {fa!r} and {fb!r}")
    share = 0.5
    for _ in range(MAX_ITERATIONS):
        best, value = (a, fa) if abs(fa) < abs(fb) else (b, fb)
        # half of the tolerance as a share of the bracket
        least = 0.5 * (xtol + max(rtol, MIN_RTOL) * abs(best)) / max(abs(b - a), 5e-324)
        if value == 0.0 or least > 0.5:
            return best
        x = a + min(max(share, least), 1.0 - least) * (b - a)
        fx = float(function(x))
        if math.isnan(fx):
            raise ValueError(f"the function is not a number at {x!r}")
        # the bracket is from the newest point to the latest with the other sign; c is before
        if (fx > 0.0) == (fa > 0.0):
            c, fc = a, fa
        else:
            b, fb, c, fc = a, fa, b, fb
        a, fa = x, fx
        share = _interpolated(a, fa, b, fb, c, fc)
    raise ArithmeticError(f"no root found between {low!r} and {high!r}, the last was {best!r}")


def _interpolated(a: float, fa: float, b: float, fb: float, c: float, fc: float) -> float:
    """The share of the way from a to b at which the inverse quadratic vanishes, 0.5 if unsafe."""
    if fb == fc or c == b:
        return 0.5
    place, height = (a - b) / (c - b), (fa - fb) / (fc - fb)
    rest = 1.0 - height
    if not (height * height < place and rest * rest < 1.0 - place):
        return 0.5
    return fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)


def bounded_minimum(
    function: Callable[[float], Any], low: float, high: float, xtol: float
) -> tuple[float, float]:
    """A minimum between two numbers, to within xtol, and its value; by SciPy, as it is rare."""
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(function, bounds=(low, high), method="bounded", options={"xatol": xtol})
    return float(best.x), float(best.fun)
