"""Pictures of the frames of a run, all seen in the same way and at the same scale."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.exports.job import Job
from amoeboid.observables import polarization
from amoeboid.plotting.canvas import Canvas
from amoeboid.plotting.cell import scene
from amoeboid.plotting.cell_picture import (
    View,
    add_scales,
    color_limits,
    picture,
    seen_along,
    view_axes,
)
from amoeboid.plotting.palette import GRAY
from amoeboid.surface.cell import SurfaceCell

WINDOW = (960, 704)  # pixels; even numbers, which codecs want
WIDE = 1.55  # half the width that cells fill, in units of the size of the view
MAX_WORDS = 60  # characters of a line of words
TURNS = 0.3  # the path is seen from above its plane if it is this wide [R0]


@dataclass(frozen=True, eq=False)
class Extent:
    """What the pictures must have room for: centers (T, 3), radii (T,), c, the fastest flow."""

    centers: Array
    radii: Array
    c: tuple[float, float]
    fastest: float
    polarization: Array


def pictures(job: Job, kind: str) -> Iterator[Canvas]:
    """The pictures of the frames; only one is kept at a time."""
    view = view_of(job, extent_of(job, kind))
    for _, cell in job.cells(kind):
        drawn = placed(job, cell)
        canvas = picture(drawn, view)
        if not job.follow:
            for k, words in enumerate(wrap(f"path: {job.path_words}", MAX_WORDS)):
                place = canvas.share(0.03, 0.11 + 0.03 * k)
                canvas.text(place, words, GRAY, 0.7 * view.font, "lm")
        add_scales(canvas, drawn, view)
        yield canvas


def placed(job: Job, cell: SurfaceCell) -> dict[str, Any]:
    """The scene of a cell where it is, in the axes of the export."""
    drawn, place = scene(cell), job.place(cell)
    turned = {name: place.turned(drawn[name]) for name in ("normals", "flow", "polarization")}
    return drawn | turned | {"r": job.nodes(cell)}


def extent_of(job: Job, kind: str) -> Extent:
    """Read all frames once, and keep a few numbers of each."""
    found: list[Any] = []
    rear = np.zeros(3)
    for _, cell in job.cells(f"{kind}, extent"):
        seen = scene(cell)
        radius = float(np.linalg.norm(seen["r"], axis=1).max())
        c = seen["c"]
        found.append((*job.center(cell), radius, c.min(), c.max(), seen["fastest"]))
        rear = job.place(cell).turned(polarization(cell))
    table = np.array(found, dtype=float)
    limits = float(table[:, 4].min()), float(table[:, 5].max())
    return Extent(table[:, :3], table[:, 3], limits, float(table[:, 6].max()), rear)


def view_of(job: Job, extent: Extent) -> View:
    """A view with room for all cells: from the side, or on the plane in which the cell turns."""
    p = job.run.parameters
    R0, c0 = float(job.shown(p.R0, "L")), float(job.shown(p.c0, "N/L^2"))
    axes = _axes(extent, R0)
    flat = extent.centers @ np.array(axes).T
    low = (flat - extent.radii[:, None]).min(axis=0)
    high = (flat + extent.radii[:, None]).max(axis=0)
    half = 0.5 * (high - low)
    size = max(R0, half[1], half[0] / WIDE)
    about = 0.5 * (low + high) @ np.array(axes)
    middle = about - 0.14 * size * axes[1]
    fastest = extent.fastest or 1.0
    return View(axes, middle, size, color_limits(*extent.c, c0), fastest, WINDOW, about)


def _axes(extent: Extent, R0: float) -> tuple[Array, Array, Array]:
    """Right, up and towards the viewer."""
    about = extent.centers - extent.centers.mean(axis=0)
    _, _, plane = np.linalg.svd(np.vstack([about, np.zeros((3, 3))]), full_matrices=False)
    if np.ptp(about @ plane[1]) < TURNS * R0:
        return seen_along(*view_axes(extent.polarization))
    # signs that do not depend on the linear algebra library: the path ends to the left, above
    signs = [-1.0 if (about[-1] - about[0]) @ axis > 0.0 else 1.0 for axis in plane[:2]]
    right, up = signs[0] * plane[0], -signs[1] * plane[1]
    return right, up, np.cross(right, up)
