"""Tangential relaxation of the mesh: nodes drift to the middle of their triangles.

It keeps the triangles even under deformation, and makes every discretization error fall at second
order: an icosphere as subdivided has uneven triangles, and its errors do not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.geometry import Geometry, geometry, normal_part, scatter
from amoeboid.surface.mesh import Connectivity, Index, connectivity, icosphere

Array = NDArray[np.float64]


def relaxation(r: Array, g: Geometry, mesh: Connectivity) -> Array:
    """Tangential vectors (V, 3) from the nodes to the mean center of the triangles around them."""
    moments = g.face_areas[:, None] * r[mesh.faces].mean(axis=1)
    target = scatter(moments, mesh.faces, len(r))
    pull = target / (3.0 * g.node_areas[:, None]) - r
    return pull - normal_part(pull, g.normals)


def even_icosphere(subdivisions: int, tolerance: float = 1e-10) -> tuple[Array, Index]:
    """An icosphere (unit sphere) whose mesh is at rest under `relaxation`: nodes (V, 3), faces."""
    r, faces = icosphere(subdivisions)
    mesh = connectivity(faces)
    # accelerated fixed point iteration: the slowest mode spans the whole sphere
    spacing = np.sqrt(4 * np.pi / len(r))
    momentum = (1 - spacing) / (1 + spacing)
    previous = r
    for _ in range(100_000):
        ahead = r + momentum * (r - previous)
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        moved = ahead + 0.5 * relaxation(ahead, geometry(ahead, faces), mesh)
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        change = np.abs(moved - ahead).max()
        previous, r = r, moved
        if change < tolerance * spacing:
            return r, faces
    raise ArithmeticError(f"mesh relaxation did not settle, last change {change:.3g}")
