"""Following one branch from its start and collecting what lies inside a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from amoeboid.axisymmetric.bifurcations import (
    Bifurcation,
    BranchPoint,
    branch_points,
    located_bifurcations,
)
from amoeboid.axisymmetric.paths import SPHERE, SYMMETRIC, Path, modes_of
from amoeboid.axisymmetric.progress import Watch
from amoeboid.axisymmetric.search import MAX_RISING_MODES, MIN_EXCURSION, stability_problems
from amoeboid.axisymmetric.window import Window
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import Arc, at_value
from amoeboid.numerics.branch_points import Options, Point, Stalled
from amoeboid.validation import InvalidInput

MAX_EXCURSION = {"v_p0": 1.25}
"""How far outside the window a branch that moves away is followed, as a factor; others: 2."""


@dataclass(frozen=True, eq=False)
class BranchSolution:
    """One or several branches in the parameter `name` inside a window.

    `pieces` holds the stretches inside the window, each with its points and folds in order.
    `origins` are the values at which the branch leaves or meets the homogeneous sphere. `complete`
    says that each branch was followed to its ends or until it left the window for good; `problems`
    says what may be missing and why, and what else limits the answer.
    """

    name: str
    pieces: tuple[tuple[BranchPoint, ...], ...]
    bifurcations: tuple[Bifurcation, ...]
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


@dataclass(frozen=True)
class _Walk:
    """A branch from its start: stretches inside the window, how it ended, values it reached."""

    pieces: tuple[tuple[Point, ...], ...]
    end: str
    threshold: float | None
    problem: str
    lowest: float
    highest: float
    last: float


@dataclass(frozen=True)
class Tracer:
    """Follows a branch in `name` and collects what lies in the window."""

    p: Parameters
    name: str
    window: Window
    options: Options
    watch: Watch

    def from_sphere(self, start: Point) -> BranchSolution:
        """The branch that leaves the sphere at `start`."""
        walk = self._walk(start, with_start=False)
        origins = (
            (start.parameter,) if walk.threshold is None else (start.parameter, walk.threshold)
        )
        return self._branch(walk.pieces, origins, walk, start.parameter)

    def from_state(self, start: Point) -> BranchSolution:
        """The branch from `start` on, along its tangent."""
        walk = self._walk(start, with_start=True)
        pieces = list(walk.pieces)
        if self.window.holds(start.parameter) and not (pieces and pieces[0][0] is start):
            pieces.insert(0, (start,))
        origins = () if walk.threshold is None else (walk.threshold,)
        return self._branch(pieces, origins, walk, start.parameter)

    def _walk(self, start: Point, with_start: bool) -> _Walk:
        left = _Left(self.name, self.window, start.parameter)
        path = Path(
            self.p, self.name, start, self.options, self.watch, "branch", self.window, left.far
        )
        pieces: list[list[Point]] = []
        connected = False
        problems: list[str] = []
        lowest = highest = start.parameter
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
                        f"stopped after {self.options.max_points} points; allow more points, or "
                        "longer steps"
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
    ) -> BranchSolution:
        p, name, window = self.p, self.name, self.window
        found = tuple(branch_points(piece, p, name) for piece in pieces)
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
                f"the branch ends at {name} = {walk.last:.6g}, where it reaches states that are "
                "symmetric from front to rear"
            )
        bifurcations, missed = located_bifurcations(p, name, found, self.options, self.watch)
        problems += missed
        soft = min((b.state.parameters for q in found for b in q), key=_pressure, default=p)
        problems += stability_problems(soft)
        return BranchSolution(
            name, found, bifurcations, origins, complete and not missed,
            tuple(dict.fromkeys(problems)),
        )  # fmt: skip


def _pressure(p: Parameters) -> float:
    return p.delta_P


@dataclass
class _Left:
    """Whether a branch has left the window for good.

    The branch is outside by more than a factor and moves away from the window and from its start:
    upwards, or downwards in a parameter other than v_p0 (in v_p0 every branch that goes down must
    turn, because without polymerization there is the sphere alone).
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
        return self.far(point)

    def far(self, point: Point) -> bool:
        """Whether the point is so far outside that the branch need not be followed on."""
        return self.beyond(point, MAX_EXCURSION.get(self.name, 2.0))

    def beyond(self, point: Point, factor: float) -> bool:
        """Whether the point is outside by more than a factor, and the branch moves away there."""
        if point.fold:
            return False
        if point.parameter_tangent > 0:
            return point.parameter > factor * max(self.window.high, self.start)
        low = min(self.window.low, self.start)
        return self.name != "v_p0" and low > 0 and point.parameter < low / factor
