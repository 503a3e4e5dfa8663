"""A picture of a cell in 3D: concentration as color, retrograde flow as arrows (figure 3D).

With a scale bar, the time, and the arrow that stands for the fastest flow. It is drawn in a process
of its own, see `cell_painter`.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.model.parameters import Parameters
from amoeboid.observables import max_retrograde_speed, polarization, retrograde_flow
from amoeboid.output.atomic import write_bytes
from amoeboid.plotting.cell_painter import CellPainter
from amoeboid.simulation.step import Step
from amoeboid.studies.columns import magnitude, unit
from amoeboid.surface.cell import SurfaceCell

MIN_FLOW = 1e-3  # slower than this, in units of rate R0, a cell counts as resting


def save_cell_picture(path: Path, step: Step, painter: CellPainter | None = None) -> None:
    """Render the cell of `step` to a PNG file: front to the left, seen from the side.

    `painter`: the process that draws it, if it was started before. Raises NoPicture if the process
    fails, and OSError.
    """
    save_picture(path, step.cell, painter)


def save_picture(path: Path, cell: SurfaceCell, painter: CellPainter | None = None) -> None:
    """The same of a cell."""
    archive = io.BytesIO()
    np.savez(archive, **scene(cell))
    write_bytes(path, (painter or CellPainter()).picture(archive.getvalue()))


def scene(cell: SurfaceCell) -> dict[str, Any]:
    """What the drawing process needs to know of a cell, see there; in the units of its parameters.

    Those of a cell with physical units are micrometres, seconds and the like.
    """
    p = cell.parameters
    fastest = max_retrograde_speed(cell)
    return {
        "r": magnitude(p, cell.x, "L"),
        "faces": cell.faces,
        "c": magnitude(p, cell.c, "N/L^2"),
        "normals": cell.normals,
        "flow": magnitude(p, retrograde_flow(cell), "L/T"),
        "polarization": polarization(cell),
        "R0": magnitude(p, p.R0, "L"),
        "c0": magnitude(p, p.c0, "N/L^2"),
        "t": magnitude(p, cell.t, "T"),
        "fastest": magnitude(p, fastest, "L/T"),
        "moving": fastest > MIN_FLOW * cell.rate * p.R0,
        "units": [_drawn_unit(p, dimension) for dimension in ("L", "T", "N/L^2", "L/T")],
    }


def _drawn_unit(p: Parameters, dimension: str) -> str:
    """A unit as a picture shows it behind a number; a dimension, which is none, in brackets."""
    if p.units is None:
        return f"[{dimension}]"
    return unit(p, dimension)
