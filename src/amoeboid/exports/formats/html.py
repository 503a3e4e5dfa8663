"""One page that turns the moving cell in a browser, without a network."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from amoeboid.arrays import Array
from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.summary import table
from amoeboid.figures.gallery.fig3d import own_axes, sight_axes
from amoeboid.figures.page import Moment, Scene, page
from amoeboid.observables import max_retrograde_speed, retrograde_flow
from amoeboid.plotting.cell import MIN_FLOW
from amoeboid.plotting.cell_picture import ARROW, color_limits, spread_out
from amoeboid.runs.analysis import axis
from amoeboid.studies.columns import text
from amoeboid.surface.cell import SurfaceCell
from amoeboid.validation import InvalidInput

ARROWS = 110
MAX_NUMBERS = 6_000_000
"""Of nodes in a page, over all frames: browsers slow down beyond some 100 MB."""


def moments(job: Job, axes: Array, fastest: float) -> Iterator[Moment]:
    """The cells in axes (3, 3) of the page, with arrows relative to the fastest flow [L/T]."""
    R0 = job.run.parameters.R0
    for _, cell in job.cells("html"):
        x = cell.x @ axes.T
        chosen = np.zeros(len(x), dtype=bool)
        if _moves(cell):
            chosen[spread_out(x, ARROWS)] = True
        yield Moment(
            nodes=x / R0,
            faces=cell.faces,
            c=np.asarray(job.shown(cell.c, "N/L^2")),
            arrows=retrograde_flow(cell) @ axes.T * (ARROW / fastest),
            chosen=chosen,
            words=f"t = {job.shown(cell.t, 'T'):.4g} {job.unit('T')}",
        )


def _moves(cell: SurfaceCell) -> bool:
    return max_retrograde_speed(cell) > MIN_FLOW * cell.rate * cell.parameters.R0


def write(job: Job, path: Path) -> None:
    """Write the page; all of it is in memory, which `MAX_NUMBERS` bounds."""
    found = [
        (len(cell.c), cell.c.min(), cell.c.max(), max_retrograde_speed(cell))
        for _, cell in job.cells("html, extent")
    ]
    sizes, lows, highs, speeds = np.array(found, dtype=float).T
    if sizes.sum() > MAX_NUMBERS:
        raise InvalidInput(
            f"a page must have at most {MAX_NUMBERS} nodes in all frames together, got "
            f"{int(sizes.sum())}; choose fewer frames, such as ::10"
        )
    p = job.run.parameters
    low, high = color_limits(float(lows.min()), float(highs.max()), p.c0)
    axes = own_axes(axis(job.cell(job.numbers[-1]), np.array([0.0, 0.0, 1.0])))
    first, *later = moments(job, axes, float(speeds.max()) or 1.0)
    ends = [first.words, later[-1].words] if later else [first.words]
    count = "one frame" if len(sizes) == 1 else f"{len(sizes)} frames"
    fastest = text(p, float(speeds.max()), "L/T", ".3g")
    scene = Scene(
        **vars(first),
        title=f"Cell, {p.description}",
        about=f"A cell, {' to '.join(ends)}, from {count} of a run. The color is the filament "
        f"concentration; arrows show the retrograde flow, the fastest is {fastest}. The radius of "
        f"the undeformed cell is R0 = {text(p, p.R0, 'L', '.4g')}. The table is of the end of the "
        f"run{_end(job)}.",
        label=f"filament concentration c [{job.unit('N/L^2')}]",
        values=dict(table(job.run)),
        limits=(float(job.shown(low, "N/L^2")), float(job.shown(high, "N/L^2"))),
        view=sight_axes(),
        moves=False,
    )
    path.write_text(page(scene, later), encoding="utf-8")


def _end(job: Job) -> str:
    rows = job.run.rows
    return f", t = {text(job.run.parameters, rows[-1]['t'], 'T', '.4g')}" if rows else ""


def files(job: Job) -> Mapping[str, Write]:
    """One page."""
    return {f"{job.name}.html": lambda path: write(job, path)}


FORMAT = Format(
    "a page for browsers that turns the moving cell, without a network", ".html", files,
    packages=("matplotlib",),
)  # fmt: skip
