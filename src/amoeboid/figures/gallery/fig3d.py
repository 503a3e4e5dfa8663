"""Figure 3D: the polarized cell in 3D, D = 0.4 and v_p0 = 6, also as files to turn it."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array, axis_across
from amoeboid.figures import sections
from amoeboid.figures.drawing import SYMBOLS
from amoeboid.figures.figure import Figure
from amoeboid.figures.page import Scene, page
from amoeboid.figures.results import Results
from amoeboid.figures.style import COLUMN
from amoeboid.figures.tables import FigureData, Table, column_of, label
from amoeboid.meshes.vtp import frame_bytes
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES
from amoeboid.output.frames import frame_arrays
from amoeboid.plotting.cell import MIN_FLOW
from amoeboid.plotting.cell_picture import spread_out
from amoeboid.plotting.palette import COLOR_MAP, GRAY, INK, ORANGE
from amoeboid.runs.analysis import axis
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.solution import simulate
from amoeboid.studies.columns import text

SUBDIVISIONS = 3  # the paper's 642 nodes
SHOWN = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "deformation", "polarity")
ARROWS = 150
ARROW = 0.34  # length of the arrow of the fastest flow [R0]
MIN_SPREAD = 0.05  # of c in units of c0: a homogeneous cell shows no noise
FINER = 3  # parts of each edge of a triangle, so that c is seen to change smoothly
CLEAR = 0.25  # opacity of the transparent hemisphere
OPENING = np.radians(32.0)  # from the vertical towards the reader: middle of that hemisphere
TILT = (0.25, 0.3)  # of the sight: from above, and from the rear
TITLE = "Polarized cell"


def steady_cell(p: Parameters, subdivisions: int) -> dict[str, Any]:
    """The cell at the end of the run from the polarized sphere, as a frame, and its observables."""
    run = simulate(p, mesh=Icosphere(subdivisions), progress=False)
    cell = run.final.cell
    fields, numbers = frame_arrays(cell)
    return {
        "r": cell.r.tolist(),
        "x": cell.x.tolist(),
        "faces": cell.faces.tolist(),
        "fields": {name: values.tolist() for name, values in fields.items()},
        "numbers": {name: values.tolist() for name, values in numbers.items()},
        "rear": axis(cell, np.array([0.0, 0.0, 1.0])).tolist(),
        "observables": {name: OBSERVABLES[name].value(name, cell) for name in SHOWN},
        "rate": float(cell.rate),
        "steady": run.steady,
        "stability": run.stability,
        "ended": run.ended,
    }


def own_axes(rear: Array) -> Array:
    """Rows x, y, z of a frame (3, 3) whose z points to the rear."""
    x = np.cross(rear, axis_across(rear))
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(rear, x), rear])


def sight_axes() -> Array:
    """Rows right, up and towards the reader (3, 3), in the frame of the cell.

    z lies to the right, and the half x > 0 above and in front.
    """
    x, y = np.cos(OPENING), np.sin(OPENING)
    up, toward = np.array([x, -y, 0.0]), np.array([y, x, 0.0])
    sight = toward + TILT[0] * up + TILT[1] * np.array([0.0, 0.0, 1.0])
    sight /= np.linalg.norm(sight)
    right = np.cross(up, sight)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(sight, right), sight])


def compute(p: Parameters, results: Results) -> FigureData:
    """The run to its steady state; nodes in the frame of the cell, with its rear at +z."""
    found = results.of(steady_cell, p, SUBDIVISIONS, task="3D run to the steady state")
    axes = own_axes(np.array(found["rear"]))
    x, flow = np.array(found["x"]) @ axes.T, np.array(found["fields"]["retrograde_flow"]) @ axes.T
    c, faces = np.array(found["fields"]["c"]), np.array(found["faces"])
    observables = found["observables"]
    fastest = float(observables["max_retrograde_speed"])
    moves = fastest > MIN_FLOW * found["rate"] * p.R0
    chosen = np.zeros(len(x), dtype=bool)
    if moves:
        chosen[spread_out(x, ARROWS)] = True
    nodes = {k: column_of(p, x[:, i], "L") for i, k in enumerate("xyz")}
    nodes["c"] = column_of(p, c, "N/L^2")
    nodes |= {f"flow_{k}": column_of(p, flow[:, i], "L/T") for i, k in enumerate("xyz")}
    nodes["arrow"] = column_of(p, chosen)
    corners = {k: column_of(p, faces[:, i]) for i, k in enumerate(("a", "b", "c"))}
    cell = {"R0": column_of(p, [p.R0], "L"), "c0": column_of(p, [p.c0], "N/L^2")}
    cell |= {
        name: column_of(p, [value], OBSERVABLES[name].dimension)
        for name, value in observables.items()
    }
    cell |= {name: column_of(p, [found[name]]) for name in ("steady", "stability")}
    tables = {
        "nodes": Table("nodes of the mesh about the center of the cell, rear at +z", nodes),
        "triangles": Table(
            "triangles, by the rows of their corners in the table of nodes", corners
        ),
        "cell": Table("the cell as a whole", cell),
    }
    problems = [] if found["steady"] else [f"the cell is not steady: {found['ended']}"]
    fields, numbers = (_arrays(found[name]) for name in ("fields", "numbers"))
    files: dict[str, str | bytes] = {
        "vtp": frame_bytes(np.array(found["r"]), faces, fields, numbers),
        "html": page(_scene(p, tables)),
    }
    return FigureData(p, tables, _notes(p, found), tuple(problems), files)


def _arrays(lists: dict[str, Any]) -> dict[str, Array]:
    return {name: np.array(values) for name, values in lists.items()}


def _notes(p: Parameters, found: dict[str, Any]) -> tuple[str, ...]:
    values = found["observables"]
    texts = [
        f"{name} = {text(p, values[name], OBSERVABLES[name].dimension, '#.7g')}"
        for name in SHOWN[:4]
    ]
    frame = "in the units of the solver" if p.units is not None else "a frame as runs write them"
    return (
        f"{', '.join(texts)}; {found['stability']}",
        f"the file .vtp is for ParaView ({frame}; a run can start from it), .html for a browser",
    )


def _scene(p: Parameters, tables: dict[str, Table]) -> Scene:
    """What the page shows; numbers with their units."""
    nodes, cell = tables["nodes"], tables["cell"]
    x, flow = _vectors(nodes)
    R0, fastest = float(cell["R0"][0]), float(cell["max_retrograde_speed"][0])
    values = {
        name: f"{float(cell[name][0]):.5g} {cell.unit(name)}".rstrip() for name in ("R0", *SHOWN)
    }
    moves = bool(nodes["arrow"].any())
    about = (
        f"A cell seen from the side. The filament concentration rises from {values['c_front']} at "
        f"the front, on the left, to {values['c_rear']} at the rear, on the right. "
        f"The cortex flows along the surface from front to rear, at most at "
        f"{values['max_retrograde_speed']}; the cell migrates to the left."
        if moves
        else f"A cell that does not move, with a filament concentration of {values['c_front']} to "
        f"{values['c_rear']}."
    )
    return Scene(
        title=f"{TITLE}, {p.description}",
        about=about,
        label=f"filament concentration c [{nodes.unit('c')}]",
        values=values | {"state": str(cell["stability"][0])},
        nodes=x / R0,
        faces=np.column_stack([tables["triangles"][k] for k in "abc"]),
        c=nodes["c"],
        limits=_limits(nodes, cell),
        arrows=flow * (ARROW / fastest if moves else 0.0),
        chosen=nodes["arrow"],
        view=sight_axes(),
        moves=moves,
    )


def _limits(nodes: Table, cell: Table) -> tuple[float, float]:
    """Ends of the colors: the extrema of c, or a wider range about a homogeneous one."""
    low, high = float(nodes["c"].min()), float(nodes["c"].max())
    least = MIN_SPREAD * float(cell["c0"][0])
    wider = max(0.0, 0.5 * (least - (high - low)))
    return low - wider, high + wider


def _vectors(nodes: Table) -> tuple[Array, Array]:
    """Positions and flow (V, 3)."""
    return (
        np.column_stack([nodes[k] for k in "xyz"]),
        np.column_stack([nodes[f"flow_{k}"] for k in "xyz"]),
    )


def draw(data: FigureData, axes: Any) -> None:
    """The cell from the side, front to the left: what is farthest first."""
    nodes, cell = data["nodes"], data["cell"]
    x, flow = _vectors(nodes)
    faces = np.column_stack([data["triangles"][k] for k in "abc"])
    R0, fastest = float(cell["R0"][0]), float(cell["max_retrograde_speed"][0])
    way = flow * (ARROW * R0 / fastest if nodes["arrow"].any() else 0.0)
    sight = sight_axes()
    near = _normals(x[faces]) @ sight[2] > 0.0
    shown = None
    # what the reader sees through is drawn last, and hides nothing
    for zorder, side, half in ((0, ~near, 1.0), (0, ~near, -1.0), (4, near, -1.0), (8, near, 1.0)):
        corners, c = _half(x[faces[side]], nodes["c"][faces[side]], half)
        drawn = _polygons(corners, c, sight, CLEAR if half > 0.0 else 1.0, zorder)
        drawn.set_clim(*_limits(nodes, cell))
        axes.add_collection(drawn)
        _draw_lines(axes, _rim(corners), sight, INK, zorder + 1)
        shown = drawn if half < 0.0 else shown
    _draw_lines(axes, x[_outline(faces, near)], sight, GRAY, 9)
    facing = np.zeros(len(x), dtype=bool)
    facing[faces[near]] = True
    for zorder, seen in ((2, ~facing), (6, facing)):
        rows = np.flatnonzero(seen & nodes["arrow"] & (x[:, 0] <= 0.0))
        _flow_arrows(axes, x[rows] @ sight.T, way[rows] @ sight.T, zorder)
    moves = bool(nodes["arrow"].any())
    _annotate(axes, cell, sight, R0, moves)
    bar = axes.figure.colorbar(shown, ax=axes, location="bottom", shrink=0.8, pad=0.02, aspect=30)
    bar.set_label(label(SYMBOLS["c"], nodes.unit("c")))
    bar.outline.set_linewidth(0.4)


def _normals(corners: Array) -> Array:
    """Outward normals (F, 3) of triangles, not of unit length."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _half(corners: Array, c: Array, sign: float) -> tuple[list[Array], Array]:
    """The part with sign x >= 0 of triangles (F, 3, 3), as polygons, and c of each.

    The triangles are divided into smaller ones, with c between that of their corners.
    """
    shares = np.array([[(FINER - i - j, i, j) for i, j in part] for part in _parts(FINER)]) / FINER
    small = np.einsum("skb,fbi->fski", shares, corners).reshape(-1, 3, 3)
    values = np.einsum("sb,fb->fs", shares.mean(axis=1), c).ravel()
    inside = (sign * small[:, :, 0] >= 0.0).sum(axis=1)
    found = [_cut(one, sign) if n < 3 else one for one, n in zip(small, inside, strict=True) if n]
    return found, values[inside > 0]


def _cut(polygon: Array, sign: float) -> Array:
    """The part with sign x >= 0 of a convex polygon (K, 3)."""
    found = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if sign * a[0] >= 0.0:
            found.append(a)
        if a[0] * b[0] < 0.0:
            cut = a + (a[0] / (a[0] - b[0])) * (b - a)
            found.append(np.array([0.0, *cut[1:]]))
    return np.array(found)


def _rim(polygons: list[Array]) -> list[Array]:
    """The edges of cut polygons that lie in the plane x = 0."""
    on = [one[one[:, 0] == 0.0] for one in polygons if np.count_nonzero(one[:, 0] == 0.0) == 2]
    return list(on)


def _outline(faces: Array, near: Array) -> Array:
    """Node numbers (K, 2) of the edges between the near and the far side."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    known, place = np.unique(edges, axis=0, return_inverse=True)
    return known[np.bincount(place.ravel(), np.repeat(near, 3)) == 1]


def _polygons(polygons: list[Array], c: Array, sight: Array, opacity: float, zorder: int) -> Any:
    """Polygons (K, 3) on the page, colored by c, farthest first."""
    from matplotlib.collections import PolyCollection

    seen = [one @ sight.T for one in polygons]
    order = np.argsort([one[:, 2].mean() for one in seen], kind="stable")
    return PolyCollection(
        [seen[k][:, :2] for k in order],
        array=c[order],
        cmap=COLOR_MAP,
        alpha=opacity,
        edgecolors="face" if opacity == 1.0 else "none",  # closes the seams
        lw=0.15,
        zorder=zorder,
    )


def _draw_lines(axes: Any, lines: Any, sight: Array, color: str, zorder: int) -> None:
    """Straight lines (K, 2, 3) on the page."""
    from matplotlib.collections import LineCollection

    flat = [(np.asarray(line) @ sight.T)[:, :2] for line in lines]
    axes.add_collection(LineCollection(flat, color=color, lw=0.6, zorder=zorder, capstyle="round"))


def _parts(n: int) -> list[tuple[tuple[int, int], ...]]:
    """The n^2 smaller triangles of one, by their corners in steps along two of its edges."""
    upright = [((i, j), (i + 1, j), (i, j + 1)) for i in range(n) for j in range(n - i)]
    turned = [
        ((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i in range(n - 1) for j in range(n - 1 - i)
    ]
    return [*upright, *turned]


def _flow_arrows(axes: Any, at: Array, by: Array, zorder: int) -> None:
    """Arrows of the flow, with a pale edge that shows them on dark and on light colors."""
    sections.draw_arrows(
        axes, at[:, :2], by[:, :2], INK, width=0.011, zorder=zorder, edgecolor="white", lw=0.35
    )


def _annotate(axes: Any, cell: Table, sight: Array, R0: float, moves: bool) -> None:
    """Direction of migration, the length of the arrows, and a scale bar."""
    if moves:
        rear = sight[:2, 2]
        start = -1.08 * R0 * rear
        sections.draw_arrows(axes, start[None], -0.5 * R0 * rear[None], ORANGE, width=0.03)
        end = -1.62 * R0 * rear
        axes.text(*end, r"$v_\mathrm{mig}$", color=INK, ha="right", va="center")
        key = np.array([[-1.95 * R0, -1.0 * R0]])
        sections.draw_arrows(axes, key, np.array([[ARROW * R0, 0.0]]), INK, width=0.011)
        speed = sections.amount(
            float(cell["max_retrograde_speed"][0]), cell.unit("max_retrograde_speed")
        )
        axes.annotate(
            f"flow {speed}", key[0], xytext=(0.0, -2.5), textcoords="offset points", va="top",
            fontsize=7.0,
        )  # fmt: skip
    sections.draw_scale_bar(axes, (1.7 * R0, -1.0 * R0), 0.5 * R0, cell.unit("R0"))
    sections.to_scale(axes, (-2.0 * R0, -1.25 * R0), (1.7 * R0, 1.12 * R0))


FIGURE = Figure(
    name="fig3d",
    title="polarized cell in 3D",
    source="figure 3D",
    parameters=Parameters(D=0.4, v_p0=6.0),
    compute=compute,
    draw=draw,
    size=(COLUMN, 2.75),
)
