"""A cell that moves in a circle: a soft polarized cell, unstable to bending, in 3D.

The path is that of a cell with all drag on its cortex, uniformly. The reference is a relative
equilibrium found with spherical harmonics, without a mesh; docs/large-deformation.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.figures import computed, sections
from amoeboid.figures.drawing import SYMBOLS
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.style import COLUMN
from amoeboid.figures.tables import FigureData, Table, column_of, drawn_unit, label
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES
from amoeboid.plotting.palette import COLOR_MAP, GRAY, INK, ORANGE
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.solution import simulate
from amoeboid.sections import Initial
from amoeboid.simulation.events import time
from amoeboid.simulation.timeseries import POSITION
from amoeboid.studies.columns import Column, text

SUBDIVISIONS = 3  # 642 nodes
END = 80.0  # [1/rate]: the cell polarizes, goes straight, bends, and makes more than one circle
NOISE, SEED = 0.1, 1  # of c at the start [c0]
OUTLINES = 20  # of the cell, at equal intervals of time: a turn takes 8.5 of them
TURN = 2.0 * np.pi
HEADING = "cortex_drag_heading"

ROUND = 0.05  # how well the radius and speed/turning of a circle agree; a helix is none

CIRCLES = Parameters(D=0.4, delta_P=20.0, v_p0=8.0)
TURNING, SPEED, RADIUS = 0.16500, 2.21935, 13.450
"""Of the relative equilibrium of CIRCLES, in units of R0 and 1/beta."""
MESH_ERRORS = (
    "the rotation is too fast by 4.7 to 8.2 % on 642 nodes, and by a third of this on 2562 nodes"
)
"""Of runs of CIRCLES from noise, seeds 1 to 4; docs/large-deformation.md."""


def circling_run(p: Parameters, subdivisions: int, end: float, outlines: int) -> dict[str, Any]:
    """A run from noise: its path in the plane of its last turn, and sections of the cell there.

    `path` (T, 3): the third coordinate is out of the plane; `turned`: the angle of the heading
    since the start; `whole`: the step at which the last whole turn begins, None without one;
    `sections`: (t, x, y, x, y, c) of pieces of the outline.
    """
    run = simulate(
        p,
        mesh=Icosphere(subdivisions),
        initial=Initial(perturbation=0.0, noise=NOISE * p.c0, seed=SEED),
        until=time(end),
        times=np.linspace(0.0, end, outlines).tolist(),
        progress=False,
    )
    t, speed = (np.array([row[name] for row in run.rows]) for name in ("t", "cortex_drag_speed"))
    x = np.array([[row[name] for name in POSITION] for row in run.rows])
    names = OBSERVABLES[HEADING].columns(HEADING)
    turned = turned_by(np.array([[row[name] for name in names] for row in run.rows]))
    whole = int(np.searchsorted(turned, turned[-1] - TURN, side="right")) - 1
    plane = plane_of(x, max(whole, 0))
    pieces: list[Array] = []
    for frame in run.frames:
        cell = frame.cell
        found = section(cell.x @ plane.T, cell.faces, cell.c)
        place = (cell.state.position - x[0]) @ plane.T
        found[:, :4] += np.tile(place[:2], 2)
        pieces.append(np.column_stack([np.full(len(found), cell.t), found]))
    return {
        "t": t.tolist(),
        "path": ((x - x[0]) @ plane.T).tolist(),
        "speed": speed.tolist(),
        "turned": turned.tolist(),
        "whole": whole if whole >= 0 else None,
        "sections": np.concatenate(pieces).tolist(),
        "status": run.status,
        "ended": run.ended,
    }


def turned_by(heading: Array) -> Array:
    """Angles (T,) by which unit vectors (T, 3) have turned since the first; zero vectors rest."""
    moves = np.einsum("ti,ti->t", heading, heading) > 0.0
    cosines = np.einsum("ti,ti->t", heading[1:], heading[:-1])
    angles = np.where(moves[1:] & moves[:-1], np.arccos(np.clip(cosines, -1.0, 1.0)), 0.0)
    return np.concatenate([[0.0], np.cumsum(angles)])


def plane_of(x: Array, begin: int) -> Array:
    """Rows (3, 3): two directions of the plane of a path (T, 3) from `begin` on, and its normal.

    The first is that along which the whole path extends most, from its start on; the path goes
    around the normal from the first to the second.
    """
    about = x[begin:] - x[begin:].mean(axis=0)
    normal = np.linalg.svd(about, full_matrices=True)[2][2]
    if np.cross(about[:-1], about[1:]).sum(axis=0) @ normal < 0.0:
        normal = -normal
    flat = x - np.outer(x @ normal, normal)
    first = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=True)[2][0]
    if (x.mean(axis=0) - x[0]) @ first < 0.0:
        first = -first
    return np.stack([first, np.cross(normal, first), normal])


def section(x: Array, faces: Array, c: Array) -> Array:
    """The section of a surface with the plane z = 0: rows (x, y, x, y, c), one a triangle."""
    above = x[:, 2] > 0.0
    cut = faces[above[faces].any(axis=1) & ~above[faces].all(axis=1)]
    found = []
    for corners in cut:
        ends = []
        for a, b in zip(corners, np.roll(corners, -1), strict=True):
            if above[a] != above[b]:
                share = x[a, 2] / (x[a, 2] - x[b, 2])
                ends.append([*(x[a] + share * (x[b] - x[a]))[:2], c[a] + share * (c[b] - c[a])])
        (x1, y1, c1), (x2, y2, c2) = ends
        found.append([x1, y1, x2, y2, 0.5 * (c1 + c2)])
    return np.array(found)


def fitted_circle(x: Array) -> tuple[Array, float]:
    """Center (2,) and radius of the circle nearest to points (K, 2): least squares of x^2."""
    system = np.column_stack([2.0 * x, np.ones(len(x))])
    a, b, rest = np.linalg.lstsq(system, np.einsum("ki,ki->k", x, x), rcond=None)[0]
    return np.array([a, b]), float(np.sqrt(rest + a * a + b * b))


def is_reference(p: Parameters) -> bool:
    """Whether p is the cell of CIRCLES, in any units."""
    if p.beta == 0.0:
        return False
    c = np.array([0.5, 1.0, 3.0, 8.0])
    numbers = (p.D / (p.R0**2 * p.beta), p.eta_b / p.eta_s, p.c0 / p.c_r)
    pressure = p.delta_P * p.R0 / (p.eta_s * p.beta)
    speeds = p.v_p(c * p.c_r) / (p.R0 * p.beta)
    known = (CIRCLES.D, CIRCLES.eta_b, CIRCLES.c0, CIRCLES.delta_P, *CIRCLES.v_p(c))
    return bool(
        np.allclose([*numbers, pressure, *speeds], known, rtol=1e-9)
        and not np.any(p.tau(c * p.c_r))
    )


def compute(p: Parameters, results: Results) -> FigureData:
    """The run, the circle of its last whole turn, and the reference where there is one."""
    end = END / p.rate
    found = results.of(
        circling_run, p, SUBDIVISIONS, end, OUTLINES, task="3D run of a circling cell"
    )
    path, t = np.array(found["path"]), np.array(found["t"])
    turned, speed = np.array(found["turned"]), np.array(found["speed"])
    whole = found["whole"]
    circle = _circle(p, t, path, turned, speed, whole)
    last = (np.arange(len(t)) >= (whole or 0)) & np.isfinite(circle["turning"])
    columns = {"t": column_of(p, t, "T")}
    columns |= {k: column_of(p, path[:, i], "L") for i, k in enumerate("xyz")}
    columns["speed"] = column_of(p, speed, "L/T")
    columns["turned"] = Column(turned, "rad")
    columns["last_turn"] = column_of(p, last)
    pieces = np.array(found["sections"]).T
    outline = {"t": column_of(p, pieces[0], "T")}
    outline |= {
        name: column_of(p, pieces[k], "L") for k, name in enumerate(("x1", "y1", "x2", "y2"), 1)
    }
    outline["c"] = column_of(p, pieces[5], "N/L^2")
    dimensions = {"turning": "1/T", "speed": "L/T"}
    fits = {
        name: column_of(p, [value], dimensions.get(name.removeprefix("reference_"), "L"))
        for name, value in circle.items()
    }
    tables = {
        "path": Table("center of the cell in the plane of its last turn, z out of it", columns),
        "outlines": Table("pieces of sections of the cell with that plane", outline),
        "circle": Table("the last whole turn, and the reference without a mesh", fits),
    }
    problems = [] if found["status"] == "finished" else [f"the run ended early: {found['ended']}"]
    return FigureData(p, tables, _notes(p, circle, turned), tuple(problems))


def _circle(
    p: Parameters, t: Array, path: Array, turned: Array, speed: Array, whole: int | None
) -> dict[str, float]:
    """Turning, speed and radius of the last whole turn, and of the reference; NaN for none.

    A turn is no circle where the path is not one, such as that of a helix or of a cell that folds.
    """
    names = ("turning", "speed", "radius", "center_x", "center_y")
    circle = dict.fromkeys(names, np.nan)
    if whole is not None:
        at = slice(whole, None)
        duration = t[-1] - t[whole]
        steps, means = np.diff(t[at]), 0.5 * (speed[at][1:] + speed[at][:-1])
        center, radius = fitted_circle(path[at, :2])
        turning = (turned[-1] - turned[whole]) / duration
        mean = float(steps @ means) / duration
        if abs(mean / turning / radius - 1.0) < ROUND:
            circle = dict(zip(names, (turning, mean, radius, *center), strict=True))
    known = is_reference(p)
    units = {
        "turning": (TURNING, p.beta),
        "speed": (SPEED, p.R0 * p.beta),
        "radius": (RADIUS, p.R0),
    }
    return circle | {
        f"reference_{name}": value * size if known else np.nan
        for name, (value, size) in units.items()
    }


def _notes(p: Parameters, circle: dict[str, float], turned: Array) -> tuple[str, ...]:
    """The fitted numbers, those of the reference, and how good they are."""
    if np.isnan(circle["turning"]):
        angle = np.degrees(turned[-1])
        return (f"the heading turned by {angle:.3g} degrees in all, not in a circle at the end",)
    dimensions = {"turning": "1/T", "speed": "L/T", "radius": "L"}

    def told(start: str) -> str:
        return ", ".join(
            f"{name} {text(p, circle[start + name], d, '.5g')}" for name, d in dimensions.items()
        )

    fitted = f"last whole turn on {computed.nodes(SUBDIVISIONS)}: {told('')}"
    if np.isnan(circle["reference_turning"]):
        return (
            fitted,
            "no solution without a mesh is known for these parameters; at "
            f"{CIRCLES.description} {MESH_ERRORS}",
        )
    errors = ", ".join(
        f"{name} {100 * (circle[name] / circle[f'reference_{name}'] - 1):+.2g} %"
        for name in dimensions
    )
    return (
        fitted,
        f"without a mesh: {told('reference_')}",
        f"error of this run: {errors}; from other starts {MESH_ERRORS}",
    )


def draw(data: FigureData, axes: Any) -> None:
    """The path with outlines of the cell, and the reference circle about the same center."""
    from matplotlib.collections import LineCollection

    path, outlines, circle = data["path"], data["outlines"], data["circle"]
    last = path["last_turn"]
    unit = path.unit("x")
    axes.plot(path["x"], path["y"], color=GRAY, lw=0.7, zorder=1)
    first = outlines["t"] == outlines["t"][0]
    axes.annotate(
        "start", (path["x"][0], outlines["y1"][first].max()), xytext=(0.0, 2.5),
        textcoords="offset points", ha="center", va="bottom", fontsize=7.0,
    )  # fmt: skip
    known = float(circle["reference_radius"][0])
    if last.any():
        radius = sections.amount(float(circle["radius"][0]), unit, 4)
        axes.plot(
            path["x"][last], path["y"][last], color=INK, lw=1.0, zorder=2,
            label=f"{computed.nodes(SUBDIVISIONS)}, radius {radius}",
        )  # fmt: skip
    if last.any() and np.isfinite(known):
        center = (float(circle["center_x"][0]), float(circle["center_y"][0]))
        name = f"without mesh, {sections.amount(known, unit, 4)}"
        sections.draw_circle(axes, center, known, color=ORANGE, ls="--", lw=1.0, label=name)
    ends = np.stack([sections.points(outlines, f"x{k}", f"y{k}") for k in (1, 2)], axis=1)
    cells = LineCollection(list(ends), array=outlines["c"], cmap=COLOR_MAP, lw=1.6, zorder=3)
    cells.set_capstyle("round")
    axes.add_collection(cells)
    bar = axes.figure.colorbar(cells, ax=axes, location="bottom", aspect=36, pad=0.02)
    bar.set_label(label(SYMBOLS["c"], outlines.unit("c")))
    bar.outline.set_linewidth(0.4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set_xlabel(f"$x$ [{drawn_unit(unit)}]")
    axes.set_ylabel(f"$y$ [{drawn_unit(unit)}]")
    if last.any():
        axes.legend(loc="upper left", borderpad=0.0)


FIGURE = Figure(
    name="extra_circle",
    title="a cell that moves in a circle",
    source="not in the paper",
    parameters=CIRCLES,
    compute=compute,
    draw=draw,
    size=(COLUMN, 2.8),
)
