"""Surfaces with their fields for ParaView and PyVista, and the list with their times."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.surfaces import FIELDS, one_each
from amoeboid.meshes.vtp import frame_bytes
from amoeboid.output.frames import collection
from amoeboid.surface.cell import SurfaceCell

LIST = "frames.pvd"


def encoded(job: Job, cell: SurfaceCell) -> bytes:
    """A frame in the units of the export."""
    numbers = {
        "t": np.array([job.shown(cell.t, "T")]),
        "zeta0": np.array([job.shown(cell.zeta0, "M/T^2")]),
        "cortex_drag_position": np.asarray(job.shown(cell.state.position, "L")),
    }
    if job.environment and not job.follow:
        numbers["migration_position"] = job.center(cell)
    return frame_bytes(job.nodes(cell), cell.faces, job.fields(cell, FIELDS), numbers)


def files(job: Job) -> Mapping[str, Write]:
    """The frames, and if there are several their list."""
    surfaces = one_each(job, ".vtp", encoded)

    def listed(path: Path) -> None:
        times = [float(job.shown(t, "T")) for t in job.times]
        entries = sorted(zip(times, surfaces, strict=True))
        path.write_text(collection(entries, where=""), encoding="utf-8")

    return dict(surfaces) if len(surfaces) == 1 else {**surfaces, LIST: listed}


FORMAT = Format(
    "surfaces with c, velocities and normals for ParaView and PyVista, with their times",
    ".vtp",
    files,
    frozenset({"follow"}),
    one_per_frame=True,
)
