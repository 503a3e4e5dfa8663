"""Pseudo-arclength continuation of solutions of F(x, q) = 0, as an iterator of points.

The length of a step is measured in the inner product <x, x'> = sum of weights x x' plus the
parameter in units of `parameter_scale`. Source: Keller, in *Applications of Bifurcation Theory*
(ed. Rabinowitz), 1977; Govaerts, *Numerical Methods for Bifurcations*, 2000, chapter 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.linalg import LinAlgError
from scipy.optimize import brentq

from amoeboid.arrays import Array
from amoeboid.numerics.newton import newton, solve
from amoeboid.validation import InvalidInput

WIDTHS = (1e-5, 1e-4, 1e-3)
"""How far from a crossing of branches, in steps, the points lie that it is interpolated from."""

COMPLEX_STEP = 1e-40


class System(Protocol):
    """n equations for n unknowns x that depend on parameters q (k,).

    `residual` and `jacobian` accept complex x and q. `weights` (n,) define the inner product,
    `scale` (n,) the magnitude of the unknowns. `resolved`, `refined`, `prolonged`: whether the
    discretization suffices for x at q, a finer one if allowed, and a vector carried to it.
    """

    @property
    def weights(self) -> Array: ...  # noqa: D102
    @property
    def scale(self) -> Array: ...  # noqa: D102
    def residual(self, x: Array, q: Array) -> Array: ...  # noqa: D102
    def residual_and_jacobian(self, x: Array, q: Array) -> tuple[Array, Array]: ...  # noqa: D102
    def resolved(self, x: Array, q: Array) -> bool: ...  # noqa: D102
    def refined(self) -> System | None: ...  # noqa: D102
    def prolonged(self, x: Array) -> Array: ...  # noqa: D102


def parameter_derivative(system: System, x: Array, q: Array, k: int = 0) -> Array:
    """dF/dq_k by a complex step, exact to rounding."""
    shifted = np.asarray(q, dtype=complex)
    shifted[k] += 1j * COMPLEX_STEP
    return system.residual(x, shifted).imag / COMPLEX_STEP


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


def follow(start: Point, options: Options) -> Iterator[Point]:
    """The points of a branch after `start`, located folds among them, along its tangent.

    Ends after `max_points`; raises Stalled if the smallest step fails. Stop it by not asking on.
    """
    here, step, size = start, options.first_step, _size(start)
    for _ in range(options.max_points):
        there, taken = _next(here, step, options)
        yield from _folds(here, there, options)
        turn = _turn(here, there, options)
        here = adapted(there, options)
        yield here
        step = taken * float(np.clip(options.angle / max(turn, 1e-3), 0.5, 1.6))
        longest = options.max_step * max(1.0, _size(here) / size)
        step = min(max(step, options.min_step), longest)


def _next(here: Point, step: float, options: Options) -> tuple[Point, float]:
    while step >= options.min_step:
        there = at_distance(here, step, options)
        if there is not None and _bend(here, there, options) <= 2 * options.angle:
            return there, step
        step /= 2
    raise Stalled(
        f"no step from parameter = {here.parameter:.10g} succeeds, down to a length of "
        f"{options.min_step:g}"
    )


def _folds(here: Point, there: Point, options: Options) -> Iterator[Point]:
    """The folds between neighbors of a branch, two close ones included.

    Where branches cross the tangent may turn back too, but Newton's method fails: no fold.
    """
    known = [here, *_probes(here, there, options), there]
    for a, b in pairwise(known):
        if a.parameter_tangent * b.parameter_tangent < 0:
            with suppress(Stalled):
                yield located(here, b, lambda p: p.parameter_tangent, options, fold=True, after=a)


def _probes(here: Point, there: Point, options: Options) -> list[Point]:
    """Points between neighbors, where the parameter may turn back twice.

    That is where the cubic through values and slopes at both ends comes near a fold, and next to a
    point at which the tangent has no parameter component: there the branch may fold at once.
    """
    span = there.length - here.length
    if here.parameter_tangent == 0.0:
        shares = [0.25, 0.5]
    else:
        row = slope_row(here, options)
        ends = np.array([slope(q, row) for q in (here, there)])
        rise = (there.parameter - here.parameter) / span
        # slope of the cubic: e_0 (1 - t)^2 + 2 m t (1 - t) + e_1 t^2
        middle = 3 * rise - ends.sum()
        if ends[0] * ends[1] < 0 or abs(ends).min() == 0.0:
            return []
        bend = ends[0] - 2 * middle + ends[1]
        share = (ends[0] - middle) / bend if bend != 0 else 0.5
        lowest = ends[0] + 2 * (middle - ends[0]) * share + bend * share**2
        if not 0 < share < 1 or lowest * np.sign(ends[0]) > 0.25 * abs(ends).min():
            return []
        shares = [float(share)]
    between = (at_distance(here, share * span, options) for share in shares)
    return [point for point in between if point is not None]


def _turn(a: Point, b: Point, options: Options) -> float:
    """Angle between the tangents."""
    cosine = _inner(a.system, a.x_tangent, b.x_tangent) + (
        a.parameter_tangent * b.parameter_tangent / options.parameter_scale**2
    )
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _bend(a: Point, b: Point, options: Options) -> float:
    """Largest angle between the tangents and the chord of neighbors.

    On a smooth curve all are of the order of its turn; a chord that leaves both tangents leads to
    another branch.
    """
    x, parameter = b.x - a.x, (b.parameter - a.parameter) / options.parameter_scale**2
    length = np.sqrt(
        _inner(a.system, x, x) + ((b.parameter - a.parameter) / options.parameter_scale) ** 2
    )
    cosines = [
        (_inner(a.system, x, q.x_tangent) + parameter * q.parameter_tangent) / length
        for q in (a, b)
    ]
    return max(_turn(a, b, options), float(np.arccos(np.clip(min(cosines), -1.0, 1.0))))


def slope_row(anchor: Point, options: Options) -> Array:
    """The functional that measures distance along the tangent at `anchor`."""
    return np.append(
        anchor.system.weights * anchor.x_tangent,
        anchor.parameter_tangent / options.parameter_scale**2,
    )


def slope(point: Point, row: Array) -> float:
    """d(parameter)/d(distance) at a point, distances along the tangent that `row` stands for."""
    along = row @ np.append(point.x_tangent, point.parameter_tangent)
    return float(point.parameter_tangent / along)


def _size(point: Point) -> float:
    return max(1.0, float(np.sqrt(_inner(point.system, point.x, point.x))))


def _inner(system: System, a: Array, b: Array) -> float:
    return float(np.sum(system.weights * a * b))


def at_distance(
    start: Point, distance: float, options: Options, guess: Array | None = None
) -> Point | None:
    """The point of the branch whose projection on the tangent at `start` is `distance` on.

    Newton's method starts from `guess` (x, parameter), by default from the tangent.
    """
    system, n = start.system, start.x.size
    row = slope_row(start, options)
    origin = np.append(start.x, start.parameter)
    tangent = np.append(start.x_tangent, start.parameter_tangent)

    def residual(y: Array) -> Array:
        return np.append(system.residual(y[:n], y[n:]), row @ (y - origin) - distance)

    def jacobian(y: Array) -> tuple[Array, Array]:
        return residual_and_bordered(system, y, row, row @ (y - origin) - distance)

    scale = np.append(system.scale, options.parameter_scale)
    found = newton(
        residual, jacobian, origin + distance * tangent if guess is None else guess,
        scale=scale, step_tolerance=1e-7, max_iterations=8,
    )  # fmt: skip
    if not found.converged:
        return None
    y = found.x
    return with_tangent(
        replace(start, x=y[:n], parameter=float(y[n]), length=start.length + distance),
        row,
        options,
    )


def residual_and_bordered(system: System, y: Array, row: Array, last: float) -> tuple[Array, Array]:
    """Residual and Jacobian of F(x, q) = 0 together with one linear condition on y = (x, q)."""
    n = y.size - 1
    f, f_x = system.residual_and_jacobian(y[:n], y[n:])
    matrix = np.empty((n + 1, n + 1))
    matrix[:n, :n] = f_x
    matrix[:n, n] = parameter_derivative(system, y[:n], y[n:])
    matrix[n] = row
    return np.append(f, last), matrix


def with_tangent(point: Point, row: Array, options: Options) -> Point | None:
    """`point` with its unit tangent, on the side to which the functional `row` is positive."""
    y = np.append(point.x, point.parameter)
    try:
        _, matrix = residual_and_bordered(point.system, y, row, 0.0)
        tangent = solve(matrix, np.append(np.zeros(point.x.size), 1.0))
    except (LinAlgError, InvalidInput):
        return None
    norm = np.sqrt(
        _inner(point.system, tangent[:-1], tangent[:-1])
        + (tangent[-1] / options.parameter_scale) ** 2
    )
    tangent /= norm
    return replace(point, x_tangent=tangent[:-1], parameter_tangent=float(tangent[-1]))


def adapted(point: Point, options: Options) -> Point:
    """The point on a system fine enough for it; the point itself if it is resolved."""
    while not point.system.resolved(point.x, np.array([point.parameter])):
        finer = _refined(point, options)
        if finer is None:
            raise Unresolved(point)
        point = finer
    return point


def _refined(point: Point, options: Options) -> Point | None:
    system = point.system.refined()
    if system is None:
        return None
    carried = replace(
        point,
        system=system,
        x=point.system.prolonged(point.x),
        x_tangent=point.system.prolonged(point.x_tangent),
    )
    return at_distance(carried, 0.0, options)


def located(
    a: Point,
    b: Point,
    test: Callable[[Point], float],
    options: Options,
    fold: bool = False,
    after: Point | None = None,
    widths: Sequence[float] = WIDTHS,
) -> Point:
    """The point between neighbors a and b of a branch where `test` changes sign.

    `test` is NaN for points that are not on the branch. If `after` is given, a point on the way,
    only beyond it.

    Newton's method has no chance at a point where branches cross; there the test is interpolated
    between points just beside it, at most `widths` of the way from a to b off. Raises Stalled if
    those cannot be reached either.
    """
    first = a if after is None else after
    begin, span = first.length - a.length, b.length - a.length
    known = {begin: (first, test(first)), span: (b, test(b))}
    missed: list[float] = []

    def at(distance: float) -> float:
        if distance not in known:
            found = at_distance(a, distance, options)
            value = np.nan if found is None else test(found)
            if found is None or np.isnan(value):
                missed.append(distance)
                raise Stalled(f"no solution near parameter = {a.parameter:.10g}")
            known[distance] = found, value
        return known[distance][1]

    try:
        root = brentq(at, begin, span, xtol=1e-9 * span, rtol=1e-13)
        at(root)
        point = known[root][0]
    except Stalled:
        for width in widths:
            with suppress(Stalled):
                at(max(missed[0] - width * span, begin))
                at(min(missed[0] + width * span, span))
                break
        point = _interpolated(known, 2.1 * max(widths) * span)
    return replace(point, fold=fold)


def _interpolated(known: dict[float, tuple[Point, float]], widest: float) -> Point:
    """The zero of the test in the narrowest bracket of known values.

    On the straight line through the ends of the bracket, or, where that is wide, on the parabola
    through the nearest point besides.
    """
    ordered = sorted(known)
    brackets = [(q - p, p, q) for p, q in pairwise(ordered) if known[p][1] * known[q][1] <= 0]
    width, left, right = min(brackets)
    (a, f), (b, g) = known[left], known[right]
    if width > widest:
        raise Stalled(f"no solution near parameter = {a.parameter:.10g}")
    share = f / (f - g) if f != g else 0.0
    found = replace(
        a,
        x=a.x + share * (b.x - a.x),
        parameter=a.parameter + share * (b.parameter - a.parameter),
        length=a.length + share * width,
    )
    middle = 0.5 * (left + right)
    others = [distance for distance in ordered if distance not in (left, right)]
    if width <= 2.1 * max(WIDTHS) * (ordered[-1] - ordered[0]) or not others:
        return found
    c, h = known[min(others, key=lambda distance: abs(distance - middle))]
    if h in (f, g):
        return found
    # Newton's form of the parabola in the test, at zero
    second = f * g / ((h - f) * (h - g))

    def curved(a: Any, b: Any, c: Any) -> Any:
        return second * (c - a - (b - a) * (h - f) / (g - f))

    return replace(
        found,
        x=found.x + curved(a.x, b.x, c.x),
        parameter=float(found.parameter + curved(a.parameter, b.parameter, c.parameter)),
    )


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
