"""All axisymmetric steady states of a cell, with their stability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.linearization import slow_rate
from amoeboid.axisymmetric.on_mesh import on_directions
from amoeboid.axisymmetric.progress import Watch, unwatched
from amoeboid.axisymmetric.search import SteadySolutions, steady_solutions
from amoeboid.axisymmetric.stability import AZIMUTHAL_NUMBERS, count_unstable, growth_rates_of
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.display import html_picture, html_table, plotted, text_table
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.sections import Mesh
from amoeboid.studies import observed
from amoeboid.studies.columns import (
    Column,
    column,
    dataset,
    frame,
    html,
    percent,
    physical_number,
    quantity,
    shortened,
    text,
    titled,
    unit,
    with_units,
)
from amoeboid.studies.recorded import Recorded, along, single
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

SHOWN = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "deformation")
"""The observables in the tables of the commands and of `repr`."""

UNSTABLE = "unstable m = 0 1 2 3"
MAX_TEXT = 1000


@dataclass(frozen=True, eq=False, repr=False)
class SteadyState:
    """An axisymmetric steady state.

    Every observable of docs/notation.md that such a state has is an attribute:
    `state.max_retrograde_speed`, `state.c_front`. With physical parameters, numbers are quantities
    with units. `solution` is the state in plain numbers, as the solver found it. `neutral`: at a
    fold or a bifurcation, the azimuthal number m of the mode that neither grows nor decays.
    """

    solution: SteadySolution
    neutral: int | None = None

    @property
    def parameters(self) -> Parameters:
        """The parameters of the cell."""
        return self.solution.parameters

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in observed.names_of(self.parameters):
            raise AttributeError(f"a steady state has no attribute {name!r}")
        return quantity(self.parameters, self.number(name), observed.dimension(name))

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *observed.names_of(self.parameters)})

    def number(self, name: str) -> float:
        """The observable `name` as a plain number in the units of the solver."""
        if name not in self._known_numbers:
            self._known_numbers[name] = observed.observed(self.solution, name)
        return self._known_numbers[name]

    @cached_property
    def _known_numbers(self) -> dict[str, float]:
        return {}

    @cached_property
    def unstable_modes(self) -> dict[int, int]:
        """Number of growing modes for the azimuthal numbers m = 0, 1, 2, 3.

        For m > 0 it is that for each sense of rotation.
        """
        slow = slow_rate(self.parameters)
        rates = self._rates(*AZIMUTHAL_NUMBERS)
        return {m: count_unstable(rates[m], slow) for m in AZIMUTHAL_NUMBERS}

    @property
    def stable(self) -> bool:
        """Whether every perturbation of shape and concentration with m = 0, 1, 2, 3 decays."""
        return self.stability == "stable"

    @property
    def stability(self) -> str:
        """In a word: stable, unstable, or neutral where one mode neither grows nor decays."""
        growing = dict(self.unstable_modes)
        if self.neutral in growing:  # of the neutral one rounding decides
            growing[self.neutral] = max(0, growing[self.neutral] - 1)
        if any(growing.values()):
            return "unstable"
        return "stable" if self.neutral is None else "neutral"

    def growth_rates(self, m: int = 1) -> Any:
        """Growth rates of perturbations exp(i m phi), complex, fastest first [1/T].

        Rigid motions are left out. Raises InvalidInput for an m that is no whole number >= 0.
        """
        if isinstance(m, bool) or not isinstance(m, int | np.integer) or m < 0:
            raise InvalidInput(f"the azimuthal number m must be a whole number >= 0, got {m!r}")
        return quantity(self.parameters, self._rates(int(m))[int(m)], "1/T")

    @one_thread
    def _rates(self, *numbers: int) -> dict[int, Array]:
        missing = [m for m in numbers if m not in self._known_rates]
        if missing:
            [found] = growth_rates_of([self.solution], missing)
            self._known_rates.update(found)
        return self._known_rates

    @cached_property
    def _known_rates(self) -> dict[int, Array]:
        return {}

    def concentration(self, x: Any) -> Any:
        """c at scaled arclengths x in [0, pi] along the meridian [N/L^2]."""
        return quantity(self.parameters, self.solution.concentration(x), "N/L^2")

    def flow(self, x: Any) -> Any:
        """Retrograde flow at scaled arclengths x, positive towards x = pi [L/T]."""
        return quantity(self.parameters, self.solution.flow(x), "L/T")

    def outline(self, count: int = 400) -> tuple[Any, Any]:
        """(r, z) of the meridian at `count` points from the pole x = 0 to the pole x = pi [L]."""
        r, z = self.solution.outline(count)
        return quantity(self.parameters, r, "L"), quantity(self.parameters, z, "L")

    def as_initial(self, mesh: Any) -> InitialCell:
        """This state on a mesh of the sphere, the initial condition of a 3D run.

        `mesh` is an icosphere: anything with `subdivisions`, or that number. The rear lies at
        z > 0. Raises InvalidInput for another mesh, and a number that is none of `Mesh`.
        """
        subdivisions = getattr(mesh, "subdivisions", mesh)
        if isinstance(subdivisions, bool) or not isinstance(subdivisions, int):
            raise InvalidInput(
                f"the mesh must be an icosphere or its number of subdivisions, got {mesh!r}"
            )
        directions, faces = uniform_icosphere(Mesh(subdivisions=subdivisions).subdivisions)
        r, c = on_directions(self.solution, directions)
        return InitialCell(r, faces, np.maximum(c, 0.0), self.solution.zeta0)

    def plot(self, ax: Any = None) -> Any:
        """Draw the outline, colored by c, front up. Takes and returns axes."""
        return plotted(self, "branches.draw_state", ax)

    def plain(self, names: Sequence[str] | None = None) -> dict[str, float]:
        """The observables `names` as programs read them, in the units of `physical_units`.

        Without names those of `shown`.
        """
        p = self.parameters
        return {
            name: physical_number(p, self.number(name), observed.dimension(name))
            for name in (shown(p) if names is None else names)
        }

    def text(self, name: str) -> str:
        """The observable `name` with its unit, if the cell has physical ones."""
        return text(self.parameters, self.number(name), observed.dimension(name))

    def __repr__(self) -> str:
        shown = ", ".join(f"{name} = {self.text(name)}" for name in SHOWN[:3])
        return f"SteadyState({shown}, {self.stability})"

    def _repr_html_(self) -> str:
        columns = states_columns(self.parameters, [self])
        heading = f"{self.stability.capitalize()} steady state"
        rows = [(name, c.texts[0], c.unit) for name, c in columns.items()]
        return html_table(heading, rows, ("name", "value", "unit")) + html_picture(
            self, "branches.draw_state"
        )


@dataclass(frozen=True, eq=False, repr=False)
class SteadyStates(Sequence[SteadyState]):
    """The steady states of a cell, slowest first: a sequence of them.

    `complete` says that no state is missing which is connected to the sphere through branches in
    v_p0; `problems` says what may be missing and why, and what else limits the answer.
    """

    parameters: Parameters
    states: tuple[SteadyState, ...]
    complete: bool
    problems: tuple[str, ...]

    @property
    def fastest_stable(self) -> SteadyState:
        """The stable state with the fastest retrograde flow. Raises InvalidInput without one."""
        for state in reversed(self.states):
            if state.stable:
                return state
        raise InvalidInput("none of the steady states found is stable")

    @overload
    def __getitem__(self, index: int) -> SteadyState: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[SteadyState, ...]: ...
    def __getitem__(self, index: int | slice) -> SteadyState | tuple[SteadyState, ...]:
        return self.states[index]

    def __len__(self) -> int:
        return len(self.states)

    @property
    def columns(self) -> dict[str, Column]:
        """Observables, stability and numbers of unstable modes, one entry a state."""
        return states_columns(self.parameters, self.states)

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row a state; its `attrs["units"]` holds the units."""
        return frame(self.columns, "state")

    def to_xarray(self) -> Any:
        """An xarray.Dataset along the dimension `state`."""
        return dataset(
            self.columns, "state", complete=int(self.complete), problems=list(self.problems)
        )

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: how many states there are, and the columns along `state`."""
        counts = {"n_states": len(self.states), "n_stable": sum(s.stable for s in self.states)}
        numbers = single(self.parameters, {name: (n, None) for name, n in counts.items()})
        return numbers | along("state", self.columns)

    def plot(self, ax: Any = None) -> Any:
        """Draw the outlines side by side, colored by c. Takes and returns axes."""
        return plotted(self, "branches.draw_outlines", ax)

    @property
    def _heading(self) -> str:
        found = "complete" if self.complete else "states may be missing"
        count = f"{len(self.states)} steady state{'s' if len(self.states) != 1 else ''}"
        return f"{count}, {found}; {self.parameters.description}"

    def __repr__(self) -> str:
        table = states_table(self.states)
        problems = [f"- {text}" for text in shortened(self.problems, 2, "problems")]
        lines: list[str] = []
        for count in range(len(self.states), -1, -1):
            left_out = len(self.states) - count
            more = [f"... and {left_out} more states"] if left_out else []
            lines = [*shortened([self._heading], 1, "", 200), *table[: 2 + count], *more, *problems]
            if len("\n".join(lines)) < MAX_TEXT:
                break
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        notes = shortened(self.problems, 20, "problems", 500)
        columns = {name: self.columns[name] for name in (*shown(self.parameters), "stable")}
        return html(self._heading, columns, notes) + html_picture(self, "branches.draw_outlines")


def shown(p: Parameters) -> tuple[str, ...]:
    """The observables in tables of states of a cell: with friction, its speed too."""
    return (*SHOWN, *observed.OF_FRICTION) if p.has_friction else SHOWN


def states_table(
    states: Sequence[SteadyState], *, first: str = "", values: Sequence[str] = ()
) -> list[str]:
    """The lines of a table of states; `values` stand in a column `first`, before the others."""
    if not states:
        return []
    titles, rows = states_rows(states)
    if first:
        titles = [first, *titles]
        rows = [[value, *row] for value, row in zip(values, rows, strict=True)]
    return text_table(titles, rows)


def states_rows(
    states: Sequence[SteadyState], names: Sequence[str] | None = None
) -> tuple[list[str], list[list[str]]]:
    """Titles and cells of the table of states that commands print, with these observables."""
    p = states[0].parameters
    names = shown(p) if names is None else names
    columns = [
        column(p, [state.number(name) for state in states], observed.dimension(name))
        for name in names
    ]
    titles = [
        titled(name, "" if p.units is None else c.unit)
        for name, c in zip(names, columns, strict=True)
    ]
    unstable = [
        "stable" if state.stable else " ".join(map(str, state.unstable_modes.values()))
        for state in states
    ]
    texts = [c.texts if c.unit else [percent(v) for v in c.values] for c in columns]
    cells = zip(*texts, unstable, strict=True)
    return [*titles, UNSTABLE], [list(row) for row in cells]


def physical_units(p: Parameters, names: Sequence[str], *parameters: str) -> dict[str, str]:
    """The units of observables and parameters; empty where the cell has no physical ones."""
    if p.units is None:
        return {}
    dimensions = {name: observed.dimension(name) for name in names}
    dimensions |= {name: p.dimension(name) for name in parameters}
    return {name: found for name, d in dimensions.items() if (found := unit(p, d))}


def states_columns(p: Parameters, states: Sequence[SteadyState]) -> dict[str, Column]:
    """All observables of states, whether they are stable and how many of their modes grow."""
    found = {
        name: column(p, [s.number(name) for s in states], observed.dimension(name))
        for name in observed.names_of(p)
    }
    found["stable"] = column(p, np.array([s.stable for s in states], dtype=bool))
    for m in AZIMUTHAL_NUMBERS:
        counts = np.array([s.unstable_modes[m] for s in states], dtype=int)
        found[f"unstable_m{m}"] = column(p, counts)
    return found


@one_thread
def steady_states(
    p: Parameters, degrees: tuple[int, ...] = (1, 2, 3), watch: Watch = unwatched
) -> SteadyStates:
    """All axisymmetric steady states of a cell, the homogeneous one among them.

    They are sought along the branches in v_p0 that bifurcate from the homogeneous sphere in its
    modes l of `degrees`; mirror images are left out. `watch` is called with every step. Whether
    the search was complete is part of the answer. Raises InvalidInput for degrees that no mode has.

    >>> import amoeboid as am
    >>> states = am.steady_states(am.Parameters(D=0.4, v_p0=5.5))
    >>> [state.stable for state in states]
    [True, False, True]
    """
    refuse_no_parameters(p)
    return shown_states(steady_solutions(p, degrees, watch))


def shown_states(found: SteadySolutions) -> SteadyStates:
    """The result of a search as users see it."""
    states = tuple(SteadyState(solution) for solution in found.states)
    problems = with_units(found.parameters, found.problems, "v_p0")
    return SteadyStates(found.parameters, states, found.complete, problems)
