"""Roots and minima of functions of one variable between two numbers, by SciPy.

`scipy.optimize` takes 0.3 s to import, and many commands need none of it: it is imported here, when
the first root is sought.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

XTOL, RTOL = 2e-12, 1e-14


def bracketed_root(
    function: Callable[[float], Any],
    low: float,
    high: float,
    xtol: float = XTOL,
    rtol: float = RTOL,
) -> float:
    """A root between two numbers at which the signs differ, to within xtol + rtol |root|.

    Raises ValueError where the signs are the same, and if a value is NaN, and RuntimeError if it is
    not found.

    >>> round(bracketed_root(lambda x: x**2 - 2.0, 0.0, 2.0), 10)
    1.4142135624
    """
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=xtol, rtol=rtol))


def bounded_minimum(
    function: Callable[[float], Any], low: float, high: float, xtol: float
) -> tuple[float, float]:
    """A minimum between two numbers, to within xtol, and its value."""
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(function, bounds=(low, high), method="bounded", options={"xatol": xtol})
    return float(best.x), float(best.fun)
