"""Drawings of cells and their parts to scale: arrows, outlines, scale bars.

Points and arrows are arrays (n, 2) on the page, in the units of the axes.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.figures.tables import Table, drawn_unit
from amoeboid.plotting.palette import INK

ARROW = 0.012  # width of the shaft of an arrow [inches]
DIMENSION = re.compile(r"[LTMN^0-9/() ]*[LTMN][LTMN^0-9/() ]*")


def to_scale(axes: Any, low: tuple[float, float], high: tuple[float, float]) -> None:
    """Show the rectangle between two corners, both axes to the same scale and without ticks."""
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_axis_off()


def points(table: Table, x: str, y: str) -> Array:
    """Two columns as points on the page (n, 2)."""
    return np.column_stack([table[x], table[y]])


def draw_arrows(
    axes: Any, start: Array, by: Array, color: str, width: float = ARROW, **options: Any
) -> None:
    """Arrows from points by vectors, both (n, 2); no arrow where a vector is 0."""
    seen = np.hypot(*by.T) > 0.0
    if not seen.any():
        return
    axes.quiver(
        *start[seen].T,
        *by[seen].T,
        color=color,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        units="inches",
        width=width,
        **({"zorder": 4, "headwidth": 4.5, "headlength": 5.0, "headaxislength": 4.5} | options),
    )


def draw_circle(axes: Any, center: tuple[float, float], radius: float, **options: Any) -> None:
    """A circle as a line."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle), **options)


def draw_scale_bar(axes: Any, end: tuple[float, float], length: float, unit: str) -> None:
    """A bar of a length that ends on the right at a point, with the length written below."""
    x, y = end
    axes.plot([x - length, x], [y, y], color=INK, lw=2.0, solid_capstyle="butt")
    axes.annotate(
        amount(length, unit),
        (x - 0.5 * length, y),
        xytext=(0.0, -2.5),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=7.0,
    )


def amount(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit as pictures show it.

    >>> amount(10.0, "um"), amount(1.0, "R0"), amount(3.17, "1/beta"), amount(2.0, "L")
    ('10 µm', '$R_0$', '3.17/β', '2 [L]')
    >>> amount(300.0, "M/(L T^2)"), amount(0.0, "eta_s beta/R0")
    ('300 [M/(L T$^{2}$)]', '0 $η_s$ β/$R_0$')
    """
    shown, drawn = f"{value:.{digits}g}", drawn_unit(unit)
    if DIMENSION.fullmatch(unit):  # the units are those of the user
        return f"{shown} [{drawn}]"
    if unit.startswith("1/"):
        return f"{shown}{drawn[1:]}"
    return drawn if value == 1.0 and drawn.startswith("$") else f"{shown} {drawn}"
