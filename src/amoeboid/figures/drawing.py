"""What several figures draw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from amoeboid.figures.computed import ERRORS, FOLD, pieces
from amoeboid.figures.tables import Table, label
from amoeboid.plotting.palette import GRAY, GREEN, INK, PALE, PURPLE, STABLE, UNSTABLE

SYMBOLS = {
    "v_p0": "polymerization speed $v_p^0$",
    "max_retrograde_speed": "retrograde flow $v_0$",
    "D": "diffusion coefficient $D$",
    "delta_P": r"pressure difference $\Delta P$",
    "c": "filament concentration $c$",
    "alpha": r"cortical stiffness $\alpha$",
}


def name_axes(axes: Any, table: Table, x: str, y: str) -> None:
    """Label the axes with what two columns are, and their units."""
    axes.set_xlabel(label(SYMBOLS.get(x, x), table.unit(x)))
    axes.set_ylabel(label(SYMBOLS.get(y, y), table.unit(y)))


def draw_branch(
    axes: Any,
    table: Table,
    x: str = "v_p0",
    y: str = "max_retrograde_speed",
    words: str = "axisymmetric",
    color: str | None = None,
) -> None:
    """A branch, solid where it is stable, dashed where not, its folds marked."""
    told = set()
    for rows, stable in pieces(table):
        name = f"{words}, {'stable' if stable else 'unstable'}"
        axes.plot(
            table[x][rows],
            table[y][rows],
            color=color or (STABLE if stable else UNSTABLE),
            ls="-" if stable else "--",
            label=None if name in told else name,
        )
        told.add(name)
    fold = table["kind"] == FOLD
    if fold.any():
        axes.plot(table[x][fold], table[y][fold], "s", color=INK, ms=3.5, label="fold", zorder=4)


def mark_threshold(axes: Any, table: Table, first: bool = True) -> None:
    """The threshold v_p^c of the sphere, on the line of no flow; named if it is the first one."""
    axes.plot(
        table["v_p0"],
        np.zeros(len(table)),
        "o",
        color=INK,
        label="threshold $v_p^c$" if first else None,
        zorder=7,
        clip_on=False,
    )


def draw_theory(axes: Any, table: Table, prefactor: str = "") -> None:
    """The weakly nonlinear theory at infinite and at the figure's pressure."""
    for key, words, style in (
        ("at_infinite_pressure", r"theory, $\Delta P \to \infty$", {"color": GRAY, "lw": 1.6}),
        ("at_delta_P", r"theory, $\Delta P$ of the cell", {"color": PURPLE, "lw": 1.2, "ls": ":"}),
    ):
        axes.plot(table["v_p0"], table[f"{key}{prefactor}"], label=words, **style)


def draw_runs(axes: Any, table: Table, words: str, marker: str = "x", color: str = INK) -> None:
    """The ends of 3D runs with the mesh error as a bar; gray where a run is not steady."""
    steady = np.asarray(table["steady"], dtype=bool)
    for rows, name, shade in ((steady, words, color), (~steady, f"{words}, not steady", GRAY)):
        if not rows.any():
            continue
        at, speed = table["v_p0"][rows], table["max_retrograde_speed"][rows]
        errors = np.nan_to_num(table[ERRORS[0]][rows])
        axes.errorbar(at, speed, errors, fmt="none", ecolor=shade, elinewidth=0.7, zorder=5)
        open_ = {} if marker in "x+" else {"markerfacecolor": "none"}
        axes.plot(
            at, speed, marker, color=shade, label=name, zorder=6, clip_on=False, mew=0.9, **open_
        )


def draw_hysteresis(axes: Any, data: Mapping[str, Table], words: str) -> None:
    """The branch, its threshold, and 3D runs from both starts; see `computed.hysteresis`."""
    draw_branch(axes, data["branch"])
    draw_runs(axes, data["runs-strong"], f"{words}, strong start", "o", GREEN)
    draw_runs(axes, data["runs-weak"], f"{words}, weak start")
    mark_threshold(axes, data["threshold"])
    name_axes(axes, data["branch"], "v_p0", "max_retrograde_speed")
    show_window(axes, data["theory"]["v_p0"])
    legend_above(axes)


def draw_threshold_line(axes: Any, table: Table) -> None:
    """The threshold as a dashed line over the whole height."""
    axes.axvline(float(table["v_p0"][0]), color=INK, lw=0.8, ls=(0, (4, 3)), zorder=1)


def show_window(axes: Any, values: Any, headroom: float = 0.05) -> None:
    """Show the window of these values, from 0 to the highest line in it, and room for a legend."""
    low, high = float(values[0]), float(values[-1])
    axes.set_xlim(low, high)
    top = 0.0
    for line in axes.lines:
        x, y = (np.asarray(part, dtype=float) for part in line.get_data())
        shown = (x >= low) & (x <= high) & np.isfinite(y) if len(x) == len(y) else np.zeros(0, bool)
        top = max([top, *y[shown]]) if shown.any() else top
    axes.set_ylim(0.0, (1 + headroom) * top if top > 0 else 1.0)


def mark_range(axes: Any, values: Any) -> None:
    """Shade the axes between two values of x."""
    axes.axvspan(float(values[0]), float(values[1]), color=PALE, alpha=0.6, lw=0, zorder=0)


def legend_above(axes: Any) -> None:
    """A legend of two columns above the axes, where no line can meet it."""
    axes.legend(loc="lower left", bbox_to_anchor=(-0.17, 1.0), ncols=2, columnspacing=1.0)
