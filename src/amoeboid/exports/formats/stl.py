"""Surfaces as binary STL: the shape alone, for printers and programs of meshes."""

from __future__ import annotations

import numpy as np

from amoeboid.exports.job import Job
from amoeboid.exports.surfaces import surface_format
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


FORMAT = surface_format(
    "surfaces as triangles alone, in single precision",
    ".stl",
    encoded,
)
