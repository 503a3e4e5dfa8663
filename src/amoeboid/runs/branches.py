"""`branch`: steady states along a parameter, without a mesh or of 3D cells on one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.meshes.geometry import volume_centroid
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES, polarization
from amoeboid.runs.steady_cell import PATH, SteadyCell, found_from, refuse_mesh, shown_cell, started
from amoeboid.studies import branch as axisymmetric
from amoeboid.studies.branch import (
    BIFURCATION,
    FOLD,
    HOPF,
    MAX_POINTS,
    MAX_STEP,
    Branch,
    SpecialPoint,
    checked_options,
    checked_window,
)
from amoeboid.studies.columns import (
    Column,
    column,
    physical_number,
    text,
    titled,
    with_units,
)
from amoeboid.studies.states import steady_states
from amoeboid.surface.branches import FIRST, MIN_POLARITY, Followed, Options, branch_from
from amoeboid.surface.model import Model
from amoeboid.surface.relative_equilibrium import Moving
from amoeboid.surface.steady import Found, NotSteady, Plane, around, cell_in_plane
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

# Where a branch gains or loses stability, the growth rate is found to this error, in units of the
# rate, and q to this share of its scale.
MAX_ERROR, EXACT, MAX_TRIALS = 1e-4, 1e-6, 12
# The amplitudes of a mode, as root mean squares, that are tried to leave a branch with.
AMPLITUDES = (3e-3, 1e-3, 1e-2)
ORDERS, BANDS = 4, 8


@dataclass(frozen=True, eq=False, repr=False)
class CellBifurcation(SpecialPoint):
    """A point of a branch of 3D cells where a mode (2V,) is neutral: another branch meets it.

    `branch(..., through=point)` follows that one.
    """

    mode: Array


class CellBranch(Branch):
    """A branch of 3D cells: see `Branch`. Its states are `SteadyCell`s.

    `turning`, `radius_of_curvature` and `torsion` of the paths are arrays along it, too, and
    `growth_rate`. Where `branch` was told to leave the stability out, that of a state is found when
    it is asked for, and there are no bifurcations.
    """

    def rows(
        self, states: Sequence[Any], names: Sequence[str]
    ) -> tuple[list[str], list[list[str]]]:
        """Titles and cells of a table of cells: observables, turning, stability, growth rate."""
        p = self.parameters
        shown = (*names, "turning", "growth_rate")
        columns = [
            column(p, [state.number(name) for state in states], self.dimension(name))
            for name in shown
        ]
        titles = [
            titled(name, "" if p.units is None else c.unit)
            for name, c in zip(shown, columns, strict=True)
        ]
        cells = zip(*(c.texts for c in columns), (s.stability for s in states), strict=True)
        return [*titles, "stability"], [list(row) for row in cells]

    def stability_of(self, state: Any, neutral: int | None = -1) -> dict[str, Any]:
        """What programs read of the stability of a cell, and of its path."""
        p, rate = self.parameters, state.number("growth_rate")
        rate = None if np.isnan(rate) else physical_number(p, rate, "1/T")
        return {
            "path": state.path,
            "turning": physical_number(p, state.number("turning"), "1/T"),
            "stable": state.stable if neutral == -1 else None,
            "growth_rate": rate,
        }

    def _stable_count(self, piece: Sequence[Any]) -> str:
        unknown = sum(state.known_stability is None for state in piece)
        if unknown:
            return f", the stability of {unknown} not asked for"
        return super()._stable_count(piece)

    @staticmethod
    def observables() -> tuple[str, ...]:
        """The names of what every cell has a number for."""
        known = tuple(name for name, one in OBSERVABLES.items() if not one.vector)
        return (*known, *PATH)

    @staticmethod
    def dimension(name: str) -> str | None:
        """The dimension of such a number; None where none is stated."""
        return PATH[name] if name in PATH else OBSERVABLES[name].dimension

    def _state_columns(self) -> dict[str, Column]:
        p, found = self.parameters, {}
        for name in self.observables():
            values = [state.number(name) for state in self.states]
            found[name] = column(p, values, self.dimension(name))
        found["stable"] = column(p, np.array([s.stable for s in self.states], dtype=bool))
        found["stability"] = column(p, np.array([s.stability for s in self.states]))
        found["path"] = column(p, np.array([s.path for s in self.states]))
        return found


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
    of its state for p. It is followed through folds until it leaves the window, meets the sphere,
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
            f"the branch must begin at a steady cell, none is reached: {why}; give one by "
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
            refuse_mesh(mesh)
            return [self._leaving(through, self._place(through))]
        model, guess, q = self._first(mesh, through)
        model_at = self._models(model)
        first = found_from(model_at(q), guess, q)
        sides = [end - q for end in self.window if abs(end - q) > 1e-9 * self.options.scale]
        parts = []
        for far in sides:
            side = np.sign(far)
            step = min(FIRST * self.options.max_step * self.options.scale, abs(far))
            second = found_from(model_at(q + side * step), first.cell, q + side * step)
            parts.append(self._followed(model_at, first, second))
        return parts

    def _first(self, mesh: Any, through: Any) -> tuple[Model, Moving, float]:
        """The model, a cell and its parameter to begin with. Raises InvalidInput."""
        if through is not None:
            low, high = sorted(self.window)
            own = getattr(through, "parameters", self.p).value(self.name)
            q = float(np.clip(own, low, high))
            return (*started(self.p.replace(**{self.name: q}), mesh, through), q)
        for q in reversed(self.window):
            at = self.p.replace(**{self.name: q})
            state = steady_states(at, (1,))[-1]
            if state.number("polarity") > MIN_POLARITY:
                return (*started(at, mesh, state), q)
        ends = [text(self.p, q, self.p.dimension(self.name)) for q in self.window]
        raise InvalidInput(
            f"a branch of 3D cells must begin at a polarized state at an end of its window, "
            f"{self.name} = {' or '.join(ends)}, there is none; move an end, or give a cell by "
            "through"
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
                f"through must be a bifurcation that steady cells leave from, at a {here} these "
                "are cells that oscillate; look for them by simulate(), from its state"
            )
        if self.p.replace(**{self.name: q}) != at:
            known = (name for name in at.names if name in self.p.names and name != self.name)
            others = [name for name in known if at.value(name) != self.p.value(name)]
            raise InvalidInput(
                f"through must be a bifurcation of cells of the parameters p, the {here} is not: "
                f"{', '.join(others) or 'the law or the stress'} differs; give its "
                "state.parameters for p"
            )
        if not low <= q <= high:
            raise InvalidInput(
                f"the window must contain the bifurcation that the branch leaves from, "
                f"{self.name} = {text(self.p, q, unit)}; move an end"
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
        if begins is not None:
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
        problems = [f"the stability of {unsure} states is not known"] if unsure else []
        for (s, a), (t, b) in pairwise(zip(lengths, cells, strict=True)):
            if a.stable == b.stable or any(s < length < t for length, _ in folds):
                continue
            try:
                found.append(self._located(s, a, t, b))
            except NotSteady as error:
                problems.append(f"a bifurcation is not located: {error}")
        return found, problems

    def _value(self, cell: SteadyCell) -> float:
        return cell.parameters.value(self.name)

    def _located(self, s: float, a: SteadyCell, t: float, b: SteadyCell) -> CellBifurcation:
        """The point between two cells at which the largest growth rate is zero. Raises NotSteady.

        To the error of that rate: by secants within a bracket, and its halves in turn.
        """
        model_at = self._models(a.model)
        ends = [(self._value(cell), cell.growth(MAX_ERROR)[0].rate, cell) for cell in (a, b)]
        for count in range(MAX_TRIALS):
            (p, f, beside), (q, g, _) = ends
            if f is None or g is None or f * g > 0.0:
                break
            share = 0.5 if count % 3 == 2 else float(np.clip(f / (f - g), 0.05, 0.95))
            at = p + share * (q - p)
            cell = shown_cell(found_from(model_at(at), _moving(beside), at))
            growth, mode = cell.growth(MAX_ERROR)
            if growth.rate is None or mode is None:
                break
            exact = abs(q - p) < EXACT * self.options.scale
            if abs(growth.rate) <= growth.error or exact:
                share = (at - self._value(a)) / (self._value(b) - self._value(a))
                return self._bifurcation(cell, mode, s + share * (t - s))
            ends[0 if growth.rate * f > 0.0 else 1] = (at, growth.rate, cell)
        low, high = (self._value(cell) for cell in (a, b))
        raise NotSteady(f"no zero of the growth rate is found between {low:.6g} and {high:.6g}")

    def _bifurcation(
        self, cell: SteadyCell, mode: NDArray[np.complex128], length: float
    ) -> CellBifurcation:
        kind = HOPF if _oscillates(mode) else BIFURCATION
        real = mode.real if np.abs(mode.real).max() >= np.abs(mode.imag).max() else mode.imag
        m = _azimuthal_number(cell, real) if cell.path == "straight" else None
        return CellBifurcation(kind, self.name, m, cell, 0, length, real)


def _moving(cell: SteadyCell) -> Moving:
    return started(cell.parameters, None, cell)[1]


def _oscillates(mode: NDArray[np.complex128]) -> bool:
    """Whether a mode is more than a real vector times a number."""
    a, b = mode.real, mode.imag
    return bool((a @ a) * (b @ b) - (a @ b) ** 2 > 1e-6 * (a @ a + b @ b) ** 2)


def _azimuthal_number(cell: SteadyCell, mode: Array) -> int:
    """The number m of a mode exp(i m phi) about the axis of a straight cell, up to 3."""
    seen = cell.cell
    axis = polarization(seen)
    axis = axis / np.linalg.norm(axis)
    across = np.linalg.svd(axis[None, :])[2][1:]
    x = seen.r - volume_centroid(seen.r, seen.faces)
    height = x @ axis
    angle = np.arctan2(x @ across[1], x @ across[0])
    band = np.digitize(height, np.quantile(height, np.linspace(0, 1, BANDS + 1)[1:-1]))
    weighted = seen.node_areas * mode[: len(height)]
    sizes = [
        sum(abs(np.sum((weighted * np.exp(1j * m * angle))[band == k])) ** 2 for k in range(BANDS))
        * (1 if m == 0 else 2)
        for m in range(ORDERS)
    ]
    return int(np.argmax(sizes))
