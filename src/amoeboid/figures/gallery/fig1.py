"""Figure 1: the mechanism, drawn from computed fields.

A and B follow monomers from the membrane inwards through a cortex of finite thickness, with the
exact flow and stress of `closed_forms.thick_cortex`; the flat cortex is one of FLAT times the
radius. C and D show the mode l = 1 of the thin shell. The paper's D, an elongated cell between two
plates, is not drawn: the model has no walls, and nothing else in it elongates a cell. What D says,
that the tangential flow in the frame of the cell is a normal flow in that of the laboratory, holds
for the sphere as well, and D shows it there.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.active_stress import active_stress
from amoeboid.closed_forms.flow import sphere_velocities
from amoeboid.closed_forms.linear import driving_slope
from amoeboid.closed_forms.points import points
from amoeboid.closed_forms.thick_cortex import (
    Cortex,
    sphere_stresses,
    sphere_surface_stresses,
    sphere_velocity,
    thin_sphere_error,
)
from amoeboid.figures import sections
from amoeboid.figures.drawing import SYMBOLS
from amoeboid.figures.figure import Figure
from amoeboid.figures.gallery.fig2b import SHIFT, amplitude
from amoeboid.figures.results import Results
from amoeboid.figures.style import COLUMN
from amoeboid.figures.tables import FigureData, Table, column_of, label
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, COLOR_MAP, GRAY, GREEN, INK, ORANGE, SKY, YELLOW
from amoeboid.studies.columns import Column, text

FLAT = 1e4  # radius of the flat cortex [R0]
THICK = 0.3  # of the cortex that is drawn [R0]; that of a cell is about 0.02 R0
FILAMENTS = np.radians([-28.0, -14.0, 0.0, 14.0, 28.0])  # angles on the cell of radius R0
MONOMERS = 6  # of a filament; v_p adds one in THICK R0/(v_p MONOMERS)
CELL = 16  # points around the cross-section of the cell
OUTLINE = 121  # points of its outline

MAX_RATIO = 2.0
"""eta_b/eta_s of a thin layer of an incompressible fluid, lambda -> infinity; others are below."""
INCOMPRESSIBLE = 1e-9  # how close to it counts as the same


def cortex(p: Parameters, radius: float) -> Cortex | None:
    """A cortex with the viscosities of the shell [those of p]; SI `eq2DViscosities3D` solved.

    None where no isotropic fluid has them.
    """
    ratio = p.eta_b / p.eta_s
    if ratio > MAX_RATIO:
        return None
    h = THICK * p.R0
    mu = p.eta_s / h
    lam = 2.0 * mu * ratio / max(MAX_RATIO - ratio, INCOMPRESSIBLE)
    return Cortex(R0=radius, h=h, lambda_3d=lam, mu_3d=mu, v_p=float(p.v_p(p.c0)))


def monomers(found: Cortex) -> tuple[Array, Array, Array]:
    """Depth below the membrane, speed inwards and tangential stress of monomers of a filament.

    They were added at equal intervals of time, and have moved with the cortex since.
    """
    R0, h, v_p = (float(getattr(found, name)) for name in ("R0", "h", "v_p"))
    r = R0 - np.linspace(0.0, h, 2001)
    slowness = -1.0 / sphere_velocity(found, r)
    age = np.concatenate([[0.0], np.cumsum((slowness[1:] + slowness[:-1]) / 2.0)]) * (r[0] - r[1])
    ages = np.arange(MONOMERS + 1) * (h / (v_p * MONOMERS))
    at = np.interp(ages[ages <= age[-1] * (1 + 1e-9)], age, r)
    return R0 - at, -sphere_velocity(found, at), sphere_stresses(found, at).hoop


def filaments(p: Parameters) -> Table:
    """Monomers of both cortices, place and velocity in the plane, membrane at y = 0."""
    rows: dict[str, list[Array]] = {k: [] for k in ("flat", "n", "x", "y", "v_x", "v_y", "stress")}
    for flat, radius in ((True, FLAT * p.R0), (False, p.R0)):
        found = cortex(p, radius)
        if found is None:
            continue
        depth, speed, stress = monomers(found)
        for number, angle in enumerate(FILAMENTS * p.R0 / radius):
            values = {
                "flat": np.full(depth.size, flat),
                "n": np.full(depth.size, number),
                "x": (radius - depth) * np.sin(angle),
                # radius (cos - 1) without the rounding of a large radius
                "y": -2.0 * radius * np.sin(0.5 * angle) ** 2 - depth * np.cos(angle),
                "v_x": -speed * np.sin(angle),
                "v_y": -speed * np.cos(angle),
                "stress": stress,
            }
            for key, value in values.items():
                rows[key].append(value)
    joined = {key: np.concatenate([np.empty(0), *found]) for key, found in rows.items()}
    dimensions = {"x": "L", "y": "L", "v_x": "L/T", "v_y": "L/T", "stress": "M/(L T^2)"}
    columns = {
        key: column_of(p, value.astype(bool if key == "flat" else float), dimensions.get(key))
        for key, value in joined.items()
    }
    return Table("monomers of filaments in a thick cortex, flat (A) or of radius R0 (B)", columns)


def cell_table(p: Parameters, count: int) -> Table:
    """The cell with c = c0 + dc_1 cos(theta), to first order: C in its frame, D in both."""
    a = amplitude(p)
    theta = np.arange(count) * (2.0 * np.pi / count)
    e_r = np.column_stack([np.cos(theta), np.sin(theta)])
    e_theta = np.column_stack([-np.sin(theta), np.cos(theta)])
    found = sphere_velocities(p, a, theta)
    v_p = float(p.v_p(p.c0)) + found.v_p[:, 0]
    normals = np.column_stack([e_r, np.zeros(count)])
    curvature = (np.eye(3) - normals[:, :, None] * normals[:, None, :]) / p.R0
    stress = active_stress(curvature, normals, v_p, p.eta_s, p.eta_b)
    along = np.column_stack([e_theta, np.zeros(count)])
    tangential = np.einsum("pi,pij,pj->p", along, stress, along)
    flow = found.v[:, 1:] * e_theta + found.v[:, :1] * e_r
    laboratory = flow + np.array([float(found.migration), 0.0])
    columns = {"theta": Column(theta, "rad")}
    columns |= {k: column_of(p, p.R0 * e_r[:, i], "L") for i, k in enumerate("zx")}
    columns["c"] = column_of(p, p.c0 + a * np.cos(theta), "N/L^2")
    columns["v_p"] = column_of(p, v_p, "L/T")
    columns["active_stress"] = column_of(p, tangential, "M/T^2")
    for name, v in (("v", flow), ("v_laboratory", laboratory)):
        columns |= {f"{name}_{k}": column_of(p, v[:, i], "L/T") for i, k in enumerate("zx")}
    return Table(
        "the cell of C and D in the plane of z, the axis, and x; c is highest at +z", columns
    )


def compute(p: Parameters, results: Results) -> FigureData:
    """Filaments in a flat and in a curved cortex, and the cell with its first mode."""
    cell = cell_table(p, CELL)
    size = {"R0": column_of(p, [p.R0], "L"), "v_p": column_of(p, [float(p.v_p(p.c0))], "L/T")}
    tables = {
        "filaments": filaments(p),
        "cell": cell,
        "outline": cell_table(p, OUTLINE - 1),
        "sizes": Table("radius of the cell, polymerization speed at c0", size),
    }
    notes, problems = [], []
    curved, flat = cortex(p, p.R0), cortex(p, FLAT * p.R0)
    if curved is None or flat is None:
        problems.append(
            "A and B: a cortex made of an isotropic fluid has eta_b <= 2 eta_s, "
            f"got eta_b/eta_s = {p.eta_b / p.eta_s:.6g}"
        )
    else:
        hoop, none = (float(sphere_surface_stresses(found).hoop) for found in (curved, flat))
        notes += [
            f"B: tangential stress of the cortex, {text(p, hoop, 'M/T^2')}; the drawn thickness is "
            f"{THICK:g} R0, where the thin shell has a stress that differs by "
            f"{100 * float(thin_sphere_error(curved)):.3g} %",
            f"A: tangential stress of the flat cortex, {text(p, none, 'M/T^2')} (its radius is "
            f"{FLAT:g} R0)",
        ]
    notes += [
        f"C and D: c = c0 + dc_1 cos(theta), dc_1 = {text(p, amplitude(p), 'N/L^2')}, to first "
        "order",
        "D: the round cell; the paper's D shows an elongated one between plates, which the model "
        "does not have",
        *_about_laboratory(p),
    ]
    return FigureData(p, tables, tuple(notes), tuple(problems))


def _about_laboratory(p: Parameters) -> list[str]:
    """What to say of D where alpha or a stress drives the flow, too."""
    at = points(p)
    polymerization, all_of_it = float(at.v_p_derivatives(p.c0, 1)[1]), float(driving_slope(at))
    if np.isclose(polymerization, all_of_it, rtol=1e-9, atol=0.0):
        return []
    return [
        "migration: of a membrane that moves with v_p, as in the paper; alpha or the stress drives "
        f"{all_of_it / polymerization:.4g} times the flow of polymerization alone, so that the "
        "flow of D is not normal in the laboratory",
    ]


def draw(data: FigureData, axes: Any) -> None:
    """Four panels: flat and curved cortex, the cell, and the cell in two frames."""
    R0, v_p = (float(data["sizes"][name][0]) for name in ("R0", "v_p"))
    filament = data["filaments"]
    largest = np.abs(filament["stress"]).max(initial=0.0)
    for ax, flat in zip(axes[:2], (True, False), strict=True):
        _draw_cortex(ax, filament, flat, R0, v_p, largest)
    _draw_cell(axes[2], data, R0, v_p)
    _draw_frames(axes[3], data, R0)
    titles = ("flat: no stress", "curved: stress", "flow of the cell", "in two frames")
    for ax, letter, title in zip(axes, "ABCD", titles, strict=True):
        ax.set_title(rf"$\bf{{{letter}}}$ {title}", loc="left", pad=3.0, fontsize=7.5)


def _draw_cortex(
    axes: Any, table: Table, flat: bool, R0: float, v_p: float, largest: float
) -> None:
    """Membrane, filaments with their monomers, velocities, and the stress between filaments."""
    angle = np.linspace(-0.62, 0.62, 61)
    x = angle if flat else np.sin(angle)
    y = np.zeros_like(angle) if flat else np.cos(angle) - 1.0
    axes.plot(R0 * x, R0 * y, color=SKY, lw=3.0, zorder=1)
    chosen = table["flat"] == flat
    at = sections.points(table, "x", "y")
    velocity = sections.points(table, "v_x", "v_y")
    threads = [np.flatnonzero(chosen & (table["n"] == n)) for n in range(len(FILAMENTS))]
    for rows in threads:
        axes.plot(*at[rows].T, color=GREEN, lw=0.8, alpha=0.6, zorder=2)
        axes.plot(*at[rows[1:]].T, "o", color=GREEN, ms=3.0, alpha=0.55, mew=0.0, zorder=2)
        axes.plot(*at[rows[:1]].T, "o", color=GREEN, ms=3.6, mew=0.0, zorder=3)
    ends = np.array([rows[-1] for rows in threads if rows.size], dtype=int)
    way = 0.14 * R0 / v_p
    sections.draw_arrows(axes, at[ends], way * velocity[ends], ORANGE)
    for left, right in pairwise(threads):
        count = min(left.size, right.size)
        between, gap = 0.5 * (at[left] + at[right]), at[right] - at[left]
        share = np.abs(table["stress"][left]) / largest
        for k in range(1, count, 2):
            push = 0.33 * share[k] * gap[k : k + 1]
            if share[k] > 1e-2:
                for sign in (-1.0, 1.0):
                    sections.draw_arrows(axes, between[k : k + 1], sign * push, BLUE, width=0.01)
    sections.to_scale(axes, (-0.64 * R0, -0.66 * R0), (0.64 * R0, 0.06 * R0))


def _draw_cell(axes: Any, data: FigureData, R0: float, v_p: float) -> None:
    """The cross-section: c, filament velocity, stress, flow and migration."""
    from matplotlib.collections import LineCollection

    outline, cell = data["outline"], data["cell"]
    around = sections.points(outline, "z", "x")
    pieces = np.stack([around, np.roll(around, -1, axis=0)], axis=1)
    c = 0.5 * (outline["c"] + np.roll(outline["c"], -1))
    shown = LineCollection(list(pieces), array=c, cmap=COLOR_MAP, lw=3.5, capstyle="round")
    axes.add_collection(shown)
    bar = axes.figure.colorbar(shown, ax=axes, location="bottom", shrink=0.85, pad=0.02, aspect=22)
    bar.set_label(label(SYMBOLS["c"], outline.unit("c")), fontsize=7.0)
    bar.outline.set_visible(False)
    at = sections.points(cell, "z", "x")
    normal = at / R0
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    grown = (0.28 * R0 / v_p) * cell["v_p"]
    sections.draw_arrows(axes, 0.95 * at, -grown[:, None] * normal, ORANGE)
    stress = np.abs(cell["active_stress"])
    push = 0.19 * R0 * stress / stress.max()
    for sign in (-1.0, 1.0):
        sections.draw_arrows(axes, 1.13 * at, sign * push[:, None] * tangent, BLUE, width=0.01)
    flow = sections.points(cell, "v_z", "v_x")
    fastest = np.hypot(*flow.T).max()
    flow[np.hypot(*flow.T) < 1e-9 * fastest] = 0.0
    sections.draw_arrows(axes, 1.3 * at, (0.4 * R0 / fastest) * flow, YELLOW, width=0.016)
    migration = float(cell["v_laboratory_z"][0] - cell["v_z"][0])
    way = np.array([[np.copysign(0.6 * R0, migration), 0.0]])
    sections.draw_arrows(axes, -0.5 * way, way, INK, width=0.02)
    sections.to_scale(axes, (-1.42 * R0, -1.4 * R0), (1.42 * R0, 1.4 * R0))


def _draw_frames(axes: Any, data: FigureData, R0: float) -> None:
    """The velocity of the filament ends, above in the frame of the cell, below in the other."""
    cell = data["cell"]
    at = sections.points(cell, "z", "x")
    fastest = np.hypot(*sections.points(cell, "v_z", "v_x").T).max()
    for name, height, word in (("v", 1.25, "cell"), ("v_laboratory", -1.25, "lab")):
        center = np.array([0.0, height * R0])
        velocity = sections.points(cell, f"{name}_z", f"{name}_x")
        velocity[np.hypot(*velocity.T) < 1e-9 * fastest] = 0.0
        sections.draw_circle(axes, tuple(center), R0, color=GRAY, lw=1.0)
        axes.plot(*(at + center).T, "o", color=INK, ms=1.8, zorder=5)
        sections.draw_arrows(axes, at + center, (1.6 * SHIFT * R0 / fastest) * velocity, YELLOW)
        place = (-0.2 * R0, height * R0)
        axes.text(*place, f"{word}\nframe", ha="center", va="center", fontsize=6.0)
    for color, name in (
        (ORANGE, "filament velocity"),
        (BLUE, "cortex stress"),
        (YELLOW, "velocity of ends $v$"),
        (INK, "migration"),
    ):
        axes.plot([], [], color=color, lw=2.0, label=name)
    axes.legend(
        loc="lower center",
        handlelength=1.0,
        labelspacing=0.15,
        borderpad=0.0,
    )
    sections.to_scale(axes, (-1.6 * R0, -4.3 * R0), (1.6 * R0, 2.35 * R0))


FIGURE = Figure(
    name="fig1",
    title="mechanism: treadmilling, stress and flow",
    source="figure 1",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(COLUMN, 3.4),
    panels=(2, 2),
    layout={"gridspec_kw": {"height_ratios": (1.0, 2.4)}},
)
