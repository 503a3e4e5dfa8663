"""A branch of steady states from a start to its natural end, arc by arc.

A branch ends where it reaches the sphere (it continues there as its own mirror image, or as another
branch), where it reaches states that are symmetric from front to rear, where it returns to its
start, and where the parameter reaches zero.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.onset import branch_tangent, onsets
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.unknowns import mode_count, resampled, split
from amoeboid.axisymmetric.window import NOTHING, Window
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import Arc, at_value
from amoeboid.numerics.branch_points import (
    Options,
    Point,
    Stalled,
    Unresolved,
    at_distance,
    slope_row,
)
from amoeboid.numerics.continuation import follow
from amoeboid.numerics.locating import located
from amoeboid.validation import InvalidInput

SAME = 1e-6
"""Relative difference up to which two states are the same."""

MAX_DEGREE = 12
"""Highest mode of the sphere that is tried where a branch reaches the sphere."""

FIRST_COARSE_STEP, MAX_COARSE_STEP = 0.05, 1.5
"""First step outside the window, unless the one before was longer, and the longest one."""

FINER, MAX_FINER = 8.0, 600.0
"""Factor by which steps are shortened where one led to states of higher symmetry; its maximum."""

SYMMETRICAL, AT_MEETING = 1e-6, 1e-2
"""Share of the asymmetry before a meeting up to which a state there counts as symmetrical, and how
near to it, in steps, a fold is the meeting itself."""

BESIDE = (1e-5, 1e-4, 1e-3, 1e-2, 3e-2, 0.1)
"""How far from a meeting, in steps, the points lie that it is interpolated from.

The parameter is even in the asymmetry there, so that a parabola is good to its fourth power.
"""

SPHERE, SYMMETRIC, CLOSED, ZERO = "the sphere", "symmetrical states", "its start", "zero"


def modes_of(point: Point) -> int:
    """Number of modes of a point."""
    return mode_count(point.x)


def steady_state_at(p: Parameters, name: str, point: Point) -> SteadySolution:
    """The steady state of a point of a branch in `name`."""
    at = p.replace(**{name: point.parameter})
    return SteadySolution(at, modes_of(point), point.x, True, ())


@dataclass(frozen=True, eq=False)
class _Seen:
    """What distinguishes a point from the sphere, and its front from its rear."""

    point: Point
    deviation: Array
    asymmetry: Array


@dataclass
class Path:
    """The arcs of a branch from `start` on, as an iterable that can be used once.

    Steps outside the `window`, if there is one, are coarse; where the branch enters it, there is a
    point on the edge. The path also ends with the first point that is `enough`, resolved or not.
    After the last arc, `end` names how the branch ended (empty if max_points did not suffice) and
    `threshold` is the value of the parameter if it ended at the sphere. `last` is the end of the
    latest arc. Raises Stalled; if a point cannot be resolved, `unresolved` is the arc that leads to
    it.
    """

    p: Parameters
    name: str
    start: Point
    options: Options
    watch: Watch = unwatched
    task: str = "branch"
    window: Window | None = None
    enough: Callable[[Point], bool] = lambda point: False
    end: str = ""
    threshold: float | None = None
    last: Point | None = None
    unresolved: Arc | None = None
    count: int = field(default=0, init=False)
    _finer: float = field(default=1.0, init=False)
    _taken: float = field(default=0.0, init=False, repr=False)
    _seen: list[_Seen] = field(default_factory=list, init=False, repr=False)

    def __iter__(self) -> Iterator[Arc]:
        here: Point | None = self.start
        while here is not None and not self.end and self.count < self.options.max_points:
            inside = self.window is None or self.window.holds(here.parameter)
            here = yield from self._stretch(here, inside)

    def _stretch(self, start: Point, inside: bool) -> Generator[Arc, None, Point | None]:
        """Arcs with one length of steps; returns the point from which the other one continues."""
        options = (
            self.options
            if inside
            else replace(
                self.options,
                first_step=max(FIRST_COARSE_STEP, self._taken),
                max_step=MAX_COARSE_STEP,
                angle=0.2,
            )
        )
        if self._finer > 1.0:
            longest = options.max_step / self._finer
            shortest = min(options.first_step, longest)
            options = replace(options, max_step=longest, first_step=shortest)
        anchor = before = start
        pending: list[Arc] = []
        for point in self._points(start, options):
            if self.count >= self.options.max_points:
                return None
            self.count += 1
            self.watch(Progress(self.task, self.name, point.parameter, modes_of(point), self.count))
            pending.append(Arc(anchor, before, point))
            before = point
            if point.fold:
                continue
            arcs = [] if self._slid(anchor, point) else self._ended(anchor, point, pending)
            if not arcs:
                self._finer *= FINER
                if self._finer > MAX_FINER:
                    what = (
                        "reaches zero"
                        if point.parameter <= 0
                        else "reaches states of higher symmetry"
                    )
                    raise Stalled(
                        f"the branch {what} between parameter = {anchor.parameter:.10g} and "
                        f"{point.parameter:.10g}; the exact location was not found"
                    )
                return anchor
            self.last, self._taken = arcs[-1].b, point.length - anchor.length
            for arc in arcs:
                edge = None if inside else self._entry(arc)
                if edge is not None:
                    self.end, self.threshold = "", None
                    yield Arc(arc.anchor, arc.a, edge)
                    return edge
                yield arc
            if self.end:
                return None
            if inside and self.window is not None and not self.window.holds(point.parameter):
                return point
            anchor, pending = point, []
        return None

    def _points(self, start: Point, options: Options) -> Iterator[Point]:
        """The points that can be resolved."""
        anchor = before = start
        try:
            for point in follow(start, options, self.enough):
                yield point
                before = point
                anchor = anchor if point.fold else point
        except Unresolved as stop:
            self.unresolved = Arc(anchor, before, stop.point)
            raise

    def _entry(self, arc: Arc) -> Point | None:
        """The point at which a coarse arc enters the window, if it does."""
        overlap = self.window.overlap(arc) if self.window is not None else None
        if overlap is None or overlap[0] == arc.a.parameter or arc.backwards:
            return None
        with suppress(Stalled):
            return at_value(arc, overlap[0], self.options)
        return None

    def _slid(self, anchor: Point, point: Point) -> bool:
        """Whether a step from a polarized state led to the sphere or to a symmetrical state.

        A branch that ends there continues as its mirror image; a step may jump over that point.
        """
        a, b = self._look(anchor), self._look(point)
        pairs = (a.deviation, b.deviation), (a.asymmetry, b.asymmetry)
        return any(before.any() and not after.any() for before, after in pairs)

    def _ended(self, anchor: Point, point: Point, pending: list[Arc]) -> list[Arc]:
        """The arcs from `anchor` to `point`, cut where the branch ends; sets `end`.

        Empty where the step was too long to tell what it has met: the branch passes through the
        sphere and none from there leads back to `anchor`, or through zero, where it has no state.
        """
        before, after = self._look(anchor), self._look(point)
        if _reversed(before.deviation, after.deviation):
            self.end = SPHERE
            return self._to_sphere(anchor, point, pending)
        if _reversed(before.asymmetry, after.asymmetry):
            self.end = SYMMETRIC
            return self._to_symmetry(anchor, point, pending)
        if point.parameter <= 0:
            arcs = self._to_zero(pending)
            self.end = ZERO if arcs else ""
            return arcs
        if self.count > 2 and any(self._closes(arc) for arc in pending):
            self.end = CLOSED
        return pending

    def _to_zero(self, pending: list[Arc]) -> list[Arc]:
        """The arcs up to the state at zero; none if these points have no state there.

        A step beyond zero may have jumped to another branch, past the end of this one. Raises
        Unresolved if that state cannot be resolved: shorter steps lead to the same one.
        """
        for k, arc in enumerate(pending):
            try:
                end = at_value(arc, 0.0, self.options)
            except Unresolved as stop:
                self.unresolved = Arc(arc.anchor, arc.a, stop.point)
                raise
            except Stalled:
                return []
            if end is not None:
                return [*pending[:k], Arc(arc.anchor, arc.a, replace(end, parameter=0.0))]
        return []

    def _look(self, point: Point) -> _Seen:
        """What is seen of a point, kept for two."""
        for known in self._seen:
            if known.point is point:
                return known
        self._seen = [*self._seen[-1:], _Seen(point, self._deviation(point), asymmetry(point))]
        return self._seen[-1]

    def _deviation(self, point: Point) -> Array:
        """The scaled difference of shape, flow and concentration from those of the sphere."""
        at = point.system.point(np.array([point.parameter]))  # type: ignore[attr-defined]
        difference = point.x.copy()
        psi, u, c, _ = split(difference, modes_of(point))
        c[0] -= at.c0
        difference *= np.sqrt(point.system.weights)
        if np.linalg.norm(difference) <= NOTHING:
            difference[:] = 0.0
        return _padded(psi, u, c)

    def _to_sphere(self, anchor: Point, point: Point, pending: list[Arc]) -> list[Arc]:
        """The arcs to the threshold, found from the sphere; none if none lead there."""
        away, beyond = (float(np.linalg.norm(self._deviation(q))) for q in (anchor, point))
        # parameter = threshold + k amplitude^2 near the threshold, or linear in the amplitude
        f, g = away**2, beyond**2
        guess = anchor.parameter
        if abs(f - g) > 1e-3 * max(f, g):
            guess = (anchor.parameter * g - point.parameter * f) / (g - f)
        width = 2 * max(abs(guess - anchor.parameter), abs(point.parameter - anchor.parameter))
        width += 0.02 * abs(guess)
        low, high = max(guess - width, 0.0), guess + width
        found = [
            value
            for l in range(1, MAX_DEGREE + 1)  # noqa: E741
            for value in onsets(self.p, self.name, low, high, l)
        ]
        found.sort(key=lambda value: abs(value - guess))
        for value in found:
            arcs = self._from_sphere(value, anchor)
            if arcs:
                self.threshold = value
                return arcs
        self.end = ""
        return []

    def _from_sphere(self, value: float, anchor: Point) -> list[Arc]:
        """Arcs from `anchor` to the threshold `value` that were found from there; none if wrong."""
        try:
            begins = [
                branch_tangent(self.p, self.name, value, self.options, modes_of(anchor), sign)
                for sign in (1.0, -1.0)
            ]
        except InvalidInput:
            return []
        for begin in begins:
            back = _backwards(begin, anchor, self.options)
            if back:
                return back
        return []

    def _to_symmetry(self, anchor: Point, point: Point, pending: list[Arc]) -> list[Arc]:
        """The arcs up to where what distinguishes front and rear vanishes."""
        reference = asymmetry(anchor)
        least = SYMMETRICAL * _product(reference, reference)

        def remaining(q: Point) -> float:
            # next to the meeting, Newton's method may find a symmetrical state
            left = _product(reference, asymmetry(q))
            return left if abs(left) > least else np.nan

        end = _on_system_of(anchor, point, self.options)
        meeting = located(anchor, end, remaining, self.options, widths=BESIDE)
        # the parameter turns back at the meeting itself, which is no fold
        last_fold = meeting.length - AT_MEETING * (end.length - anchor.length)
        kept = [arc for arc in pending if arc.b.fold and arc.b.length < last_fold]
        last = kept[-1].b if kept else anchor
        return [*kept, Arc(anchor, last, meeting)]

    def _closes(self, arc: Arc) -> bool:
        start = self.start
        if not arc.holds(start.parameter):
            return False
        chord = distance(arc.a, arc.b) + SAME
        if distance(start, arc.a) > 3 * chord:
            return False
        try:
            found = at_value(arc, start.parameter, self.options)
        except Stalled:
            return False
        return found is not None and distance(found, start) < SAME * (1 + chord)


def _on_system_of(anchor: Point, point: Point, options: Options) -> Point:
    """`point` on the coarser system of `anchor`, its neighbor."""
    if point.x.size == anchor.x.size:
        return point
    found = at_distance(anchor, point.length - anchor.length, options)
    if found is None:
        raise Stalled(f"no solution near parameter = {point.parameter:.10g}")
    return found


def _backwards(begin: Point, anchor: Point, options: Options) -> list[Arc]:
    """The arcs of the branch from `begin` as far as `anchor`, in the order towards `begin`.

    Empty if that branch does not lead there. Lengths continue that of `anchor`.
    """
    limit = 4 * max(distance(begin, anchor), options.min_step)
    first = replace(options, first_step=min(options.first_step, 0.25 * limit))
    found: list[Arc] = []
    here = before = begin
    try:
        for point in follow(begin, first):
            found.append(Arc(here, before, point))
            before = point
            if point.fold:
                continue
            if point.x.size == anchor.x.size and (
                0 <= _projected(here, anchor, options) <= point.length - here.length
            ):
                break
            if point.length > limit:
                return []
            here = point
        else:
            return []
    except Stalled:
        return []
    # `anchor` lies on the last arcs: cut them there
    end = at_distance(here, _projected(here, anchor, options), options)
    if end is None or distance(end, anchor) > SAME * (1 + distance(begin, anchor)):
        return []
    kept = [arc for arc in found if arc.a.length < end.length]
    kept[-1] = replace(kept[-1], b=replace(end, fold=False))
    total = anchor.length + end.length

    def renamed(point: Point) -> Point:
        return replace(point, length=total - point.length)

    return [Arc(*map(renamed, (arc.anchor, arc.b, arc.a))) for arc in reversed(kept)]


def _projected(a: Point, b: Point, options: Options) -> float:
    """Distance of b from a along the tangent at a."""
    return float(slope_row(a, options) @ np.append(b.x - a.x, b.parameter - a.parameter))


def distance(a: Point, b: Point) -> float:
    """Distance of the states of two points in units of the finer one, mirror images told apart."""
    finer = a if a.x.size >= b.x.size else b
    first, second = (resampled(q.x, modes_of(q), modes_of(finer)) for q in (a, b))
    return float(np.sqrt(np.sum(finer.system.weights * (first - second) ** 2)))


def asymmetry(point: Point) -> Array:
    """What distinguishes front and rear: the odd coefficients of c, scaled."""
    n = modes_of(point)
    c = split(point.x * np.sqrt(point.system.weights), n)[2]
    odd = c[1::2]
    return odd if np.abs(odd).max() > NOTHING * abs(c[0]) else np.zeros_like(odd)


def _reversed(a: Array, b: Array) -> bool:
    """Whether a deviation has passed through zero between two points, turning about."""
    return _product(a, b) < -0.5 * float(np.linalg.norm(a) * np.linalg.norm(b)) < 0.0


def _product(a: Array, b: Array) -> float:
    n = min(a.size, b.size)
    return float(a[:n] @ b[:n])


def _padded(*series: Array) -> Array:
    """Coefficients of several series interleaved, so that longer ones begin with shorter ones."""
    n = max(s.size for s in series)
    table = np.zeros((n, len(series)))
    for k, s in enumerate(series):
        table[: s.size, k] = s
    return table.ravel()
