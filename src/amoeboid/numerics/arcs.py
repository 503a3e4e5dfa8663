"""The parts of a branch between neighboring points, and the solutions on them at a given value.

Between neighbors, cut at its folds, the parameter is a monotone function of the distance along the
tangent at the first of them. The distance at which it takes a value is found within a bracket: that
works next to folds and bifurcations as well, where Newton's method at a fixed parameter may
diverge or end at another solution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.bracketed import bracketed_root
from amoeboid.numerics.branch_points import (
    Options,
    Point,
    Stalled,
    System,
    Unresolved,
    at_distance,
    at_parameter,
    carried,
    cubic,
    interpolated,
    slope,
    slope_row,
    with_tangent,
)
from amoeboid.numerics.continuation import follow

MAX_EVALUATIONS = 80
ROUNDING = float(np.finfo(float).eps)
NEAR = 0.05
"""How far from the cubic a state may lie that is taken without a bracket; see `_direct`."""
PRECISION = 1e-13
"""Relative precision to which the parameter is met before Newton's method at that parameter."""


@dataclass(frozen=True, eq=False)
class Arc:
    """The branch from `a` to `b`, without a fold inside; distances are measured from `anchor`.

    The length of points grows from a to b. An arc that was found from its far end has an anchor
    beyond b; its points have the tangents that they were found with, against the way.
    """

    anchor: Point
    a: Point
    b: Point

    def holds(self, value: float) -> bool:
        """Whether the parameter takes the value on the arc, ends included."""
        return (
            min(self.a.parameter, self.b.parameter)
            <= value
            <= max(self.a.parameter, self.b.parameter)
        )

    @property
    def backwards(self) -> bool:
        """Whether the anchor lies beyond b."""
        return self.anchor.length > self.a.length

    def forwards(self, point: Point) -> Point:
        """A point found on the arc, with its tangent on the way from a to b."""
        if not self.backwards:
            return point
        return replace(
            point, x_tangent=-point.x_tangent, parameter_tangent=-point.parameter_tangent
        )

    def from_anchor(self, point: Point) -> float:
        """Distance of a point from the anchor."""
        return abs(point.length - self.anchor.length)


_Direct = Callable[[Arc, float, Options], Point | None]


def arcs(start: Point, options: Options) -> Iterator[Arc]:
    """The arcs of a branch from `start` on; ends and raises as `follow` does."""
    anchor = before = start
    for point in follow(start, options):
        yield Arc(anchor, before, point)
        before = point
        if not point.fold:
            anchor = point


def at_value(arc: Arc, value: float, options: Options) -> Point | None:
    """The point of an arc at which the parameter is `value`, on a system that resolves it.

    None if the arc does not reach the value. Raises Stalled if the point cannot be found.
    """
    return _at_value(arc, value, options, _direct)


def unknowns_at(arc: Arc, value: float, options: Options) -> Array | None:
    """x of that point alone, which costs less."""
    point = _at_value(arc, value, options, _solution)
    return None if point is None else point.x


def _at_value(arc: Arc, value: float, options: Options, direct: _Direct) -> Point | None:
    if not arc.holds(value):
        return None
    arc = on_one_system(arc, options)
    while True:
        point = direct(arc, value, options) or _bracketed(arc, value, options)
        if point.system.resolved(point.x, np.array([value])):
            return arc.forwards(point)
        finer = point.system.refined(point.x, np.array([value]))
        if finer is None:
            raise Unresolved(point)
        arc = _on(finer, arc, options)


def on_one_system(arc: Arc, options: Options) -> Arc:
    """The arc with all its points on the finest of their systems; raises Stalled."""
    finest = max((arc.anchor, arc.a, arc.b), key=lambda q: q.x.size)
    return _on(finest.system, arc, options)


def _on(system: System, arc: Arc, options: Options) -> Arc:
    """The arc with all its points on this system; raises Stalled."""
    size = system.scale.size
    anchor, a, b = (arc.anchor, arc.a, arc.b)
    if all(q.x.size == size for q in (anchor, a, b)):
        return arc
    anchor = _on_finer(system, anchor, options) if anchor.x.size != size else anchor
    a, b = (
        anchor if q is arc.anchor else _on_finer(system, q, options) if q.x.size != size else q
        for q in (a, b)
    )
    return Arc(anchor, a, b)


def _on_finer(system: System, point: Point, options: Options) -> Point:
    """The point on a finer system."""
    moved = carried(point, system)
    found = at_distance(moved, 0.0, options)
    # where branches cross, Newton's method has no chance: the prolonged point is the solution
    return moved if found is None else replace(found, fold=point.fold)


def _solution(arc: Arc, value: float, options: Options) -> Point | None:
    """The point at `value` by Newton's method from the cubic through both ends of the arc.

    None unless it stays so near to the cubic, in units of the distance to the nearest end, that it
    can be no state beyond a fold or a crossing, which lie at the ends. With the tangent of the
    anchor.
    """
    row = slope_row(arc.anchor, options)
    share = _share(arc, arc.a, arc.b, value, row)
    guess = interpolated(arc.a, arc.b, share, row, _width(arc, arc.a, arc.b))[:-1]
    nearest = min(_norm(arc.a, guess - end.x) for end in (arc.a, arc.b))
    x = at_parameter(arc.a.system, guess, value) if nearest > 0 else None
    if x is None or _norm(arc.a, x - guess) > NEAR * nearest:
        return None
    length = arc.a.length + share * (arc.b.length - arc.a.length)
    return replace(arc.anchor, x=x, parameter=value, length=length, fold=False)


def _direct(arc: Arc, value: float, options: Options) -> Point | None:
    """The same with its own tangent."""
    point = _solution(arc, value, options)
    return point and with_tangent(point, slope_row(arc.anchor, options), options)


def _bracketed(arc: Arc, value: float, options: Options) -> Point:
    """The point at `value` by cubic interpolation in the distance, kept in its bracket."""
    row = slope_row(arc.anchor, options)
    low, high = arc.a, arc.b
    tolerance = PRECISION * max(abs(arc.a.parameter), abs(arc.b.parameter))
    widths: list[float] = []
    for _ in range(MAX_EVALUATIONS):
        for end in (low, high):
            if abs(end.parameter - value) <= tolerance:
                return _polished(end, value, low, high)
        width = high.length - low.length
        if width <= ROUNDING * max(arc.from_anchor(low), arc.from_anchor(high)):
            break
        slow = len(widths) >= 3 and width > 0.5 * widths[-3]
        widths.append(width)
        share = 0.5 if slow else _share(arc, low, high, value, row)
        found = _between(arc, low, high, share, row, options)
        if found is None and not slow:
            found = _between(arc, low, high, 0.5, row, options)
        if found is None:
            break
        if (found.parameter - value) * (low.parameter - value) > 0:
            low = found
        else:
            high = found
    point = _noisy(arc, low, high, value)
    if point is None:
        raise Stalled(f"the solution at parameter = {value:.10g} was not found on its branch")
    return point


def _noisy(arc: Arc, low: Point, high: Point, value: float) -> Point | None:
    """The point between two that are so close that rounding hides on which side the value lies.

    Newton's method at the value, if it stays between the ends of the arc; None otherwise.
    """
    step = high.parameter - low.parameter
    share = float(np.clip((value - low.parameter) / step, 0.0, 1.0)) if step != 0 else 0.5
    between = low.x + share * (high.x - low.x)
    x = at_parameter(low.system, between, value)
    if x is None:
        return None
    nearest = min(_norm(low, between - end.x) for end in (arc.a, arc.b))
    if _norm(low, x - between) > 0.2 * nearest:
        return None
    return replace(low, x=x, parameter=value, fold=False)


def _width(arc: Arc, low: Point, high: Point) -> float:
    """Distance from low to high along the tangent at the anchor, negative on the way back."""
    return arc.from_anchor(high) - arc.from_anchor(low)


def _share(arc: Arc, low: Point, high: Point, value: float, row: Array) -> float:
    """Where between the ends the interpolating cubic takes the value."""
    width = _width(arc, low, high)
    slopes = [slope(q, row) * width for q in (low, high)]
    data = low.parameter, slopes[0], high.parameter, slopes[1]
    if not np.all(np.isfinite(data)):
        return 0.5
    share = bracketed_root(lambda t: cubic(*data, t) - value, 0.0, 1.0, xtol=1e-16, rtol=1e-14)
    return float(np.clip(share, 1e-9, 1 - 1e-9))


def _between(
    arc: Arc, low: Point, high: Point, share: float, row: Array, options: Options
) -> Point | None:
    """The point of the branch at a share of the distance between two others; None if it fails."""
    width = _width(arc, low, high)
    guess = interpolated(low, high, share, row, width)
    away = arc.from_anchor(low) + share * width
    found = at_distance(arc.anchor, away, options, guess)
    if found is None:
        return None
    scale = options.parameter_scale
    moved = _norm(low, found.x - guess[:-1]) + abs(found.parameter - guess[-1]) / scale
    chord = _norm(low, high.x - low.x) + abs(high.parameter - low.parameter) / scale
    if moved > chord:
        return None
    return replace(found, length=low.length + share * (high.length - low.length))


def _polished(point: Point, value: float, low: Point, high: Point) -> Point:
    """The point exactly at the value, where Newton's method at a fixed parameter keeps to it."""
    x = at_parameter(point.system, point.x, value)
    if x is not None and _norm(point, x - point.x) <= 1e-3 * _norm(point, high.x - low.x):
        return replace(point, x=x, parameter=value, fold=False)
    return replace(point, parameter=value, fold=False)


def _norm(point: Point, x: Array) -> float:
    return float(np.sqrt(np.sum(point.system.weights * x**2)))
