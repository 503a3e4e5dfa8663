"""Branches of steady states in any parameter, with their folds, bifurcations and stability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

from amoeboid.axisymmetric.bifurcations import (
    BranchPoint,
    Crossing,
    branch_point,
    located_crossings,
)
from amoeboid.axisymmetric.force_balance import refuse_cue
from amoeboid.axisymmetric.onset import departure, onsets, onsets_anywhere
from amoeboid.axisymmetric.paths import (
    SAME,
    SPHERE,
    SYMMETRIC,
    Path,
    Window,
    modes_of,
)
from amoeboid.axisymmetric.progress import Watch, unwatched
from amoeboid.axisymmetric.states import (
    MAX_RISING_MODES,
    MIN_EXCURSION,
    same_state,
    stability_problems,
    steady_states,
)
from amoeboid.axisymmetric.steady import MODES, SteadyState, SteadySystem
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import Arc, at_value
from amoeboid.numerics.continuation import Options, Point, Stalled, through
from amoeboid.validation import InvalidInput

__all__ = [
    "Branch",
    "BranchPoint",
    "Crossing",
    "Window",
    "branch_from_sphere",
    "branch_from_state",
    "branch_point",
    "polarized_branch",
    "steady_states",
]


MAX_EXCURSION = {"v_p0": 1.25}
"""How far a branch that moves away is followed outside the window, as a factor; 2 for others."""


@dataclass(frozen=True, eq=False)
class Branch:
    """Branches in the parameter `name` inside a window: points, folds, crossings.

    `pieces` holds the stretches inside the window, each with its points and folds in order.
    `origins` are the values at which the branch leaves or meets the homogeneous sphere.
    `complete` says that it was followed to its ends or out of the window for good; `problems` says
    what may be missing and why, and what else limits the answer.
    """

    name: str
    pieces: tuple[tuple[BranchPoint, ...], ...]
    crossings: tuple[Crossing, ...]
    origins: tuple[float, ...]
    complete: bool
    problems: tuple[str, ...]

    @cached_property
    def points(self) -> tuple[BranchPoint, ...]:
        """All points, piece after piece, without the folds."""
        return tuple(b for piece in self.pieces for b in piece if not b.point.fold)

    @cached_property
    def folds(self) -> tuple[BranchPoint, ...]:
        """All folds."""
        return tuple(b for piece in self.pieces for b in piece if b.point.fold)

    @property
    def origin(self) -> float | None:
        """The first of `origins`, None if there is none."""
        return self.origins[0] if self.origins else None

    @property
    def message(self) -> str:
        """All problems as one text, empty if there are none."""
        return "; ".join(self.problems)

    def __repr__(self) -> str:
        found = "complete" if self.complete else "incomplete"
        lines = [f"branch in {self.name}, {found}: {len(self.points)} points"]
        lines += [f"sphere at {self.name} = {value:.9g}" for value in self.origins]
        for piece in self.pieces:
            ends = [
                f"{self.name} = {b.value:.9g} (v_0 = {b.state.max_retrograde_speed:.6g})"
                for b in (piece[0], piece[-1])
            ]
            lines.append(" to ".join(ends))
        lines += [f"fold at {self.name} = {fold.value:.9g}" for fold in self.folds]
        return "\n".join([*lines, *(f"- {text}" for text in self.problems)])


def branch_from_sphere(
    p: Parameters,
    name: str,
    window: Window | tuple[float, float],
    l: int = 1,  # noqa: E741
    sign: float = 1.0,
    options: Options | None = None,
    n: int = MODES,
    watch: Watch = unwatched,
) -> Branch | None:
    """What lies inside the window of the branch that bifurcates from the sphere in mode l.

    Its origins are sought at all v_p0 if that is the parameter; else inside the window, and if
    there is none, outside it, the nearest first. The branch is followed through its folds outside
    the window too. None if the sphere is never neutral to mode l. Raises InvalidInput for a window
    that is no pair low < high.
    """
    window = Window.of(window)
    for value in (window.low, window.high):
        p.replace(**{name: value})
    inside = onsets(p, name, window.low, window.high, l) if name != "v_p0" else ()
    found: list[Branch] = []
    for origin in inside or _nearest_first(onsets_anywhere(p, name, l), window):
        if any(_met(origin, branch) for branch in found):
            continue
        if found and found[-1].pieces and not inside and name != "v_p0":
            break
        found.append(_from_origin(p, name, window, origin, sign, options, n, watch))
    entered = [branch for branch in found if branch.pieces or not branch.complete]
    return joined(entered or found[:1]) if found else None


def _from_origin(
    p: Parameters,
    name: str,
    window: Window,
    origin: float,
    sign: float,
    options: Options | None,
    n: int,
    watch: Watch,
) -> Branch:
    chosen = options or Options(parameter_scale=abs(origin) or 1.0)
    start = departure(p, name, origin, chosen, n, sign)
    return _Tracer(p, name, window, chosen, watch).from_sphere(start)


def _met(value: float, branch: Branch) -> bool:
    """Whether the branch leaves or meets the sphere at this value."""
    return any(abs(value - other) <= SAME * abs(other) for other in branch.origins)


def _distinct(values: Sequence[float]) -> tuple[float, ...]:
    """The values in order, without those that differ from an earlier one by rounding."""
    kept: list[float] = []
    for value in values:
        if not any(abs(value - other) <= SAME * abs(other) for other in kept):
            kept.append(value)
    return tuple(kept)


def _nearest_first(origins: Sequence[float], window: Window) -> list[float]:
    def away(value: float) -> float:
        return max(window.low - value, value - window.high, 0.0)

    return sorted(origins, key=away)


def branch_from_state(
    state: SteadyState,
    name: str,
    window: Window | tuple[float, float],
    direction: float,
    options: Options | None = None,
    watch: Watch = unwatched,
) -> Branch:
    """What lies inside the window of the branch from a steady state on, in the parameter `name`.

    It leaves the state in `direction` of the parameter, and is followed through its folds, outside
    the window too; what lies on the other side of the state is not. Raises InvalidInput for a state
    under a cue.
    """
    refuse_cue(state.cue, "a branch of steady states")
    window = Window.of(window)
    p, value = state.parameters, state.parameters.value(name)
    size = max(abs(value), window.high - window.low)
    chosen = options or Options(parameter_scale=size)
    system = SteadySystem(p, state.n, (name,))
    first = through(system, state.x, value, direction, chosen)
    return _Tracer(p, name, window, chosen, watch).from_state(first)


def polarized_branch(
    p: Parameters,
    name: str,
    start: float,
    end: float,
    options: Options | None = None,
    watch: Watch = unwatched,
) -> Branch | None:
    """The branches of l = 1 between the values `start` and `end` of the parameter `name`.

    In v_p0 that which leaves the sphere; in other parameters those through all polarized states at
    `start`, the fastest first, those through others at `end`, and those that leave the sphere on
    the way. None if there are none.
    """
    window = Window(min(start, end), max(start, end))
    if name == "v_p0":
        return branch_from_sphere(p, name, window, options=options, watch=watch)
    found: list[Branch] = []
    problems: list[str] = []
    for edge, other in ((start, end), (end, start)):
        states = steady_states(p.replace(**{name: edge}), (1,), watch)
        if not states.complete:
            problems += [f"at {name} = {edge:g}: {problem}" for problem in states.problems]
        for state in reversed([s for s in states if s.max_retrograde_speed > 0]):
            known = [b.state for branch in found for b in branch.points if b.value == edge]
            if not any(same_state(state, one) for one in known):
                try:
                    branch = branch_from_state(state, name, window, other - edge, options, watch)
                except Stalled as stop:
                    problems.append(f"at {name} = {edge:g}: {stop}")
                else:
                    found.append(branch)
    for origin in onsets(p, name, window.low, window.high):
        if not any(_met(origin, branch) for branch in found):
            found.append(_from_origin(p, name, window, origin, 1.0, options, MODES, watch))
    if not found:
        outside = branch_from_sphere(p, name, window, options=options, watch=watch)
        found += [outside] if outside is not None else []
    if not found:
        return None
    branch = joined(found)
    complete = branch.complete and not problems
    return replace(branch, complete=complete, problems=(*branch.problems, *problems))


def joined(branches: Sequence[Branch]) -> Branch:
    """Several branches in one parameter as one."""
    offsets = accumulate((len(b.pieces) for b in branches), initial=0)
    return Branch(
        branches[0].name,
        tuple(piece for b in branches for piece in b.pieces),
        tuple(
            replace(crossing, piece=crossing.piece + offset)
            for b, offset in zip(branches, offsets, strict=False)
            for crossing in b.crossings
        ),
        _distinct([value for b in branches for value in b.origins]),
        all(b.complete for b in branches),
        tuple(dict.fromkeys(text for b in branches for text in b.problems)),
    )


@dataclass(frozen=True)
class _Walk:
    """A branch from its start on: stretches inside the window, what it met and how far it went."""

    pieces: tuple[tuple[Point, ...], ...]
    end: str
    threshold: float | None
    problem: str
    lowest: float
    highest: float
    last: float


@dataclass(frozen=True)
class _Tracer:
    """Follows a branch in `name` and collects what lies in the window."""

    p: Parameters
    name: str
    window: Window
    options: Options
    watch: Watch

    def from_sphere(self, start: Point) -> Branch:
        """The branch that leaves the sphere at `start`."""
        walk = self._walk(start, with_start=False)
        origins = (
            (start.parameter,) if walk.threshold is None else (start.parameter, walk.threshold)
        )
        return self._branch(walk.pieces, origins, walk, start.parameter)

    def from_state(self, start: Point) -> Branch:
        """The branch from `start` on, along its tangent."""
        walk = self._walk(start, with_start=True)
        pieces = list(walk.pieces)
        if self.window.holds(start.parameter) and not (pieces and pieces[0][0] is start):
            pieces.insert(0, (start,))
        origins = () if walk.threshold is None else (walk.threshold,)
        return self._branch(pieces, origins, walk, start.parameter)

    def _walk(self, start: Point, with_start: bool) -> _Walk:
        path = Path(self.p, self.name, start, self.options, self.watch, "branch", self.window)
        pieces: list[list[Point]] = []
        connected = False
        problems: list[str] = []
        lowest = highest = start.parameter
        left = _Left(self.name, self.window, start.parameter)
        try:
            for arc in path:
                overlap = self.window.overlap(arc)
                if overlap is None:
                    connected = False
                else:
                    if not connected:
                        pieces.append([])
                        first = self._at(arc, arc.a, overlap[0], problems)
                        if first is not None and (with_start or first is not start):
                            pieces[-1].append(first)
                    met = path.end in (SPHERE, SYMMETRIC) and arc.b is path.last
                    if not (met and overlap[1] == arc.b.parameter):
                        last = self._at(arc, arc.b, overlap[1], problems)
                        if last is not None:
                            pieces[-1].append(last)
                    connected = self.window.holds(arc.b.parameter)
                lowest = min(lowest, arc.b.parameter)
                highest = max(highest, arc.b.parameter)
                if left.for_good(arc.b):
                    break
            else:
                if not path.end:
                    problems.append(
                        f"stopped after {self.options.max_points} points; allow more, or longer "
                        "steps"
                    )
        except (Stalled, InvalidInput) as stop:
            if path.unresolved is not None and self._leaves(path.unresolved, pieces, connected):
                left.already = left.beyond(path.unresolved.b, 1.0)
            if not left.already:
                problems.append(str(stop))
        kept = tuple(tuple(piece) for piece in pieces if piece)
        text = "; ".join(dict.fromkeys(problems))
        last_value = start.parameter if path.last is None else path.last.parameter
        return _Walk(kept, path.end, path.threshold, text, lowest, highest, last_value)

    def _leaves(self, arc: Arc, pieces: list[list[Point]], connected: bool) -> bool:
        """Add the edge of the window if the way to an unresolved point passes it resolved."""
        overlap = self.window.overlap(arc)
        if not connected or overlap is None or overlap[1] == arc.b.parameter:
            return overlap is None
        last = self._at(arc, arc.b, overlap[1], [])
        if last is not None:
            pieces[-1].append(last)
        return last is not None

    def _at(self, arc: Arc, end: Point, value: float, problems: list[str]) -> Point | None:
        """The point of an arc at an end of its overlap with the window."""
        if end.parameter == value:
            return arc.forwards(end)
        try:
            return at_value(arc, value, self.options)
        except Stalled as stop:
            problems.append(str(stop))
            return None

    def _branch(
        self,
        pieces: Sequence[Sequence[Point]],
        origins: tuple[float, ...],
        walk: _Walk,
        start: float,
    ) -> Branch:
        p, name, window = self.p, self.name, self.window
        found = tuple(tuple(branch_point(point, p, name) for point in piece) for piece in pieces)
        problems = [walk.problem] if walk.problem else []
        complete = not problems
        if not found:
            problems.append(
                f"the branch does not enter {window.low:g} <= {name} <= {window.high:g}; it starts "
                f"at {name} = {start:.6g} and was followed through {walk.lowest:.6g} to "
                f"{walk.highest:.6g}"
            )
        if walk.end == SYMMETRIC:
            problems.append(
                f"it ends at {name} = {walk.last:.6g}, where it meets states that are symmetrical "
                "front to back"
            )
        crossings, missed = located_crossings(p, name, found, self.options, self.watch)
        problems += missed
        soft = min((b.state.parameters for q in found for b in q), key=_pressure, default=p)
        problems += stability_problems(soft)
        return Branch(
            name, found, crossings, origins, complete and not missed,
            tuple(dict.fromkeys(problems)),
        )  # fmt: skip


def _pressure(p: Parameters) -> float:
    return p.delta_P


@dataclass
class _Left:
    """Whether a branch has left the window for good.

    It moves away from it, by more than a factor, and from its start: upwards, or downwards in a
    parameter other than v_p0 (in v_p0 every branch that goes down must turn, because without
    polymerization there is the sphere alone).
    """

    name: str
    window: Window
    start: float
    already: bool = False

    def for_good(self, point: Point) -> bool:
        """Take the next point into account."""
        beyond = self.beyond(point, MIN_EXCURSION)
        self.already = beyond
        if beyond and modes_of(point) > MAX_RISING_MODES:
            return True
        return self.beyond(point, MAX_EXCURSION.get(self.name, 2.0))

    def beyond(self, point: Point, factor: float) -> bool:
        """Whether the point is outside by more than a factor, and the branch moves away there."""
        if point.fold:
            return False
        if point.parameter_tangent > 0:
            return point.parameter > factor * max(self.window.high, self.start)
        low = min(self.window.low, self.start)
        return self.name != "v_p0" and low > 0 and point.parameter < low / factor
