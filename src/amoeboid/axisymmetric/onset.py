"""Where the homogeneous sphere becomes unstable, and in which direction a branch leaves it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from amoeboid.axisymmetric.stability import sphere_block
from amoeboid.axisymmetric.steady import MODES, SteadySystem, homogeneous_unknowns
from amoeboid.axisymmetric.unknowns import split
from amoeboid.numerics.continuation import Options, Point, started
from amoeboid.parameters import Parameters
from amoeboid.validation import InvalidInput

Array = NDArray[Any]

LARGEST_SPEED = 1e12
"""Thresholds in v_p0 are sought up to this many times D/R0 + beta R0."""


def _critical(p: Parameters, name: str, l: int) -> Callable[[float], float]:  # noqa: E741
    def determinant(value: float) -> float:
        block = sphere_block(p.replace(**{name: float(value)}), l)
        scale = np.max(np.abs(block), axis=0)
        return float(np.linalg.det(block / np.where(scale > 0, scale, 1.0)))

    return determinant


def onsets(
    p: Parameters,
    name: str,
    low: float,
    high: float,
    l: int = 1,  # noqa: E741
) -> tuple[float, ...]:
    """Values of the parameter `name` in [low, high] where a real mode l of the sphere is neutral.

    Found to rounding; two that lie closer than a fortieth of the interval may be missed.
    """
    return _roots(_critical(p, name, l), np.linspace(low, high, 41))


def onset_speed(p: Parameters, l: int = 1) -> float | None:  # noqa: E741
    """Smallest v_p0 at which mode l of the homogeneous sphere is neutral; None if there is none."""
    unit = p.D / p.R0 + p.beta * p.R0 + p.alpha * p.c0 * p.R0 / (p.eta_s + p.eta_b)
    if unit == 0:
        return None
    found = _roots(_critical(p, "v_p0", l), unit * np.geomspace(1e-6, LARGEST_SPEED, 37))
    return found[0] if found else None


def _roots(function: Callable[[float], float], grid: Array) -> tuple[float, ...]:
    values = [function(v) for v in grid]
    pairs = zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True)
    return tuple(
        float(brentq(function, a, b, xtol=1e-14 * max(abs(a), abs(b)), rtol=1e-14))
        for a, b, f, g in pairs
        if f * g < 0 or (f == 0 and a == grid[0])
    )


def departure(
    p: Parameters, name: str, value: float, options: Options, n: int = MODES, sign: float = 1.0
) -> Point:
    """The branch point of the homogeneous state at `value`, its tangent along the null vector.

    For sign = +1 the new branch leaves with more filaments at the pole x = 0 (the rear).
    Raises InvalidInput where the homogeneous state has no single neutral mode.
    """
    at = p.replace(**{name: value})
    system = SteadySystem(at, n, (name,))
    x = homogeneous_unknowns(at, n)
    _, jacobian = system.residual_and_jacobian(x, np.array([value]))
    _, sizes, modes = np.linalg.svd(jacobian * system.scale)
    if not (sizes[-1] < 1e-9 * sizes[0] and sizes[-1] < 1e-3 * sizes[-2]):
        raise InvalidInput(f"{name} = {value:.10g} is no simple branch point of the sphere")
    null = modes[-1] * system.scale
    rear = np.sum(split(null, n)[2])
    towards = null if rear * sign > 0 else -null
    return started(system, x, value, towards, 0.0, options)
