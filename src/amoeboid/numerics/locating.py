"""Where a function of the points of a branch changes sign, crossings of branches included."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from amoeboid.numerics.bracketed import bracketed_root
from amoeboid.numerics.branch_points import (
    Options,
    Point,
    Stalled,
    at_distance,
    interpolated,
    slope_row,
)

WIDTHS = (1e-5, 1e-4, 1e-3)
"""How far from a crossing of branches, in steps, the points lie that it is interpolated from."""


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
    row = slope_row(a, options)

    def at(distance: float) -> float:
        if distance not in known:
            guess = interpolated(a, b, distance / span, row, span)
            found = at_distance(a, distance, options, guess) or at_distance(a, distance, options)
            value = np.nan if found is None else test(found)
            if found is None or np.isnan(value):
                missed.append(distance)
                raise Stalled(f"no solution near parameter = {a.parameter:.10g}")
            known[distance] = found, value
        return known[distance][1]

    try:
        root = bracketed_root(at, begin, span, xtol=1e-9 * span, rtol=1e-13)
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
