"""Where the homogeneous sphere becomes unstable, and the tangent of the branch from there."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise

import numpy as np
from numpy.linalg import LinAlgError

from amoeboid.arrays import Array
from amoeboid.axisymmetric.stability import sphere_block
from amoeboid.axisymmetric.steady import homogeneous_unknowns
from amoeboid.axisymmetric.system import MODES, SteadySystem
from amoeboid.axisymmetric.unknowns import split
from amoeboid.closed_forms.linear import proportional_to_speed, thresholds
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.bracketed import bounded_minimum, bracketed_root
from amoeboid.numerics.branch_points import COMPLEX_STEP, Options, Point, started
from amoeboid.validation import InvalidInput

LARGEST_SPEED = 1e12
"""Thresholds in v_p0 are sought up to this many times D/R0 + beta R0."""

SYMMETRIC = 1e-7
"""Relative change of the parameter with the amplitude below which it is zero by symmetry."""


def _critical(p: Parameters, name: str, l: int) -> Callable[[float], float]:  # noqa: E741
    """The determinant of mode l in units of the rates that it is made of, smooth in `name`."""

    def determinant(value: float) -> float:
        try:
            at = p.replace(**{name: float(value)})
            with np.errstate(all="ignore"):
                block = sphere_block(at, l)
                unit = at.beta + at.D / at.R0**2 + abs(float(at.v_p(at.c0))) / at.R0
        except (InvalidInput, LinAlgError):
            return np.nan  # the law has no value there
        if not np.all(np.isfinite(block)):
            return np.nan
        sizes = np.array([at.R0, at.c0 or at.c_r])[-block.shape[0] :]
        block = block * sizes / sizes[:, None]
        scale = np.max(np.abs(block), axis=0) + unit
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

    Found to rounding, in ascending order.
    """
    return _roots(_critical(p, name, l), np.linspace(low, high, 41))


def onsets_anywhere(p: Parameters, name: str, l: int = 1) -> tuple[float, ...]:  # noqa: E741
    """The same for all values of a parameter from its unit / 1e4 to its unit * 1e4.

    The unit is the value in p, or if that is 0 the one that compares with the rest of p.
    """
    if name == "v_p0":
        return onset_speeds(p, l)
    return _roots(_critical(p, name, l), np.sort(_unit(p, name) * np.geomspace(1e-4, 1e4, 81)))


def _unit(p: Parameters, name: str) -> float:
    value = p.value(name)
    if value != 0:
        return value
    rate = max(p.beta, p.D / p.R0**2, abs(float(p.v_p(p.c0))) / p.R0)
    stress = (p.eta_s + p.eta_b) * rate / p.R0
    friction = (p.eta_s + p.eta_b) / p.R0**2
    return {
        "delta_P": stress,
        "eta_b": p.eta_s,
        "c0": p.c_r,
        "beta": rate,
        "D": rate * p.R0**2,
        "alpha": stress * p.R0 / (p.c0 or p.c_r),
        "chi": stress * p.R0 / (p.c0 or p.c_r),
        "kappa": stress * p.R0**3,
        "gamma_t": friction,
        "gamma_n": friction,
        "gamma_c": friction,
    }.get(name) or _unit_of_own(p, name, stress * p.R0, rate * p.R0)


def _unit_of_own(p: Parameters, name: str, tension: float, speed: float) -> float:
    """That of a parameter of law or stress: what changes tau or v_p at c0 by a typical amount."""
    at = p.point({name: p.value(name) + 1j * COMPLEX_STEP})
    with np.errstate(all="ignore"):
        changes = (at.tau(p.c0).imag / tension, at.v_p(p.c0).imag / speed)
    largest = float(np.abs(changes).max()) / COMPLEX_STEP
    return 1.0 / largest if np.isfinite(largest) and largest > 0 else 1.0


def onset_speeds(p: Parameters, l: int = 1) -> tuple[float, ...]:  # noqa: E741
    """All v_p0 at which a real mode l of the homogeneous sphere is neutral, ascending.

    In closed form where there is one: l = 1 with a law that is proportional to v_p0.
    """
    tension = abs(float(p.tau_derivatives(p.c0, 1)[1])) * p.c0
    unit = p.D / p.R0 + p.beta * p.R0 + tension * p.R0 / (p.eta_s + p.eta_b)
    if unit == 0:
        return ()
    with np.errstate(over="ignore"):  # speeds beyond double precision are rejected
        speeds = unit * np.geomspace(1e-6, LARGEST_SPEED, 37)
    if l == 1:
        with suppress(InvalidInput):  # the law has no value at some speed: look where it has
            if proportional_to_speed(p):
                found = thresholds(p).v_p0
                return tuple(float(v) for v in found if v <= speeds[-1])
    return _roots(_critical(p, "v_p0", l), speeds)


def onset_speed(p: Parameters, l: int = 1) -> float | None:  # noqa: E741
    """Smallest v_p0 at which mode l of the homogeneous sphere is neutral; None if there is none."""
    found = onset_speeds(p, l)
    return found[0] if found else None


def _times(factor: float, function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda v: factor * function(v)


def _roots(function: Callable[[float], float], grid: Array) -> tuple[float, ...]:
    """The zeros of a function on an ascending grid, two between the same neighbors included."""
    values = [function(v) for v in grid]
    known = list(zip(grid, values, strict=True))
    for k in range(1, grid.size - 1):
        around = values[k - 1 : k + 2]
        sign = np.sign(around[1])
        left, middle, right = (sign * value for value in around)
        # an extremum towards zero may hide two zeros
        if 0 < middle < min(left, right):
            ends = grid[k - 1], grid[k + 1]
            towards = _times(float(sign), function)
            nearest, value = bounded_minimum(towards, *ends, xtol=1e-6 * (ends[1] - ends[0]))
            if value < 0:
                known.append((nearest, sign * value))
    known.sort()
    return tuple(
        bracketed_root(function, a, b, xtol=1e-14 * max(abs(a), abs(b)), rtol=1e-14)
        for (a, f), (b, g) in pairwise(known)
        if f * g < 0 or (f == 0 and a == grid[0])
    )


def branch_tangent(
    p: Parameters, name: str, value: float, options: Options, n: int = MODES, sign: float = 1.0
) -> Point:
    """The branch point of the homogeneous state at `value` with the tangent of the new branch.

    For sign = +1 the new branch leaves with more filaments at the pole x = 0 (the rear).
    Raises InvalidInput where the homogeneous state has no single neutral mode.
    """
    at = p.replace(**{name: value})
    system = SteadySystem(at, n, (name,))
    x = homogeneous_unknowns(at, n)
    _, jacobian = system.residual_and_jacobian(x, np.array([value]))
    left, sizes, modes = np.linalg.svd(jacobian * system.scale)
    if not (sizes[-1] < 1e-9 * sizes[0] and sizes[-1] < 1e-3 * sizes[-2]):
        raise InvalidInput(f"{name} = {value:.10g} is not a simple branch point of the sphere")
    null = modes[-1] * system.scale
    rear = np.sum(split(null, n)[2])
    towards = null if rear * sign > 0 else -null
    along = _along_sphere(p, name, value, n)
    drift = _drift(system, x, along, value, towards, left[:, -1])
    size = np.sqrt(np.sum(system.weights * towards**2))
    if abs(drift) <= SYMMETRIC * size * options.parameter_scale:
        drift = 0.0
    return started(system, x, value, towards + drift * along, drift, options)


def _along_sphere(p: Parameters, name: str, value: float, n: int) -> Array:
    """d/d(name) of the unknowns of the homogeneous sphere."""
    shifted = SteadySystem(p, n, (name,)).point(np.array([value + 1j * COMPLEX_STEP]))
    return homogeneous_unknowns(shifted, n).imag / COMPLEX_STEP


def _drift(
    system: SteadySystem, x: Array, along: Array, value: float, towards: Array, left: Array
) -> float:
    """d(parameter)/d(amplitude) of the new branch at its origin: -<F_xx t t>/(2 <dF_x/dq t>).

    <> is the product with the left null vector, dF_x/dq taken along the sphere. Zero where the two
    directions mirror each other (odd l): a pitchfork; else the bifurcation is transcritical.
    Source: Govaerts, *Numerical Methods for Bifurcations*, 2000, chapter 7.
    """
    q = np.array([value])
    step = 1j * COMPLEX_STEP
    bent = system.residual_and_jacobian(x + step * towards, q)[1].imag / COMPLEX_STEP
    moved = system.residual_and_jacobian(x + step * along, q + step)[1].imag / COMPLEX_STEP
    return -float(left @ bent @ towards) / (2 * float(left @ moved @ towards))
