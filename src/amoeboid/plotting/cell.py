"""A picture of a cell in 3D: concentration as color, retrograde flow as arrows (figure 3D).

With a scale bar, the time, and the arrow that stands for the fastest flow. It is drawn in a process
of its own, beside which the program can draw something else.
"""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.model.parameters import Parameters
from amoeboid.observables import max_retrograde_speed, polarization, retrograde_flow
from amoeboid.output.atomic import write_atomically
from amoeboid.plotting import cell_process
from amoeboid.simulation.step import Step
from amoeboid.studies.columns import magnitude, unit
from amoeboid.surface.cell import SurfaceCell

MIN_FLOW = 1e-3  # slower than this, in units of rate R0, a cell counts as resting
MAX_DRAWING = 120.0  # seconds; the largest mesh takes a few
REMEDY = "ParaView opens the frames"


class NoPicture(RuntimeError):
    """The drawing process failed; the message says how."""


def save_cell_picture(path: Path, step: Step) -> None:
    """Render the cell of `step` to a PNG file: front to the left, seen from the side.

    Raises NoPicture if the process fails, and OSError.
    """
    save_picture(path, step.cell)


def save_picture(path: Path, cell: SurfaceCell) -> None:
    """The same of a cell."""
    archive = io.BytesIO()
    np.savez(archive, **scene(cell))
    write_atomically(path, lambda p: _draw(p, archive.getvalue()))


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


def _draw(path: Path, archive: bytes) -> None:
    problem = _problem(path, archive)
    if problem is not None:
        raise NoPicture(f"{problem}; {REMEDY}")


def _problem(path: Path, archive: bytes) -> str | None:
    """Draw in a process of its own; None, or what went wrong."""
    command = [sys.executable, "-P", cell_process.__file__, str(path.absolute())]
    try:
        done = subprocess.run(  # noqa: S603  (our own program; the path is one argument)
            command, input=archive, capture_output=True, timeout=MAX_DRAWING
        )
    except subprocess.TimeoutExpired:
        return f"the drawing process took more than {MAX_DRAWING:g} s"
    if done.returncode == 0 and path.is_file():
        return None
    lines = done.stderr.decode(errors="replace").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    return ": ".join([f"the drawing process ended with {_ending(done.returncode)}", *said[-1:]])


def _ending(code: int) -> str:
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"code {code}"
