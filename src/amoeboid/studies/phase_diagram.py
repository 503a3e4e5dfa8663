"""Phase diagram in v_p0 and one other parameter, with its edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.phase_diagram import (
    BISTABLE,
    REGIONS,
    DiagramSolution,
    diagram_of_columns,
    phase_columns,
)
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.display import html_picture, html_table, plotted
from amoeboid.extras import needed
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.studies.columns import (
    TABLE,
    magnitude,
    physical_number,
    quantity,
    shortened,
    text,
    titled,
    unit,
    value_of,
    with_units,
)
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

MAX_GRID = 500
D_WINDOW, SPEED_WINDOW = (0.03, 0.6), (3.0, 8.0)
"""The window in D and v_p0 for the paper's table, in units of its beta R0^2 and of beta R0."""

SPEED = "L/T"


@dataclass(frozen=True, eq=False, repr=False)
class PhaseDiagram:
    """Where the cell is at rest, polarized or bistable, in v_p0 and the parameter `name`.

    `values` (columns,) of the parameter and `speeds` (rows,) of v_p0; `regions` (rows, columns)
    index `REGIONS`. With physical parameters, numbers are quantities with units. `problems` says
    what could not be followed to its end. `solution` has it all in plain numbers.
    """

    parameters: Parameters
    solution: DiagramSolution
    problems: tuple[str, ...]

    @property
    def name(self) -> str:
        """The parameter beside v_p0."""
        return self.solution.name

    @property
    def complete(self) -> bool:
        """Whether all branches and lines of folds were followed to their ends."""
        return self.solution.complete

    @property
    def values(self) -> Any:
        """The values of the parameter `name` (columns,)."""
        return self._of_name(self.solution.values)

    @property
    def speeds(self) -> Any:
        """The values of v_p0 (rows,) [L/T]."""
        return self._speed(self.solution.speeds)

    @property
    def regions(self) -> Array:
        """Indices into `REGIONS` (rows, columns) [1]."""
        return self.solution.regions

    @property
    def bistable(self) -> Array:
        """Where the resting and a polarized cell are both stable (rows, columns)."""
        return np.asarray(self.regions == BISTABLE)

    @property
    def max_retrograde_speed(self) -> Any:
        """That of the fastest stable polarized state, 0 where there is none (rows, columns)."""
        return self._speed(self.solution.flow)

    @property
    def threshold(self) -> tuple[Any, Any]:
        """(values, v_p0) along the line on which the sphere becomes unstable."""
        return self._line(self.solution.threshold_line)

    @property
    def folds(self) -> tuple[tuple[Any, Any], ...]:
        """(values, v_p0) along each line of folds, the lower edge of the bistable region."""
        return tuple(self._line(line) for line in self.solution.fold_lines)

    @property
    def boundary(self) -> tuple[Any, Any]:
        """(values, v_p0) of the points at which the bifurcation turns super- to subcritical."""
        return self._line(self.solution.tips)

    def to_xarray(self) -> Any:
        """An xarray.Dataset over (v_p0, name): regions, their names and the retrograde speed."""
        xarray, p, name = needed("xarray", TABLE), self.parameters, self.name
        axes = ("v_p0", name)
        values = magnitude(p, self.solution.values, p.dimension(name))
        speeds = magnitude(p, self.solution.speeds, SPEED)
        flow = magnitude(p, self.solution.flow, SPEED)
        return xarray.Dataset(
            {
                "region": (axes, self.regions),
                "region_name": (axes, np.array(REGIONS)[self.regions]),
                "max_retrograde_speed": (axes, flow, {"units": unit(p, SPEED)}),
            },
            {
                "v_p0": ("v_p0", speeds, {"units": unit(p, SPEED)}),
                name: (name, values, {"units": unit(p, p.dimension(name))}),
            },
            attrs={"complete": int(self.complete), "problems": list(self.problems)},
        )

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row a cell of the diagram."""
        needed("pandas", TABLE)
        return self.to_xarray().to_dataframe().reset_index()

    def plot(self, ax: Any = None) -> Any:
        """Draw regions, threshold, folds and boundary. Takes and returns axes."""
        return plotted(self, "branches.draw_phase_diagram", ax)

    def plain(self, name: str, value: float) -> float:
        """A value of `name`, v_p0 or the parameter, as programs read it: in the unit of `units`."""
        return physical_number(self.parameters, value, self.parameters.dimension(name))

    @property
    def units(self) -> dict[str, str]:
        """The physical units of `plain`; empty where the parameters have none."""
        names = () if self.parameters.units is None else ("v_p0", self.name)
        return {name: unit(self.parameters, self.parameters.dimension(name)) for name in names}

    def _of_name(self, values: Any) -> Any:
        return quantity(
            self.parameters, np.asarray(values, dtype=float), self.parameters.dimension(self.name)
        )

    def _speed(self, values: Any) -> Any:
        return quantity(self.parameters, np.asarray(values, dtype=float), SPEED)

    def _line(self, pairs: Any) -> tuple[Any, Any]:
        table = np.array(pairs, dtype=float).reshape(-1, 2)
        return self._of_name(table[:, 0]), self._speed(table[:, 1])

    @property
    def _heading(self) -> str:
        found = "complete" if self.complete else "incomplete"
        rows, columns = self.regions.shape
        return f"Phase diagram in {self.name} and v_p0: {columns} x {rows} cells, {found}"

    @property
    def _counts(self) -> list[tuple[str, int]]:
        return [(REGIONS[k], int(np.sum(self.regions == k))) for k in np.unique(self.regions)]

    def _tips(self) -> list[str]:
        p, dimension = self.parameters, self.parameters.dimension(self.name)
        return [
            f"{self.name} = {text(p, a, dimension)}, v_p0 = {text(p, b, SPEED)}"
            for a, b in self.solution.tips
        ]

    def __repr__(self) -> str:
        lines = [self._heading, ", ".join(f"{count} {name}" for name, count in self._counts)]
        tips = shortened(self._tips(), 3, "points")
        lines += [f"super- and subcritical bifurcation meet at {tip}" for tip in tips]
        problems = shortened(self.problems, 2, "problems")
        return "\n".join([*lines, *(f"- {problem}" for problem in problems)])

    def _repr_html_(self) -> str:
        p = self.parameters
        rows: list[tuple[str, str]] = [(name, f"{count} cells") for name, count in self._counts]
        rows += [("super/subcritical", tip) for tip in self._tips()]
        ends = (
            (self.name, self.solution.values, self.parameters.dimension(self.name)),
            ("v_p0", self.solution.speeds, SPEED),
        )
        for name, numbers, dimension in ends:
            low, high = (f"{magnitude(p, numbers[k], dimension):.6g}" for k in (0, -1))
            rows.append((titled(name, unit(p, dimension)), f"{low} to {high}"))
        notes = shortened(self.problems, 20, "problems", 500)
        return html_table(self._heading, rows, (), notes) + html_picture(
            self, "branches.draw_phase_diagram"
        )


@one_thread
def phase_diagram(
    p: Parameters,
    name: str = "D",
    low: Any = None,
    high: Any = None,
    *,
    speeds: tuple[Any, Any] | None = None,
    columns: int = 40,
    rows: int = 40,
    watch: Watch = unwatched,
) -> PhaseDiagram:
    """What is stable at each v_p0 and each value of the parameter `name`, and the edges of it.

    `low` and `high` are the ends of the window of the parameter, `speeds` those of v_p0; with
    physical parameters they are quantities such as "2 um/s". What is left out is the window of the
    paper's table in units of this cell (D and v_p0 alone). Found at
    `columns` values of the parameter and `rows` of v_p0. `watch` is called with every step.
    Raises InvalidInput for windows that cannot be, and where there is nothing to measure them in.
    """
    refuse_no_parameters(p)
    if speeds is not None and (not isinstance(speeds, tuple | list) or len(speeds) != 2):
        raise InvalidInput(f"speeds must be (lowest, highest), got {speeds!r}")
    given = (low, high, *(speeds or (None, None)))
    window, speed_window = windows(p, name, *given)
    checked_counts(columns, rows)
    values = np.linspace(window[0], window[1], columns)
    v_p0 = np.linspace(speed_window[0], speed_window[1], rows)
    found = []
    for number, column in enumerate(phase_columns(p, name, values, v_p0), 1):
        found.append(column)
        watch(Progress(f"column {number} of {columns}", name, column.value, 0, 0))
    solution = diagram_of_columns(p, name, values, v_p0, tuple(found), watch)
    return PhaseDiagram(p, solution, with_units(p, solution.problems, name, "v_p0"))


LABELS = {
    "name": "name",
    "low": "low",
    "high": "high",
    "lowest": "speeds[0]",
    "highest": "speeds[1]",
    "columns": "columns",
    "rows": "rows",
}
"""What messages call the arguments of `phase_diagram`; the command has other names."""


def checked_counts(columns: int, rows: int, labels: Mapping[str, str] = LABELS) -> None:
    """Raises InvalidInput for numbers of columns and rows that make no diagram."""
    for label, count in (("columns", columns), ("rows", rows)):
        whole = isinstance(count, Integral) and not isinstance(count, bool)
        if not (whole and 2 <= count <= MAX_GRID):
            raise InvalidInput(
                f"{labels[label]} must be a whole number >= 2 and <= {MAX_GRID}, got {count!r}"
            )


def windows(
    p: Parameters,
    name: str,
    low: Any,
    high: Any,
    lowest: Any = None,
    highest: Any = None,
    labels: Mapping[str, str] = LABELS,
) -> tuple[list[float], list[float]]:
    """Lowest and highest value of the parameter `name`, and of v_p0, in the units of p.

    What is None is that of the paper's table in units of this cell: D in beta R0^2, v_p0 in
    proportion to its threshold. Raises InvalidInput where there is no such unit, and for a window
    that is none.
    """
    others = [other for other in p.names if other != "v_p0"]
    if name not in others:
        raise InvalidInput(f"{labels['name']} must be one of {', '.join(others)}, got {name!r}")
    asked = [
        None if v is None else value_of(p, name, v, labels[label])
        for label, v in (("low", low), ("high", high))
    ]
    if None in asked:
        unit_of_D = p.beta * p.R0**2
        if name != "D" or unit_of_D == 0:
            raise InvalidInput(
                f"{labels['low']} and {labels['high']} must be given for {name} (beta = "
                f"{p.beta:g}), which has no default window"
            )
        asked = [k * unit_of_D if v is None else v for k, v in zip(D_WINDOW, asked, strict=True)]
    speeds = [
        None if v is None else value_of(p, "v_p0", v, labels[label])
        for label, v in (("lowest", lowest), ("highest", highest))
    ]
    if None in speeds:
        try:
            here = float(critical_speed(p.replace(**{name: asked[0]})))
        except InvalidInput as problem:
            raise InvalidInput(
                f"{labels['lowest']} and {labels['highest']} must be given: {problem}"
            ) from None
        unit_of_v = here / float(critical_speed(Parameters(D=D_WINDOW[0])))
        speeds = [
            k * unit_of_v if v is None else v for k, v in zip(SPEED_WINDOW, speeds, strict=True)
        ]
    return (
        _ascending(asked, labels["low"], labels["high"]),
        _ascending(speeds, labels["lowest"], labels["highest"]),
    )


def _ascending(ends: Sequence[float | None], low: str, high: str) -> list[float]:
    found = [float(value) for value in ends if value is not None]
    if not found[0] < found[1]:
        raise InvalidInput(f"{low} must be < {high}, got {found[0]:g} and {found[1]:g}")
    return found
