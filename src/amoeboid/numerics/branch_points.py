"""Points of a branch of solutions of F(x, q) = 0: found at a distance, or at a parameter value.

Distances are measured in the inner product <x, x'> = sum of weights x x' plus the parameter in
units of `parameter_scale`. Source: Keller, in *Applications of Bifurcation Theory* (ed.
Rabinowitz), 1977; Govaerts, *Numerical Methods for Bifurcations*, 2000, chapter 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.linalg import LinAlgError

from amoeboid.arrays import Array
from amoeboid.numerics.newton import Factor, newton, solve
from amoeboid.validation import InvalidInput

COMPLEX_STEP = 1e-40

TANGENT_LEFT, MAX_REFINEMENTS = 1e-10, 4
"""Relative error of a tangent that refinement may leave, and how many refinements are tried.

After those the Jacobian at the point itself is made.
"""


class System(Protocol):
    """n equations for n unknowns x that depend on parameters q (k,).

    `residual` and `jacobian` accept complex x and q. `weights` (n,) define the inner product,
    `scale` (n,) the magnitude of the unknowns. `resolved`, `refined`, `prolonged`: whether the
    discretization suffices for x at q, a finer one for it if allowed, and a vector carried to that.
    """

    @property
    def weights(self) -> Array: ...  # noqa: D102
    @property
    def scale(self) -> Array: ...  # noqa: D102
    def residual(self, x: Array, q: Array) -> Array: ...  # noqa: D102
    def residual_and_jacobian(self, x: Array, q: Array) -> tuple[Array, Array]: ...  # noqa: D102
    def resolved(self, x: Array, q: Array) -> bool: ...  # noqa: D102
    def refined(self, x: Array, q: Array) -> System | None: ...  # noqa: D102
    def prolonged(self, x: Array, finer: Any) -> Array: ...  # noqa: D102


@dataclass(frozen=True)
class Options:
    """How a branch is followed; lengths in the norm of the module docstring.

    `angle` is the turn of the tangent aimed at in one step; a step that turns by more than twice
    that, or whose Newton iteration fails, is halved down to `min_step`. `max_step` is the longest
    step while |x| is of the order of its scale; it grows in proportion to |x| where that grows.
    """

    parameter_scale: float = 1.0
    first_step: float = 0.05
    min_step: float = 1e-6
    max_step: float = 0.5
    angle: float = 0.15
    max_points: int = 400

    def __post_init__(self) -> None:
        for name in ("parameter_scale", "first_step", "min_step", "max_step", "angle"):
            if not getattr(self, name) > 0:
                raise InvalidInput(f"{name} must be > 0, got {getattr(self, name)!r}")
        if self.max_points < 1:
            raise InvalidInput(f"max_points must be >= 1, got {self.max_points}")


@dataclass(frozen=True)
class Point:
    """A solution (x, parameter) on a branch, with its unit tangent.

    `length` is the arclength from the first point; `fold` says that the branch turns back here.
    """

    system: System
    x: Array
    parameter: float
    x_tangent: Array
    parameter_tangent: float
    length: float = 0.0
    fold: bool = False


class Stalled(Exception):
    """No step, however short, could be taken from a point of the branch."""


class Unresolved(Stalled):
    """The finest discretization does not resolve a point of the branch, `point`."""

    def __init__(self, point: Point) -> None:
        super().__init__(
            f"the finest discretization does not resolve the solution at parameter = "
            f"{point.parameter:.10g}"
        )
        self.point = point


def joined(x: Array, parameter: Any) -> Array:
    """(x, parameter) as one vector."""
    y = np.empty(x.size + 1, x.dtype)
    y[:-1], y[-1] = x, parameter
    return y


def slope_row(anchor: Point, options: Options) -> Array:
    """The functional that measures distance along the tangent at `anchor`."""
    return joined(
        anchor.system.weights * anchor.x_tangent,
        anchor.parameter_tangent / options.parameter_scale**2,
    )


def slope(point: Point, row: Array) -> float:
    """d(parameter)/d(distance) at a point, distances along the tangent that `row` stands for."""
    along = row @ joined(point.x_tangent, point.parameter_tangent)
    return float(point.parameter_tangent / along)


def cubic(f: Any, df: Any, g: Any, dg: Any, t: float) -> Any:
    """The cubic with the values f at t = 0 and g at t = 1, and the slopes df and dg."""
    return (
        (1 + 2 * t) * (1 - t) ** 2 * f
        + t * (1 - t) ** 2 * df
        + t * t * (3 - 2 * t) * g
        - t * t * (1 - t) * dg
    )


def interpolated(low: Point, high: Point, share: float, row: Array, width: float) -> Array:
    """(x, parameter) at a share of the distance `width` between two points, from the cubic.

    Distances are along the tangent that `row` stands for.
    """

    def tangent(q: Point) -> Array:
        full = joined(q.x_tangent, q.parameter_tangent)
        return full * (width / (row @ full))

    ends = [joined(q.x, q.parameter) for q in (low, high)]
    return np.asarray(cubic(ends[0], tangent(low), ends[1], tangent(high), share))


def size_of(point: Point) -> float:
    """The norm of x, at least 1."""
    return max(1.0, float(np.sqrt(inner(point.system, point.x, point.x))))


def inner(system: System, a: Array, b: Array) -> float:
    """<a, b>, without the parameter."""
    return float((system.weights * a) @ b)


def at_distance(
    start: Point, distance: float, options: Options, guess: Array | None = None
) -> Point | None:
    """The point of the branch whose projection on the tangent at `start` is `distance` on.

    Newton's method starts from `guess` (x, parameter), by default from the tangent.
    """
    system, n = start.system, start.x.size
    row = slope_row(start, options)
    origin = joined(start.x, start.parameter)
    tangent = joined(start.x_tangent, start.parameter_tangent)

    def residual(y: Array) -> Array:
        return joined(system.residual(y[:n], y[n:]), row @ (y - origin) - distance)

    def jacobian(y: Array) -> tuple[Array, Array]:
        return residual_and_bordered(system, y, row, row @ (y - origin) - distance)

    found = newton(
        residual,
        jacobian,
        origin + distance * tangent if guess is None else guess,
        scale=joined(system.scale, options.parameter_scale),
        step_tolerance=1e-7,
        max_iterations=8,
    )
    if not found.converged:
        return None
    y = found.x
    point = replace(start, x=y[:n], parameter=float(y[n]), length=start.length + distance)
    return with_tangent(point, row, options, found.jacobian)


def residual_and_bordered(system: System, y: Array, row: Array, last: float) -> tuple[Array, Array]:
    """Residual and Jacobian of F(x, q) = 0 together with one linear condition on y = (x, q)."""
    n = y.size - 1
    f, f_x = system.residual_and_jacobian(y[:n], y[n:])
    matrix = np.empty((n + 1, n + 1))
    matrix[:n, :n] = f_x
    matrix[:n, n] = parameter_derivative(system, y[:n], y[n:])
    matrix[n] = row
    return joined(f, last), matrix


def with_tangent(
    point: Point, row: Array, options: Options, near: Factor | None = None
) -> Point | None:
    """`point` with its unit tangent, on the side to which the functional `row` is positive.

    `near`: factors of the bordered Jacobian of a point nearby, if there are any.
    """
    tangent = _refined_tangent(point, row, near) if near is not None else None
    if tangent is None:
        try:
            y = joined(point.x, point.parameter)
            _, matrix = residual_and_bordered(point.system, y, row, 0.0)
            tangent = solve(matrix, joined(np.zeros(point.x.size), 1.0))
        except (LinAlgError, InvalidInput):
            return None
    x_tangent, direction = tangent[:-1], float(tangent[-1])
    norm = np.sqrt(
        inner(point.system, x_tangent, x_tangent) + (direction / options.parameter_scale) ** 2
    )
    return replace(point, x_tangent=x_tangent / norm, parameter_tangent=float(direction / norm))


def _refined_tangent(point: Point, row: Array, near: Factor) -> Array | None:
    """The solution t of F_x t_x + F_q t_q = 0, row t = 1 by iterative refinement.

    The products with the Jacobian at the point are exact: they are complex steps along t. None
    where the refinement does not converge fast.
    """
    n = point.x.size
    right = joined(np.zeros(n), 1.0)
    tangent = near.solve(right)
    change = 1.0
    for _ in range(MAX_REFINEMENTS):
        try:
            along = _along(point, tangent)
        except InvalidInput:
            return None
        correction = near.solve(right - joined(along, row @ tangent))
        tangent = tangent + correction
        before, change = change, float(np.linalg.norm(correction) / np.linalg.norm(tangent))
        if not change < 0.1 * before:  # nan included
            return tangent if change <= TANGENT_LEFT else None
        if change * change <= TANGENT_LEFT * before:  # the next change, by the ratio of two
            return tangent
    return None


def _along(point: Point, direction: Array) -> Array:
    """The derivative of F at a point along a direction (x, parameter), by a complex step."""
    step = 1j * COMPLEX_STEP
    moved = point.x + step * direction[:-1], np.array([point.parameter + step * direction[-1]])
    return point.system.residual(*moved).imag / COMPLEX_STEP


def parameter_derivative(system: System, x: Array, q: Array, k: int = 0) -> Array:
    """dF/dq_k by a complex step, exact to rounding."""
    shifted = np.asarray(q, dtype=complex)
    shifted[k] += 1j * COMPLEX_STEP
    return system.residual(x, shifted).imag / COMPLEX_STEP


def adapted(point: Point, options: Options) -> Point:
    """The point on a system fine enough for it; the point itself if it is resolved."""
    while not point.system.resolved(point.x, np.array([point.parameter])):
        finer = point.system.refined(point.x, np.array([point.parameter]))
        found = None if finer is None else at_distance(carried(point, finer), 0.0, options)
        if found is None:
            raise Unresolved(point)
        point = found
    return point


def carried(point: Point, finer: System) -> Point:
    """The point on a finer system, before Newton's method there."""
    carry = point.system.prolonged
    x, x_tangent = (carry(vector, finer) for vector in (point.x, point.x_tangent))
    return replace(point, system=finer, x=x, x_tangent=x_tangent)


def at_parameter(system: System, x: Array, parameter: float) -> Array | None:
    """The solution at a given parameter near x; None if Newton's method does not converge."""
    q = np.array([parameter])
    found = newton(
        lambda y: system.residual(y, q),
        lambda y: system.residual_and_jacobian(y, q),
        x,
        scale=system.scale,
    )
    return found.x if found.converged else None


def started(
    system: System, x: Array, parameter: float, towards: Array, direction: float, options: Options
) -> Point:
    """A point with a unit tangent given as (towards, direction), for instance a null vector."""
    norm = np.sqrt(np.sum(system.weights * towards**2) + (direction / options.parameter_scale) ** 2)
    if not norm > 0:
        raise InvalidInput("the direction in which to leave the start must not be zero")
    return Point(system, x, parameter, towards / norm, direction / norm)


def through(
    system: System, x: Array, parameter: float, direction: float, options: Options
) -> Point:
    """The solution near x with the tangent of the branch, the parameter growing if direction > 0.

    Raises Stalled if there is no solution, or no single branch, near x.
    """
    guess = started(system, x, parameter, np.zeros(x.size), direction, options)
    found = at_distance(guess, 0.0, options)
    if found is None:
        raise Stalled(f"no single branch passes through parameter = {parameter:.10g}")
    return found
