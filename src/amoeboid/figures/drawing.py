"""What several figures draw."""

from __future__ import annotations

from typing import Any

from amoeboid.figures.computed import FOLD, pieces
from amoeboid.figures.tables import Table, label
from amoeboid.plotting.palette import INK, STABLE, UNSTABLE

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


def draw_branch(axes: Any, table: Table, x: str = "v_p0", y: str = "max_retrograde_speed") -> None:
    """A branch, solid where it is stable, dashed where not, its folds marked."""
    told = set()
    for rows, stable in pieces(table):
        word = f"axisymmetric, {'stable' if stable else 'unstable'}"
        axes.plot(
            table[x][rows],
            table[y][rows],
            color=STABLE if stable else UNSTABLE,
            ls="-" if stable else "--",
            label=None if word in told else word,
        )
        told.add(word)
    fold = table["kind"] == FOLD
    if fold.any():
        axes.plot(table[x][fold], table[y][fold], "s", color=INK, ms=3.5, label="fold", zorder=4)


def mark_threshold(axes: Any, value: float) -> None:
    """The threshold v_p^c of the sphere, on the line of no flow."""
    axes.plot(value, 0.0, "o", color=INK, ms=4, label="threshold $v_p^c$", zorder=5, clip_on=False)
