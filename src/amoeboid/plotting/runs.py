"""Pictures of runs on axes: time series, the cell from the side, kymographs, spectra."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import axis_across
from amoeboid.observables import max_retrograde_speed, retrograde_flow
from amoeboid.plotting.cell import MIN_FLOW
from amoeboid.plotting.figures import as_drawn, axes_for, with_unit
from amoeboid.plotting.palette import BLUE, COLOR_MAP, GRAY, INK
from amoeboid.plotting.trajectory import along_principal_axes
from amoeboid.runs.analysis import POWER, Kymograph, Spectrum, axis
from amoeboid.runs.run import Run
from amoeboid.runs.snapshot import Snapshot
from amoeboid.simulation.timeseries import position_columns
from amoeboid.studies.columns import column, unit

LONGEST_ARROW = 0.42  # in units of R0: the fastest flow on a picture of a cell
MIN_GAP = 0.3  # between arrows, in units of R0
MIN_FACING = 0.2  # cosine of the angle between a normal and the view, where arrows are drawn
MIN_POWER = 1e-10  # of the largest; below it is rounding of the least squares


def draw(run: Run, ax: Any = None, observable: str = "max_retrograde_speed") -> Any:
    """A column of the time series over time; a vector as three lines."""
    axes, columns = axes_for(ax), run.columns
    names = [observable] if observable in columns else [f"{observable}_{a}" for a in "xyz"]
    run[observable]  # refuses an unknown name
    for name in names:
        axes.plot(columns["t"].values, columns[name].values, lw=1.8, label=name)
    if len(names) > 1:
        axes.legend(frameon=False)
    axes.set_xlabel(with_unit("t", columns["t"].unit))
    axes.set_ylabel(with_unit(observable, columns[names[0]].unit))
    axes.grid(alpha=0.25)
    return axes


def draw_trajectory(run: Run, ax: Any = None) -> Any:
    """The way of a cell in the environment of its run, in the plane that holds most of it."""
    axes, columns = axes_for(ax), run.columns
    names = position_columns(columns)
    way = along_principal_axes(np.stack([columns[n].values for n in names], axis=1))
    t, length = columns["t"], columns[names[0]].unit
    axes.plot(way[:, 0], way[:, 1], color=GRAY, lw=0.8)
    image = axes.scatter(way[:, 0], way[:, 1], c=t.values, s=9, cmap=COLOR_MAP, zorder=3)
    axes.plot(*way[0, :2], "o", color=INK, ms=6, zorder=4)
    axes.figure.colorbar(image, ax=axes, label=with_unit("t", t.unit))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(with_unit("first principal axis", length))
    axes.set_ylabel(with_unit("second principal axis", length))
    return axes


def draw_cell(snapshot: Snapshot, ax: Any = None) -> Any:
    """The cell from the side, front to the left: c as color, retrograde flow as arrows.

    With a bar of length R0; the longest arrow is the fastest flow. A cell at rest has no arrows.
    """
    axes, cell, p = axes_for(ax), snapshot.cell, snapshot.parameters
    rear, up = _view(snapshot)
    toward = np.cross(rear, up)
    corners = cell.x[cell.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ toward
    seen = np.flatnonzero(outward > 0.0)
    seen = seen[np.argsort(corners.mean(axis=1)[seen] @ toward, kind="stable")]
    length = column(p, np.array([1.0]), "L").values[0]
    x, y = length * (cell.x @ rear), length * (cell.x @ up)
    faces = cell.faces[seen]
    c = column(p, cell.c, "N/L^2")
    shades = axes.tripcolor(x, y, faces, c.values, shading="gouraud", cmap=COLOR_MAP)
    ends = _outline(faces)
    axes.plot(x[ends].T, y[ends].T, color=GRAY, lw=1.0, solid_capstyle="round")
    axes.figure.colorbar(shades, ax=axes, label=with_unit("c", c.unit), shrink=0.85)
    R0 = p.R0 * length
    _arrows(axes, snapshot, (rear, up, toward), R0)
    low, high = (np.array([f(x), f(y)]) for f in (np.min, np.max))
    axes.plot([low[0], low[0] + R0], [low[1] - 0.15 * R0] * 2, color=INK, lw=2)
    text = as_drawn(f"R0 = {R0:.4g} {unit(p, 'L')}") if p.units is not None else "R0"
    axes.text(low[0], low[1] - 0.2 * R0, text, va="top", fontsize=8, color=INK)
    axes.set_xlim(low[0] - 0.1 * R0, high[0] + 0.1 * R0)
    axes.set_ylim(low[1] - 0.45 * R0, high[1] + 0.1 * R0)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return axes


def _outline(faces: Any) -> Any:
    """Nodes (E, 2) at the ends of the edges that have one triangle of `faces` (F, 3) alone."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return found[count == 1]


def _arrows(axes: Any, snapshot: Snapshot, view: tuple[Any, Any, Any], R0: float) -> None:
    """Retrograde flow at some of the nodes that are seen, spread evenly over the surface."""
    cell, p = snapshot.cell, snapshot.parameters
    rear, up, toward = view
    flow = retrograde_flow(cell)
    fastest = max_retrograde_speed(cell)
    if fastest <= MIN_FLOW * cell.rate * p.R0:
        return
    facing = np.flatnonzero(cell.normals @ toward > MIN_FACING)
    nodes = facing[_spread(cell.x[facing], MIN_GAP * p.R0)]
    u = flow[nodes] / fastest
    length = R0 / p.R0
    axes.quiver(
        length * (cell.x[nodes] @ rear), length * (cell.x[nodes] @ up),
        LONGEST_ARROW * R0 * (u @ rear), LONGEST_ARROW * R0 * (u @ up),
        angles="xy", scale_units="xy", scale=1.0, color=INK, width=0.006, pivot="mid",
        minlength=0.0, zorder=5,
    )  # fmt: skip


def _spread(x: Any, gap: float) -> list[int]:
    """Points x (n, 3) of which no two are closer than `gap`, taken in their order."""
    kept: list[int] = []
    for k, point in enumerate(x):
        if all(np.linalg.norm(point - x[j]) >= gap for j in kept):
            kept.append(k)
    return kept


def _view(snapshot: Snapshot) -> tuple[Any, Any]:
    """Directions to the right, that of the rear, and upwards."""
    rear = axis(snapshot.cell, np.array([1.0, 0.0, 0.0]))
    side = axis_across(rear)
    up = side - (side @ rear) * rear
    return rear, up / np.linalg.norm(up)


def draw_kymograph(found: Kymograph, ax: Any = None) -> Any:
    """c as color over time and the angle from the rear."""
    axes, p = axes_for(ax), found.parameters
    t, c = column(p, found.times, "T"), column(p, found.values, "N/L^2")
    degrees = np.degrees(found.theta)
    if len(t.values) > 1:
        image = axes.pcolormesh(t.values, degrees, c.values.T, cmap=COLOR_MAP, shading="nearest")
        axes.figure.colorbar(image, ax=axes, label=with_unit("c", c.unit))
        axes.set_xlabel(with_unit("t", t.unit))
        axes.set_ylabel("angle from the rear [degrees]")
    else:
        axes.plot(degrees, c.values[0], color=BLUE)
        axes.set_xlabel("angle from the rear [degrees]")
        axes.set_ylabel(with_unit("c", c.unit))
    return axes


def draw_spectrum(found: Spectrum, ax: Any = None) -> Any:
    """Power of each degree over time, from l = 1 on."""
    axes, p = axes_for(ax), found.parameters
    t, power = column(p, found.times, "T"), column(p, found.values, POWER[found.field])
    floor = MIN_POWER * power.values.max()
    for l in found.l[1:]:  # noqa: E741
        axes.plot(t.values, np.maximum(power.values[:, l], floor), "o-", ms=3, label=f"l = {l}")
    axes.set_yscale("log")
    axes.set_xlabel(with_unit("t", t.unit))
    axes.set_ylabel(with_unit(f"power of {found.field}", power.unit))
    axes.legend(frameon=False, fontsize=8)
    axes.grid(alpha=0.25)
    return axes
