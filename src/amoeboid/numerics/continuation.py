"""Pseudo-arclength continuation of solutions of F(x, q) = 0, as an iterator of points.

See `branch_points` for the length of a step, and sources.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.branch_points import (
    Options,
    Point,
    Stalled,
    adapted,
    at_distance,
    carried,
    inner,
    joined,
    size_of,
    slope,
    slope_row,
)
from amoeboid.numerics.locating import located

MAX_EXTRAPOLATION = 3.0
"""Ratio of the next step to the last one up to which the cubic through both points guesses it."""


def follow(
    start: Point, options: Options, enough: Callable[[Point], bool] = lambda point: False
) -> Iterator[Point]:
    """The points of a branch after `start`, located folds among them, along its tangent.

    Ends after `max_points`, or with the first point that is `enough`, resolved or not; raises
    Stalled if the smallest step fails. Stop it by not asking on.
    """
    here, step, size = start, options.first_step, size_of(start)
    before: Point | None = None
    for _ in range(options.max_points):
        there, taken = _next(here, step, options, before)
        yield from _folds(here, there, options)
        if enough(there):
            yield there
            return
        turn = _turn(here, there, options)
        before, here = here, adapted(there, options)
        yield here
        step = taken * min(max(options.angle / max(turn, 1e-3), 0.5), 1.6)
        longest = options.max_step * max(1.0, size_of(here) / size)
        step = min(max(step, options.min_step), longest)


def _next(here: Point, step: float, options: Options, before: Point | None) -> tuple[Point, float]:
    while step >= options.min_step:
        there = at_distance(here, step, options, _extrapolated(before, here, step, options))
        if there is not None and _bend(here, there, options) <= 2 * options.angle:
            return there, step
        step /= 2
    raise Stalled(
        f"no step from parameter = {here.parameter:.10g} succeeds, down to a length of "
        f"{options.min_step:g}"
    )


def _extrapolated(before: Point | None, here: Point, step: float, options: Options) -> Array | None:
    """(x, parameter) a step beyond `here`, on the cubic through two points and their tangents.

    None without a point before, or with one on a finer system, or so near that the cubic has left
    its range: the tangent is the safer guess then.
    """
    if before is None or before.x.size > here.x.size:
        return None
    if before.x.size < here.x.size:
        before = carried(before, here.system)
    row = slope_row(here, options)
    old, new = (joined(q.x, q.parameter) for q in (before, here))
    slopes = [joined(q.x_tangent, q.parameter_tangent) for q in (before, here)]
    width = row @ (new - old)
    along = row @ slopes[0]
    if not (width > step / MAX_EXTRAPOLATION and along > 0):
        return None
    slopes[0] = slopes[0] / along
    t = step / width
    # the cubic minus the tangent at `here`, in powers of the distance from there over the width
    chord = (new - old) / width
    square, cube = 2 * slopes[1] + slopes[0] - 3 * chord, slopes[1] + slopes[0] - 2 * chord
    return np.asarray(new + step * slopes[1] + step * t * (square + t * cube))


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
    cosine = inner(a.system, a.x_tangent, b.x_tangent) + (
        a.parameter_tangent * b.parameter_tangent / options.parameter_scale**2
    )
    return math.acos(min(max(cosine, -1.0), 1.0))


def _bend(a: Point, b: Point, options: Options) -> float:
    """Largest angle between the tangents and the chord of neighbors.

    On a smooth curve all are of the order of its turn; a chord that leaves both tangents leads to
    another branch.
    """
    x, parameter = b.x - a.x, (b.parameter - a.parameter) / options.parameter_scale**2
    length = math.sqrt(
        inner(a.system, x, x) + ((b.parameter - a.parameter) / options.parameter_scale) ** 2
    )
    cosines = [
        (inner(a.system, x, q.x_tangent) + parameter * q.parameter_tangent) / length for q in (a, b)
    ]
    return max(_turn(a, b, options), math.acos(min(max(min(cosines), -1.0), 1.0)))
