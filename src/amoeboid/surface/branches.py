"""Branches of steady cells on a mesh, through folds and unstable parts.

Length along a branch is measured in the root mean square of the unknowns, c/(c0 + c) and h/R0, and
in q/`scale`. Each cell is the base of the iteration for the next one, which starts on the
polynomial through the last three.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.multistep import extrapolated
from amoeboid.observables import polarization
from amoeboid.surface.model import Model
from amoeboid.surface.relative_equilibrium import ImplicitMap
from amoeboid.surface.rigid import turns
from amoeboid.surface.steady import Found, NotSteady, Plane, around, cell_in_plane, steady_cell

# After a step of few iterations the next one is longer by this factor, after one of many shorter.
FEW, LONGER, MANY, SHORTER = 16, 1.5, 45, 0.7
# A step that led to where none continues is repeated with this share of it.
REPEATED = 0.3
# One step may turn away from the one before by an angle with at least this cosine.
MIN_COSINE = 0.8
# The shortest step as a share of the longest, and the first.
SHORTEST, FIRST = 1e-3, 0.3
# A fold is sought until q changes by less than this share of its scale.
EXACT, MAX_REFINEMENTS = 1e-9, 8
# Less polar than this, a cell counts as a sphere; see `observables.polarity`. On a mesh that is not
# its own mirror image the branches of sphere and polarized cells do not quite meet.
MIN_POLARITY = 0.05
# A cell that turned is straight again if it turns more slowly than this share of what the mesh may
# turn a straight cell by: on some meshes branches of circles pass over into straight cells.
STRAIGHT = 0.1

ModelAt = Callable[[float], Model]


@dataclass(frozen=True)
class Options:
    """How a branch is followed: the scale of q, the longest step, and the number of points."""

    scale: float
    max_step: float = 0.1
    max_points: int = 400


@dataclass(frozen=True, eq=False, repr=False)
class Followed:
    """A branch inside its window: the points, each with the length up to it, and special ones.

    `folds`: where it turns back; `origins`: values of q at which it meets the homogeneous sphere;
    `complete`: it ends there, at the edge of the window, or where circles have become straight;
    otherwise `message` says why it ends.
    """

    points: tuple[tuple[float, Found], ...]
    folds: tuple[tuple[float, Found], ...]
    origins: tuple[float, ...]
    complete: bool
    message: str

    def __repr__(self) -> str:
        return f"Followed({len(self.points)} points, {len(self.folds)} folds)"


def branch_from(
    model_at: ModelAt,
    first: Found,
    second: Found,
    window: tuple[float, float],
    options: Options,
    seen: Callable[[int, Found], None] = lambda *_: None,
) -> Followed:
    """The branch from `first` through `second` until it leaves the window or only repeats itself.

    Mirror images follow where it reaches the sphere, and where circles meet straight cells.
    """
    low, high = sorted(window)
    points, folds = [(0.0, first)], list[tuple[float, Found]]()
    origins: tuple[float, ...] = ()
    complete, message = False, f"it has more than {options.max_points} points"
    try:
        for length, found in follow(model_at, first, second, options):
            while len(points) > 1 and points[-1][0] >= length:  # taken back
                points.pop()
                folds = [fold for fold in folds if fold[0] < points[-1][0]]
            seen(len(points), found)
            met = _meets_sphere(points[-1][1], found)
            mirrored = turned_enough([one for _, one in points], found)
            inside = low <= found.q <= high
            if not (met or mirrored) and inside:
                points.append((length, found))
            if len(points) > 2 and not (met or mirrored):
                folds += _fold_between(model_at, points[-3:], options.scale)
            if met:
                origins = (_origin([one for _, one in points[-3:]]),)
            left = abs(points[-1][1].q - (low if found.q < low else high))
            if not (inside or met or mirrored) and left > EXACT * options.scale:
                points.append(_at_edge(model_at, points[-1], (length, found), (low, high)))
            if met or mirrored or not inside:
                complete, message = True, ""
                break
            if len(points) >= options.max_points:
                break
    except NotSteady as error:
        message = str(error)
    return Followed(tuple(points), tuple(folds), origins, complete, message)


def follow(
    model_at: ModelAt, first: Found, second: Found, options: Options
) -> Iterator[tuple[float, Found]]:
    """The points of a branch from `second` on, with their lengths. Raises NotSteady.

    A point from which no step succeeds is taken back, as the step to it was too long: it may have
    passed a fold. The next point has a length below that of it.
    """
    past = [first, second]
    iteration = around(second.model, second.cell)
    length = _lengths(iteration, past, options.scale)[0]
    yield -length, second
    length, step = -length, min(options.max_step, -length * LONGER)
    back = 0.0
    while True:
        try:
            found, taken = _next(model_at, iteration, past[-3:], step, options)
        except NotSteady:
            if back <= SHORTEST * options.max_step or len(past) < 3:
                raise
            past.pop()
            iteration = around(past[-1].model, past[-1].cell)
            length, step, back = length - back, REPEATED * back, 0.0
            continue
        past.append(found)
        iteration = around(found.model, found.cell)
        back = -_lengths(iteration, past[-2:], options.scale)[0]
        length += back
        yield length, found
        factor = LONGER if found.iterations <= FEW else 1.0
        if found.iterations > MANY:
            factor = SHORTER
        step = float(np.clip(factor * taken, SHORTEST * options.max_step, options.max_step))


def _next(
    model_at: ModelAt, iteration: ImplicitMap, past: Sequence[Found], step: float, options: Options
) -> tuple[Found, float]:
    """The point at a distance `step` from the last one, or nearer, and its distance."""
    scale, n = options.scale, 2 * iteration.n
    lengths = _lengths(iteration, past, scale)
    known = [iteration.vector(found.cell) for found in past]
    before = _direction(known[-1][:n] - known[-2][:n], (past[-1].q - past[-2].q) / scale)
    why = ""
    while step >= SHORTEST * options.max_step:
        z = extrapolated(lengths, known, step)
        q = float(extrapolated(lengths, [np.array(found.q) for found in past], step))
        along, slope = _direction(z[:n] - known[-1][:n], (q - past[-1].q) / scale)
        try:
            found = cell_in_plane(
                iteration, z, q, Plane(z[:n], q / scale, along, slope), model_at, scale
            )
            reached = iteration.vector(found.cell)[:n] - known[-1][:n]
            after = _direction(reached, (found.q - past[-1].q) / scale)
            if after[0] @ before[0] / n + after[1] * before[1] >= MIN_COSINE:
                return found, step
            why = "the branch bends too sharply"
        except NotSteady as error:
            why = str(error)
        step *= 0.5
    raise NotSteady(f"no step beyond {past[-1].q:.8g} succeeds: {why}")


def _direction(x: Array, q: float) -> tuple[Array, float]:
    """The direction of (x, q), of unit length."""
    size = np.sqrt(np.mean(x**2) + q**2)
    return x / size, q / size


def _lengths(iteration: ImplicitMap, past: Sequence[Found], scale: float) -> list[float]:
    """Lengths of the branch at these points, from the last one: negative numbers, and 0."""
    n, known = 2 * iteration.n, [iteration.vector(found.cell) for found in past]
    lengths = [0.0]
    for (a, p), (b, q) in reversed(list(pairwise(zip(known, past, strict=True)))):
        distance = np.sqrt(np.mean((b[:n] - a[:n]) ** 2) + ((q.q - p.q) / scale) ** 2)
        lengths.insert(0, lengths[0] - float(distance))
    return lengths


def _fold_between(
    model_at: ModelAt, points: Sequence[tuple[float, Found]], scale: float
) -> list[tuple[float, Found]]:
    """The fold between three points, if q turns back there: the extremum of q along the branch."""
    (start, a), (middle, b), (_, c) = points
    if (b.q - a.q) * (c.q - b.q) >= 0.0:
        return []
    iteration = around(b.model, b.cell)
    n, of = 2 * iteration.n, iteration.vector
    along, slope = _direction((of(c.cell) - of(a.cell))[:n], (c.q - a.q) / scale)
    origin = Plane(of(b.cell)[:n], b.q / scale, along, slope)
    places = [(origin.distance(of(f.cell)[:n], f.q / scale), f) for f in (a, b, c)]
    unit = (middle - start) / (places[1][0] - places[0][0])
    for _ in range(MAX_REFINEMENTS):
        s, values = [place for place, _ in places], [found.q for _, found in places]
        bend, tilt, _ = np.polyfit(s, values, 2)
        at = float(-tilt / (2.0 * bend))
        nearest, found = min(places, key=lambda one: abs(one[0] - at))
        if abs(bend) * (nearest - at) ** 2 < EXACT * scale:
            return [(middle + unit * nearest, found)]
        z = extrapolated(s, [of(found.cell) for _, found in places], at)
        q = float(extrapolated(s, [np.array(value) for value in values], at))
        plane = Plane(origin.x + at * along, origin.q + at * slope, along, slope)
        found = cell_in_plane(iteration, z, q, plane, model_at, scale)
        places = sorted([*places, (at, found)], key=lambda one: abs(one[0] - at))[:3]
    raise NotSteady(f"the fold near q = {b.q:.8g} could not be located to full precision")


def _meets_sphere(before: Found, after: Found) -> bool:
    """Whether the cell turns into its mirror image between two points, or is a sphere."""
    a, b = polarization(before.seen), polarization(after.seen)
    return bool(a @ b < 0.0 or np.linalg.norm(b) < MIN_POLARITY)


def turned_enough(points: Sequence[Found], after: Found) -> bool:
    """Whether a cell is straight after others that turned, or turns the other way round."""
    omega = after.cell.angular_velocity
    known = [one.cell.angular_velocity for one in points]
    turning = [before for before in known if turns(after.model, before)]
    straight = not turns(after.model, omega / STRAIGHT)
    return bool(turning) and (straight or bool(turning[-1] @ omega < 0.0))


def _origin(points: Sequence[Found]) -> float:
    """The value of q without polarization, of which q is an even function."""
    squares = [float(np.sum(polarization(found.seen) ** 2)) for found in points]
    return float(extrapolated(squares, [np.array(found.q) for found in points], 0.0))


def _at_edge(
    model_at: ModelAt,
    inner: tuple[float, Found],
    outer: tuple[float, Found],
    window: tuple[float, float],
) -> tuple[float, Found]:
    """The point at the edge of the window, between one inside and one outside."""
    edge = window[0] if outer[1].q < window[0] else window[1]
    share = (edge - inner[1].q) / (outer[1].q - inner[1].q)
    found = steady_cell(model_at(edge), (inner if share < 0.5 else outer)[1].cell, edge)
    return inner[0] + share * (outer[0] - inner[0]), found
