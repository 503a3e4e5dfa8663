"""The way of a cell, seen onto its main plane and along it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.output.atomic import write_atomically
from amoeboid.plotting.canvas import ROUND, Canvas, round_length, shade
from amoeboid.plotting.palette import GRAY, INK

MIN_WAY = 1.0  # in units of R0: a cell that has come less far has not moved
MAX_DOTS = 2000
WINDOW = (1500, 1000)
FONT_SIZE = 22
WIDTH, HEIGHT, GAP = 2.7, 0.9, 0.3  # of the two views and between them; the picture is 3 by 2
DOT = 0.012


def save_trajectory_picture(
    path: Path,
    times: ArrayLike,
    positions: ArrayLike,
    R0: float,
    units: tuple[str, str] = ("", ""),
    environment: str = "",
) -> bool:
    """Draw positions (T, 3) at `times` (T,) to a PNG file; False, and no file, if it has not moved.

    `environment` says what resists the cell; empty: positions are those of `State.position`, with
    drag on the cortex alone. The view is along the
    principal axes of the way, the longest to the right; the bar is so many R0 long. `units` are
    those of length and time, empty for plain numbers.
    """
    t, x = np.asarray(times, dtype=float), np.asarray(positions, dtype=float) / R0
    if np.linalg.norm(x - x[0], axis=1).max() < MIN_WAY:
        return False
    kept = np.unique(np.linspace(0, len(t) - 1, min(len(t), MAX_DOTS)).round().astype(int))
    canvas = _drawn(t[kept], along_principal_axes(x)[kept], environment, R0, units)
    write_atomically(path, canvas.save)
    return True


def along_principal_axes(x: Array) -> Array:
    """Coordinates (T, 3) of positions x (T, 3) along the axes of their spread, from the first."""
    _, _, axes = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)
    # signs that do not depend on the linear algebra library: the way ends on the positive side
    along = (x - x[0]) @ axes.T
    return np.asarray(along * np.where(along[-1] < 0, -1.0, 1.0))


def _drawn(t: Array, way: Array, environment: str, R0: float, units: tuple[str, str]) -> Canvas:
    """Two views of a way, (T, 3) in units of R0 along its principal axes.

    `units` are those of length and time, empty for plain numbers.
    """
    canvas = Canvas(*WINDOW, (*np.eye(3),), np.zeros(3), 1.0)
    low, extent = way.min(axis=0), np.ptp(way, axis=0)
    scale = float(min(WIDTH / extent[0], HEIGHT / max(extent[1] + extent[2], 1e-9)))
    middle = 0.12
    top = middle + 0.5 * (scale * (extent[1] + extent[2]) + GAP)
    left = -0.5 * scale * extent[0]
    for k, title in ((1, "seen onto its main plane"), (2, "seen along its main plane")):
        top -= scale * extent[k]
        across, along = top + scale * (way[:, k] - low[k]), left + scale * (way[:, 0] - low[0])
        _add_way(canvas, np.column_stack([along, across, np.zeros(len(t))]), t)
        place = np.array([left, top + scale * extent[k] + 0.07, 0.0])
        canvas.text(canvas.place(place), title, GRAY, FONT_SIZE, "lm")
        top -= GAP
    where = f"in: {environment}" if environment else "if all drag is on its cortex, uniformly"
    title = f"trajectory of the cell {where}"
    canvas.text(canvas.share(0.5, 0.05), title, INK, 1.15 * FONT_SIZE)
    length = round_length(0.25 * float(max(extent[0], 1.0)))
    size = f" ({length * R0:.3g} {units[0]})" if units[0] else ""
    _add_scale(canvas, scale, length, f"{length:g} R0{size}")
    label = f"time t [{units[1] or 'T'}] (dark dot: start)"
    canvas.color_bar(float(t[0]), float(t[-1]), label, FONT_SIZE)
    return canvas


def _add_way(canvas: Canvas, points: Array, t: Array) -> None:
    """A line, a dot for every point in the color of its time, and one where it starts."""
    for here, there in pairwise(points):
        canvas.line(here, there, 0.15 * DOT, GRAY)
    disk = np.column_stack([np.cos(ROUND), np.sin(ROUND), np.zeros(len(ROUND))])
    shares = (t - t[0]) / max(float(np.ptp(t)), np.finfo(float).tiny)
    for k, (place, share) in enumerate(zip(points, shares, strict=True), start=1):
        above = np.array([0.0, 0.0, k / len(points)])
        canvas.solid(place + above + DOT * disk, shade(share))
    canvas.solid(points[0] + np.array([0.0, 0.0, 2.0]) + 1.6 * DOT * disk, INK)


def _add_scale(canvas: Canvas, scale: float, length: float, text: str) -> None:
    """A bar of a length in units of R0 with its text, at the lower right of the views."""
    end = np.array([0.5 * WIDTH, -0.48, 0.0])
    canvas.line(end - np.array([scale * length, 0.0, 0.0]), end, 0.012, INK)
    words = canvas.place(end - np.array([0.5 * scale * length, 0.06, 0.0]))
    canvas.text(words, text, INK, FONT_SIZE)
