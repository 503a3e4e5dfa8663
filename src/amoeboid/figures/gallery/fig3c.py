"""Figure 3C: where the bifurcation is subcritical, and how wide the bistable region is."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.phase_diagram import phase_column
from amoeboid.closed_forms.dimensionless import dimensionless, viscosity_ratio
from amoeboid.closed_forms.phase_boundary import phase_boundary
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import COLOR_MAP, GREEN, INK, ORANGE, PALE, PURPLE
from amoeboid.studies.columns import percent

RATIOS = (0.5, 1.0, 2.0)  # the paper's eta_s/eta_b
STYLES = ((ORANGE, "--"), (INK, "-"), (PURPLE, ":"))
C0 = np.arange(1.25, 4.26, 0.25)  # c0/c_r of the grid
D_BAR = np.arange(0.05, 0.76, 0.1)  # D/(R0^2 beta)
SPACING = (0.25, 0.1)
LINE = np.linspace(1.125, 4.375, 66)
MARKED = {"3A": (3.0, 0.03), "3B": (3.0, 0.4)}
CELL = "cell"
SAME = 1e-6


def at(p: Parameters, c0: float, D: float) -> Parameters:
    """The cell at a point of the plane of the paper, c0/c_r and D/(R0^2 beta)."""
    return p.replace(c0=c0 * p.c_r, D=D * p.R0**2 * p.beta)


def bistable(p: Parameters) -> dict[str, Any]:
    """Threshold and lowest fold below it [L/T], None where there is none, and what stopped it."""
    threshold = onset_speed(p)
    if threshold is None:
        return {"threshold": None, "fold": None, "problem": "no threshold"}
    column = phase_column(p, 0.0, np.array([0.5, 1.0]) * threshold)
    below = [f.parameter for f in column.folds if f.parameter < threshold]
    return {
        "threshold": threshold,
        "fold": min(below, default=None),
        "problem": column.problem,
    }


def boundary(p: Parameters, ratio: float, finite: bool) -> dict[str, Any]:
    """The line nu = 0 in the plane, at eta_s/eta_b = `ratio`, at delta_P of p or at infinity."""
    cell = p.replace(eta_b=p.eta_s / ratio)
    line = phase_boundary(cell if finite else infinite_pressure(cell), LINE * p.c_r)
    return {"c0": (line.c0 / p.c_r).tolist(), "D": (line.D / (p.R0**2 * p.beta)).tolist()}


def compute(p: Parameters, results: Results) -> FigureData:
    """The lines nu = 0, and fold and threshold on a grid of the plane and at the marked points."""
    own = dimensionless(p)
    marked = dict(MARKED)
    here = (float(own.c0), float(own.D))
    if not any(np.allclose(here, place, rtol=SAME) for place in MARKED.values()):
        marked[CELL] = here
    grid = [(float(c0), float(D)) for c0 in C0.round(6) for D in D_BAR.round(6)]
    rows = [
        results.of(bistable, at(p, *place), task=f"folds: {k} of {len(grid)}")
        for k, place in enumerate(grid, 1)
    ]
    there = [results.of(bistable, at(p, *place), task="marked points") for place in marked.values()]
    points = _widths(p, list(marked.values()), there, "threshold and fold at the marked points")
    return FigureData(
        parameters=p,
        tables={
            "lines": _lines(p, results),
            "grid": _widths(p, grid, rows, "threshold and fold on a grid of the plane"),
            "points": Table(points.about, {"point": column_of(p, list(marked)), **points.columns}),
        },
        notes=tuple(
            f"{name} (c0/c_r = {c0:.6g}, D/(R0^2 beta) = {D:.6g}): {_told(found)}"
            for (name, (c0, D)), found in zip(marked.items(), there, strict=True)
        ),
        problems=_problems([*grid, *marked.values()], [*rows, *there]),
    )


def _lines(p: Parameters, results: Results) -> Table:
    columns: dict[str, list[Any]] = {"viscosity_ratio": [], "pressure": [], "c0": [], "D": []}
    lines = [(ratio, False) for ratio in RATIOS]
    if p.eta_b > 0:
        lines.append((float(viscosity_ratio(p)), True))
    for ratio, finite in lines:
        line = results.of(boundary, p, ratio, finite, task="nu = 0")
        columns["viscosity_ratio"] += [ratio] * len(line["c0"])
        columns["pressure"] += ["delta_P" if finite else "infinite"] * len(line["c0"])
        columns["c0"] += line["c0"]
        columns["D"] += line["D"]
    return Table(
        "the lines nu = 0; c0 in units of c_r, D in units of R0^2 beta",
        {name: column_of(p, values) for name, values in columns.items()},
    )


def _widths(p: Parameters, places: list[tuple[float, float]], rows: list[Any], about: str) -> Table:
    """Threshold, fold, and their distance as a share of the threshold: 0 without a fold."""
    speeds = {key: _numbers(rows, key) for key in ("threshold", "fold")}
    resolved = np.array([not row["problem"] for row in rows])
    width = np.where(np.isnan(speeds["fold"]), 0.0, 1.0 - speeds["fold"] / speeds["threshold"])
    columns = {
        "c0": column_of(p, [c0 for c0, _ in places]),
        "D": column_of(p, [D for _, D in places]),
        **{key: column_of(p, values, "L/T") for key, values in speeds.items()},
        "width": column_of(p, np.where(resolved, width, np.nan)),
        "resolved": column_of(p, resolved),
    }
    return Table(
        f"{about}; c0 in units of c_r, D in units of R0^2 beta; width = 1 - fold/threshold", columns
    )


def _numbers(rows: list[Any], key: str) -> Array:
    return np.array([np.nan if row[key] is None else row[key] for row in rows], dtype=float)


def _told(found: dict[str, Any]) -> str:
    if found["problem"]:
        return f"not resolved, {found['problem']}"
    if found["fold"] is None:
        return "no bistable region"
    return f"fold {percent(1 - found['fold'] / found['threshold'])} below the threshold"


def _problems(places: list[tuple[float, float]], rows: list[Any]) -> tuple[str, ...]:
    return tuple(
        f"c0/c_r = {c0:.6g}, D/(R0^2 beta) = {D:.6g}: {row['problem']}"
        for (c0, D), row in zip(places, rows, strict=True)
        if row["problem"]
    )


def draw(data: FigureData, axes: Any) -> None:
    """The plane of the paper, the width of the bistable region as color."""
    _draw_widths(data["grid"], axes)
    lines = data["lines"]
    for ratio, (color, style) in zip(RATIOS, STYLES, strict=True):
        rows = (lines["viscosity_ratio"] == ratio) & (lines["pressure"] == "infinite")
        name = rf"$ν = 0$, $η_s/η_b = {ratio:g}$"
        axes.plot(lines["c0"][rows], lines["D"][rows], style, color=color, label=name)
    rows = lines["pressure"] == "delta_P"
    if rows.any():
        name = r"$ν = 0$ at $ΔP$ of the cell"
        axes.plot(lines["c0"][rows], lines["D"][rows], "-.", color=GREEN, lw=1.0, label=name)
    points = data["points"]
    for name, c0, D in zip(points["point"], points["c0"], points["D"], strict=True):
        axes.plot(c0, D, "o", color=INK, ms=4, mec="w", mew=0.6, zorder=5, clip_on=False)
        axes.annotate(name, (c0, D), (4, 3), textcoords="offset points", fontsize=7, zorder=5)
    axes.set_xlim(C0[0] - SPACING[0] / 2, C0[-1] + SPACING[0] / 2)
    axes.set_ylim(0.0, D_BAR[-1] + SPACING[1] / 2)
    axes.set_xlabel("concentration $c_0/c_r$")
    axes.set_ylabel("diffusion $D/(R_0^2 β)$")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, columnspacing=1.0)


def _draw_widths(grid: Table, axes: Any) -> None:
    """One cell of color a point of the grid; white without a fold, crossed where unresolved."""
    shape = (len(C0), len(D_BAR))
    width = 100 * np.reshape(grid["width"], shape)
    shown = np.ma.masked_where(~(width > 0), width)
    mesh = axes.pcolormesh(C0, D_BAR, shown.T, cmap=COLOR_MAP, vmin=0.0, shading="nearest")
    axes.figure.colorbar(mesh, ax=axes, label="bistable below threshold [%]", pad=0.02)
    for k, m, side in ((0, 1, "left"), (-1, -1, "right")):  # what lies at two sides
        if np.isfinite(width[k, m]):
            kind = "subcritical" if width[k, m] > 0 else "supercritical"
            color = "w" if width[k, m] > np.nanmax(width) / 2 else INK
            axes.text(C0[k], D_BAR[m], kind, fontsize=7, ha=side, color=color)
    for c0, D in zip(*(grid[key][~grid["resolved"]] for key in ("c0", "D")), strict=True):
        low = (c0 - SPACING[0] / 2, D - SPACING[1] / 2)
        axes.add_patch(_crossed(low))


def _crossed(low: tuple[float, float]) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle(low, *SPACING, facecolor="w", edgecolor=PALE, hatch="xxxx", lw=0.0)


FIGURE = Figure(
    name="fig3c",
    title="type of bifurcation, width of bistable region",
    source="figure 3C",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(3.4, 3.0),
    varies=frozenset({"v_p0"}),
)
