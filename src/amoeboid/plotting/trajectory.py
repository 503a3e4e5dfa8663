"""The way of a cell with all drag on its cortex, in the plane that holds most of it and across."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.plotting.figures import new_figure, own_settings, write_figure
from amoeboid.plotting.palette import COLOR_MAP, GRAY, INK

MIN_WAY = 1.0  # in units of R0: a cell that has come less far has not moved


@own_settings()
def save_trajectory_picture(path: Path, times: ArrayLike, positions: ArrayLike, R0: float) -> bool:
    """Draw positions (T, 3) at `times` (T,) to a PNG file; False, and no file, if it has not moved.

    Positions are those of `State.position`: drag on the cortex alone. Axes: the principal axes of
    the way, the longest first; the unit is R0.
    """
    t, x = np.asarray(times, dtype=float), np.asarray(positions, dtype=float) / R0
    if np.linalg.norm(x - x[0], axis=1).max() < MIN_WAY:
        return False
    way = along_principal_axes(x)
    # every run draws this: matplotlib takes as long to find places as to draw
    figure = new_figure(9.6, 4.6, layout=None)
    figure.subplots_adjust(left=0.1, right=0.87, bottom=0.12, top=0.85, wspace=0.32)
    first = figure.add_subplot(1, 2, 1)
    second = figure.add_subplot(1, 2, 2, sharex=first)
    shown = None
    for axes, k, title in ((first, 1, "in its main plane"), (second, 2, "across that plane")):
        axes.plot(way[:, 0], way[:, k], color=GRAY, linewidth=0.8)
        shown = axes.scatter(way[:, 0], way[:, k], c=t, s=7, cmap=COLOR_MAP, zorder=3)
        axes.plot(*way[0, [0, k]], "o", color=INK, markersize=6, zorder=4)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_title(title, fontsize=10, color=INK)
        axes.set_xlabel("first principal axis [R\N{SUBSCRIPT ZERO}]")
        axes.set_ylabel(f"{'second' if k == 1 else 'third'} principal axis [R\N{SUBSCRIPT ZERO}]")
    if shown is not None:
        beside = figure.add_axes((0.9, 0.12, 0.018, 0.73))
        figure.colorbar(shown, cax=beside, label="time t [T] (dot: start)")
    figure.suptitle(
        "way of the cell if all drag is on its cortex, uniformly", fontsize=11, color=INK
    )
    write_figure(figure, path, dpi=110)
    return True


def along_principal_axes(x: Array) -> Array:
    """Coordinates (T, 3) of positions x (T, 3) along the axes of their spread, from the first."""
    _, _, axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)
    # signs that do not depend on the linear algebra library: the way ends on the positive side
    along = (x - x[0]) @ axes.T
    return np.asarray(along * np.where(along[-1] < 0, -1.0, 1.0))
