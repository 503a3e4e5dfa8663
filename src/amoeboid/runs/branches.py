"""`branch`: steady states along a parameter, without a mesh or of 3D cells on one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.model.parameters import Parameters
from amoeboid.runs.bifurcations import bifurcation, neutral_between
from amoeboid.runs.cell_branch import CellBifurcation, CellBranch
from amoeboid.runs.steady_cell import SteadyCell, found_from, refuse_mesh, shown_cell, started
from amoeboid.studies import branch as axisymmetric
from amoeboid.studies.branch import (
    FOLD,
    HOPF,
    MAX_POINTS,
    MAX_STEP,
    Branch,
    SpecialPoint,
    checked_options,
    checked_window,
)
from amoeboid.studies.columns import text, with_units
from amoeboid.studies.states import steady_states
from amoeboid.surface.branches import (
    FIRST,
    MIN_POLARITY,
    Followed,
    Options,
    branch_from,
    turned_enough,
)
from amoeboid.surface.model import Model
from amoeboid.surface.relative_equilibrium import Moving
from amoeboid.surface.steady import Found, NotSteady, Plane, around, cell_in_plane
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

# The amplitudes of a mode, as root mean squares, that are tried to leave a branch with.
AMPLITUDES = (3e-3, 1e-3, 1e-2)
# Shares of the first step that are tried in turn.
SHARES = (1.0, 0.3, 0.1)


@one_thread
def branch(
    p: Parameters,
    name: str = "v_p0",
    start: Any = None,
    end: Any = None,
    *,
    mesh: Any = None,
    through: Any = None,
    stability: bool = True,
    max_step: float = MAX_STEP,
    max_points: int = MAX_POINTS,
    watch: Watch = unwatched,
) -> Branch:
    """The branch of steady states between two values of the parameter `name`.

    Without `mesh` and `through` that of the axisymmetric states, see `amoeboid.studies.branch`.
    With `mesh`, `Icosphere(3)`, that of 3D cells through the fastest axisymmetric state at `end`,
    or at `start`. `through`: a 3D cell that it passes instead, a `SteadyCell` or any start of
    `steady_state` that has a mesh; or a bifurcation of such a branch within the window, the branch
    that leaves there: circles and helices. Another parameter may be followed from there, with those
    of its state for p. It is followed through folds until it leaves the window, reaches the sphere,
    or circles become straight. `stability`: find the growth rates of all cells, and where stability
    is gained or lost; False saves most of the time. With physical parameters, the ends are
    quantities such as "2 um/s". `max_step` is the longest step along the branch, `max_points` the
    largest number of points; `watch` is called with every step.

    Raises InvalidInput for a parameter or a window that cannot be, and where there is no state to
    begin with.

    >>> import amoeboid as am
    >>> p, mesh = am.Parameters(D=0.4), am.Icosphere(2)
    >>> found = am.branch(p, "v_p0", 5.5, 6.5, mesh=mesh, stability=False)
    >>> found.complete, len(found.folds)
    (True, 0)
    """
    if mesh is None and through is None:
        return axisymmetric.branch(
            p, name, start, end, max_step=max_step, max_points=max_points, watch=watch
        )
    window = checked_window(p, name, start, end)
    checked_options(max_step, max_points)
    scale = max(abs(end) for end in window)
    if name == "v_p0":
        scale = onset_speed(p) or scale
    options = Options(scale, max_step, max_points)
    traced = _Traced(p, name, window, options, watch)
    try:
        parts = traced.parts(mesh, through)
    except NotSteady as error:
        why = "; ".join(with_units(p, [str(error)], name))
        raise InvalidInput(
            f"the branch must start at a steady cell, and none was reached: {why}; give one with "
            "through = amoeboid.steady_state(...)"
        ) from None
    begins = through if isinstance(through, CellBifurcation) else None
    return traced.shown(parts, stability, begins)


@dataclass(frozen=True, eq=False)
class _Traced:
    """What a branch of 3D cells is followed with."""

    p: Parameters
    name: str
    window: tuple[float, float]
    options: Options
    watch: Watch

    def parts(self, mesh: Any, through: Any) -> list[Followed]:
        """The branch from its first cell on: one part, or two if that lies within the window."""
        if isinstance(through, CellBifurcation):
            refuse_mesh(mesh, "through")
            return [self._leaving(through, self._place(through))]
        model, guess, q = self._first(mesh, through)
        model_at = self._models(model)
        first = found_from(model_at(q), guess, q)
        sides = [end - q for end in self.window if abs(end - q) > 1e-9 * self.options.scale]
        return [
            self._followed(model_at, first, self._second(model_at, first, q, far)) for far in sides
        ]

    def _second(
        self, model_at: Callable[[float], Model], first: Found, q: float, far: float
    ) -> Found:
        """A cell beside the first one, on the way to q + far. Raises NotSteady.

        One that turns the other way is of another branch, unless there is none nearer.
        """
        why, other = NotSteady(""), None
        for share in SHARES:
            length = share * FIRST * self.options.max_step * self.options.scale
            there = q + float(np.clip(far, -length, length))
            try:
                found = found_from(model_at(there), first.cell, there)
            except NotSteady as error:
                why = error
                continue
            if not turned_enough([first], found):
                return found
            other = found
        if other is None:
            raise why
        return other

    def _first(self, mesh: Any, through: Any) -> tuple[Model, Moving, float]:
        """The model, a cell and its parameter to begin with. Raises InvalidInput."""
        if through is not None:
            low, high = sorted(self.window)
            own = getattr(through, "parameters", self.p).value(self.name)
            q = float(np.clip(own, low, high))
            at = self.p.replace(**{self.name: q})
            return (*started(at, mesh, through, "through"), q)
        for q in reversed(self.window):
            at = self.p.replace(**{self.name: q})
            state = steady_states(at, (1,))[-1]
            if state.number("polarity") > MIN_POLARITY:
                return (*started(at, mesh, state), q)
        ends = [text(self.p, q, self.p.dimension(self.name)) for q in self.window]
        raise InvalidInput(
            "a branch of 3D cells must start at a polarized state at an end of its window, but "
            f"there is none at {self.name} = {' or '.join(ends)}; move an end, or give a cell "
            "with through"
        )

    def _models(self, model: Model) -> Callable[[float], Model]:
        p, name = self.p, self.name
        return lambda q: replace(model, parameters=p.replace(**{name: q}))

    def _followed(
        self, model_at: Callable[[float], Model], first: Found, second: Found
    ) -> Followed:
        def seen(count: int, found: Found) -> None:
            self.watch(Progress("3D branch", self.name, found.q, 0, count))

        return branch_from(model_at, first, second, self.window, self.options, seen)

    def _place(self, point: CellBifurcation) -> float:
        """The value of the parameter at a bifurcation to begin with. Raises InvalidInput."""
        at = point.state.parameters
        q, here, unit = at.value(self.name), repr(point), self.p.dimension(self.name)
        low, high = sorted(self.window)
        if point.kind == HOPF:
            raise InvalidInput(
                "through must be a bifurcation to steady cells, but oscillating cells bifurcate "
                f"at a {here}; find them with simulate(), starting from its state"
            )
        if self.p.replace(**{self.name: q}) != at:
            known = (name for name in at.names if name in self.p.names and name != self.name)
            others = [name for name in known if at.value(name) != self.p.value(name)]
            raise InvalidInput(
                "through must be a bifurcation at the parameters p, but "
                f"{', '.join(others) or 'the law or the stress'} of the {here} differs; give its "
                "state.parameters for p"
            )
        if not low <= q <= high:
            raise InvalidInput(
                f"the window must contain the bifurcation at which the branch starts, {self.name} "
                f"= {text(self.p, q, unit)}; move an end"
            )
        return q

    def _leaving(self, point: CellBifurcation, q: float) -> Followed:
        """The branch that leaves another one at a bifurcation. Raises NotSteady."""
        cell = point.state
        model_at = self._models(cell.model)
        base = found_from(model_at(q), _moving(cell), q)
        iteration = around(base.model, base.cell)
        z, n = iteration.vector(base.cell), 2 * iteration.n
        along, why = point.mode / np.sqrt(np.mean(point.mode**2)), ""
        for amplitude in AMPLITUDES:
            moved = np.concatenate([z[:n] + amplitude * along, z[n:]])
            near = iteration.cell(moved)
            own = around(base.model, near)
            plane = Plane(own.vector(near)[:n], q / self.options.scale, along, 0.0)
            try:
                found = cell_in_plane(own, own.vector(near), q, plane, model_at, self.options.scale)
                return self._followed(model_at, base, found)
            except NotSteady as error:
                why = str(error)
        raise NotSteady(f"no cell beside the bifurcation at {q:.8g} is found: {why}")

    def shown(
        self, parts: Sequence[Followed], stability: bool, begins: CellBifurcation | None
    ) -> CellBranch:
        """The branch as users see it, its parts joined at the first cell.

        One that `begins` at a bifurcation has that among its own.
        """
        points, folds = [*parts[-1].points], [*parts[-1].folds]
        if len(parts) == 2:  # the first one leads back to the start of the window
            back, begin = parts[0], parts[0].points[-1][0]
            points, folds = (
                [
                    *((begin - length, found) for length, found in reversed(behind)),
                    *((begin + length, found) for length, found in ahead),
                ]
                for behind, ahead in ((back.points[1:], points), (back.folds, folds))
            )
        bifurcations: list[SpecialPoint] = []
        if begins is not None and len(points) > 1:
            points = points[1:]
            bifurcations = [replace(begins, name=self.name, piece=0, length=0.0)]
        lengths = tuple(length for length, _ in points)
        cells = tuple(shown_cell(found) for _, found in points)
        special = [
            SpecialPoint(FOLD, self.name, None, shown_cell(found), 0, length)
            for length, found in folds
        ]
        problems = [f"the branch ends early: {part.message}" for part in parts if part.message]
        if stability:
            found, unsure = self._bifurcations(lengths, cells, folds)
            bifurcations += found
            problems += unsure
        return CellBranch(
            parameters=self.p,
            name=self.name,
            pieces=(cells,),
            lengths=(lengths,),
            folds=tuple(special),
            bifurcations=tuple(bifurcations),
            origins=tuple(q for part in parts for q in part.origins),
            complete=all(part.complete for part in parts),
            problems=with_units(self.p, problems, self.name),
        )

    def _bifurcations(
        self,
        lengths: Sequence[float],
        cells: Sequence[SteadyCell],
        folds: Sequence[tuple[float, Found]],
    ) -> tuple[list[SpecialPoint], list[str]]:
        """Where stability is gained or lost beside folds, and where it is not known."""
        unsure, found = 0, list[SpecialPoint]()
        for count, cell in enumerate(cells):
            self.watch(Progress("stability", self.name, self._value(cell), 0, count))
            unsure += cell.stability == "unknown"
        problems = [f"the stability of {unsure} states is unknown"] if unsure else []
        for (s, a), (t, b) in pairwise(zip(lengths, cells, strict=True)):
            if a.stable == b.stable or any(s < length < t for length, _ in folds):
                continue
            p, q = self._value(a), self._value(b)
            try:
                neutral = neutral_between(self._cell, (p, a), (q, b), self.options.scale)
            except NotSteady as error:
                problems.append(f"a bifurcation could not be located: {error}")
                continue
            length = s + (neutral.q - p) / (q - p) * (t - s)
            found.append(bifurcation(self.name, neutral, length))
            if neutral.jumps:
                problems.append(
                    f"the mesh connects two branches near {neutral.q:.6g}: that bifurcation is "
                    f"interpolated between {p:.6g} and {q:.6g}"
                )
        return found, problems

    def _value(self, cell: SteadyCell) -> float:
        return cell.parameters.value(self.name)

    def _cell(self, q: float, beside: SteadyCell) -> SteadyCell:
        """The cell at q near another one. Raises NotSteady."""
        return shown_cell(found_from(self._models(beside.model)(q), _moving(beside), q))


def _moving(cell: SteadyCell) -> Moving:
    return started(cell.parameters, None, cell)[1]
