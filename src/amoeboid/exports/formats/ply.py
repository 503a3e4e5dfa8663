"""Surfaces as binary PLY, with normals, c and the retrograde flow at the vertices."""

from __future__ import annotations

import numpy as np

from amoeboid.exports.job import Job
from amoeboid.exports.surfaces import FIELDS, surface_format, unit_text
from amoeboid.surface.cell import SurfaceCell

COLUMNS = ("x", "y", "z", "nx", "ny", "nz", "c", "flow_x", "flow_y", "flow_z")


def encoded(job: Job, cell: SurfaceCell) -> bytes:
    """A frame as vertices and faces, numbers in double precision."""
    found = job.fields(cell, FIELDS)
    values = np.column_stack(
        [job.nodes(cell), found["normal"], found["c"], found["retrograde_flow"]]
    )
    faces = np.empty(len(cell.faces), dtype=[("count", "u1"), ("nodes", "<i4", 3)])
    faces["count"], faces["nodes"] = 3, cell.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment amoeboid, t = {job.shown(cell.t, 'T'):.9g} {job.unit('T')}; {unit_text(job)}",
        f"element vertex {len(values)}",
        *(f"property double {name}" for name in COLUMNS),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode() + values.astype("<f8").tobytes() + faces.tobytes()


FORMAT = surface_format(
    "surfaces with normals, c and the retrograde flow at the vertices (MeshLab, Blender, trimesh)",
    ".ply",
    encoded,
)
