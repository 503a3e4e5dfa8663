"""Branches of straight, circling and helical cells: how fast soft cells turn, and how they climb.

Straight cells become unstable to bending, and cells on circles leave them. These become unstable to
motion out of their plane, and cells on helices leave. All of them are solved for in a frame that
turns with the cell; docs/large-deformation.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.figures import computed
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.style import COLUMN
from amoeboid.figures.tables import FigureData, Table, column_of, drawn_unit
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, GRAY, GREEN, INK, ORANGE
from amoeboid.runs.branches import branch
from amoeboid.runs.cell_branch import CellBifurcation
from amoeboid.runs.meshes import Icosphere
from amoeboid.studies.branch import BIFURCATION, Branch
from amoeboid.studies.columns import quantity, text
from amoeboid.validation import InvalidInput

SUBDIVISIONS = 3  # 642 nodes
# Windows in units of v_p0 at the onset without a mesh: to seek it in, in units of the threshold of
# the sphere, around it, and of circles and helices.
SOUGHT, AROUND, TURNING = 2.0, (0.985, 1.03), (0.97, 1.08)
PATHS = {"straight": GRAY, "circle": BLUE, "helix": GREEN}
OBSERVED = {"turning": "1/T", "torsion": "1/L", "cortex_drag_speed": "L/T"}


def turning_branches(p: Parameters, subdivisions: int) -> dict[str, Any]:
    """Rows of the branches, with where they begin, and problems."""
    onset = bending_onset(p)
    if onset is None:
        problem = (
            "no straight cell becomes unstable to bending below twice the threshold of the sphere"
        )
        return {"rows": [], "points": [], "onset": None, "problems": [problem]}
    mesh = Icosphere(subdivisions)
    found = [branch(p, "v_p0", *_ends(p, onset, AROUND), mesh=mesh)]
    for leads_to in ("circle", "helix"):
        leaving = [point for point in left_at(found[-1]) if point.leads_to == leads_to]
        if not leaving:
            break
        ends = _ends(p, onset, TURNING)
        found.append(branch(p, "v_p0", *ends, through=leaving[0]))
    rows, problems = [], list[str]()
    for path, along in zip(PATHS, found, strict=False):
        problems += [f"{path}: {problem}" for problem in along.problems]
        states = zip(along.lengths[0], along.states, strict=True)
        known = [(length, computed.STATE, state) for length, state in states]
        known += [(b.length, b.kind, b.state) for b in along.bifurcations]
        for _, kind, cell in sorted(known, key=lambda entry: entry[0]):
            numbers = [cell.number(name) for name in OBSERVED]
            stable = kind == computed.STATE and cell.stable
            rows.append([path, cell.parameters.v_p0, *numbers, stable, kind])
    left = [point for along in found for point in left_at(along)]
    points = [[b.what, b.number, b.state.number("turning")] for b in left]
    return {"rows": rows, "points": points, "onset": onset, "problems": problems}


def left_at(along: Branch) -> list[CellBifurcation]:
    """The bifurcations of a branch at which steady cells leave it, in their order along v_p0."""
    found = [b for b in along.bifurcations if isinstance(b, CellBifurcation) and b.length != 0.0]
    return sorted((b for b in found if b.kind == BIFURCATION), key=lambda b: b.number)


def bending_onset(p: Parameters) -> float | None:
    """v_p0 of the first straight cell to which m = 1 is neutral, without a mesh; None for none."""
    from amoeboid.axisymmetric.onset import onset_speed

    threshold = onset_speed(p)
    if threshold is None:
        return None
    found = branch(p, "v_p0", *_ends(p, threshold, (0.5, SOUGHT)))
    bending = [b.number for b in found.bifurcations if b.m == 1 and b.kind == BIFURCATION]
    return min(bending, default=None)


def _ends(p: Parameters, unit: float, window: tuple[float, float]) -> list[Any]:
    return [quantity(p, share * unit, p.dimension("v_p0")) for share in window]


def compute(p: Parameters, results: Results) -> FigureData:
    """The branches on these nodes, and where they leave each other."""
    if p.beta == 0.0:
        raise InvalidInput("beta must be > 0 here, got 0: rates of rotation are in units of beta")
    found = results.of(turning_branches, p, SUBDIVISIONS, task="3D branches of turning cells")
    rows = found["rows"]
    columns = list(zip(*rows, strict=True)) if rows else [()] * (len(OBSERVED) + 4)
    table = {
        "path": column_of(p, np.array(columns[0], dtype=str)),
        "v_p0": column_of(p, columns[1], p.dimension("v_p0")),
    }
    table |= {
        name: column_of(p, columns[k], dimension)
        for k, (name, dimension) in enumerate(OBSERVED.items(), 2)
    }
    table["stable"] = column_of(p, np.array(columns[-2], dtype=bool))
    table["kind"] = column_of(p, np.array(columns[-1], dtype=str))
    table["piece"] = column_of(p, np.array([list(PATHS).index(row[0]) for row in rows], dtype=int))
    points = found["points"]
    special = {
        "what": column_of(p, np.array([point[0] for point in points], dtype=str)),
        "v_p0": column_of(p, [point[1] for point in points], p.dimension("v_p0")),
        "turning": column_of(p, [point[2] for point in points], "1/T"),
    }
    tables = {
        "branches": Table(
            f"steady cells on {computed.nodes(SUBDIVISIONS)}, branch after branch", table
        ),
        "points": Table("bifurcations between them", special),
    }
    notes = [f"{what} at v_p0 = {text(p, at, 'L/T', '.6g')}" for what, at, _ in points]
    if found["onset"] is not None:
        at = text(p, found["onset"], "L/T", ".6g")
        notes.append(f"without a mesh, straight cells become unstable to bending at v_p0 = {at}")
    return FigureData(p, tables, tuple(notes), tuple(found["problems"]))


def draw(data: FigureData, panels: Any) -> None:
    """Turning and torsion over v_p0; dashed where a cell is unstable."""
    table, points = data["branches"], data["points"]
    above, below = panels
    for axes, name, label in (
        (above, "turning", "turning"),
        (below, "torsion", "torsion of the path"),
    ):
        for rows, stable in computed.pieces(table):
            path = str(table["path"][rows][0])
            axes.plot(
                table["v_p0"][rows], np.abs(table[name][rows]),
                "-" if stable else "--", color=PATHS[path],
            )  # fmt: skip
        axes.set_ylabel(f"{label} [{drawn_unit(table.unit(name))}]")
    if len(points["v_p0"]):
        above.plot(
            points["v_p0"], points["turning"], "o", ms=3.5, color=ORANGE, label="bifurcation"
        )
    for path, color in PATHS.items():
        above.plot([], [], color=color, label=path)
    above.plot([], [], "--", color=INK, label="unstable")
    above.legend(loc="upper left")
    above.tick_params(labelbottom=False)
    below.set_xlim(above.get_xlim())
    below.set_xlabel(f"$v_p^0$ [{drawn_unit(table.unit('v_p0'))}]")


FIGURE = Figure(
    name="extra_turning",
    title="straight, circling and helical cells",
    source="not in the paper",
    parameters=Parameters(D=0.4, delta_P=20.0, v_p0=8.0),
    compute=compute,
    draw=draw,
    size=(COLUMN, 3.8),
    panels=(2, 1),
    varies=frozenset({"v_p0"}),
)
