"""Surfaces as binary STL: the shape alone, for printers and programs of meshes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.surfaces import one_each
from amoeboid.meshes.stl import HEADER, TRIANGLE
from amoeboid.surface.cell import SurfaceCell


def encoded(job: Job, cell: SurfaceCell) -> bytes:
    """A frame as triangles, numbers in single precision."""
    corners = job.nodes(cell)[cell.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles = np.zeros(len(corners), TRIANGLE)
    triangles["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    triangles["corners"] = corners
    t = f"{job.shown(cell.t, 'T'):.9g} {job.unit('T')}"
    comment = f"amoeboid, t = {t}, length {job.unit('L')}".encode()[: HEADER - 4]
    return comment.ljust(HEADER - 4) + len(corners).to_bytes(4, "little") + triangles.tobytes()


def files(job: Job) -> Mapping[str, Write]:
    """A file for each frame."""
    return one_each(job, ".stl", encoded)


FORMAT = Format(
    "surfaces as triangles alone, in single precision",
    ".stl",
    files,
    frozenset({"follow"}),
    one_per_frame=True,
)
