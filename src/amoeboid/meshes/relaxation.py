"""Tangential relaxation of the mesh: nodes drift to the middle of their triangles.

It keeps the triangles even under deformation, and makes every discretization error fall at second
order: an icosphere as subdivided has uneven triangles, and its errors do not.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.connectivity import Connectivity, icosahedron, renumbered, subdivided
from amoeboid.meshes.geometry import Geometry, geometry
from amoeboid.numerics.compiled import compiled

# Accuracy to which the coarser meshes settle on which `even_icosphere` starts.
COARSE_TOLERANCE = 1e-4
# Damping of the slowest mode of a mesh in units of its spacing, measured.
SLOWEST = 2.0


def relaxation(r: Array, g: Geometry, mesh: Connectivity) -> Array:
    """Tangential vectors (V, 3) from the nodes to the mean center of the triangles around them."""
    return np.asarray(_relaxation(r, mesh.faces, g.face_areas, g.node_areas, g.normals))


@compiled
def _relaxation(r, faces, face_areas, node_areas, normals):  # type: ignore[no-untyped-def]
    pull = np.zeros(r.shape)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            moment = face_areas[f] * (r[i, d] + r[j, d] + r[k, d]) / 3.0
            pull[i, d] += moment
            pull[j, d] += moment
            pull[k, d] += moment
    for v in range(r.shape[0]):
        along = 0.0
        for d in range(3):
            pull[v, d] = pull[v, d] / (3.0 * node_areas[v]) - r[v, d]
            along += pull[v, d] * normals[v, d]
        for d in range(3):
            pull[v, d] -= along * normals[v, d]
    return pull


def even_icosphere(subdivisions: int, tolerance: float = 1e-10) -> tuple[Array, Index]:
    """An icosphere (unit sphere) whose mesh is at rest under `relaxation`: nodes (V, 3), faces.

    The faces are those of `icosphere`. Every subdivision starts from the even mesh before it,
    which leaves only short, quickly settling disturbances.
    """
    r, faces = icosahedron()
    for _ in range(subdivisions - 1):
        r, faces = subdivided(r, faces)
        r = _settled(r, faces, COARSE_TOLERANCE)
    if subdivisions > 0:
        r, faces = subdivided(r, faces)
    r, faces = renumbered(r, faces)
    return _settled(r, faces, tolerance), faces


def _settled(r: Array, faces: Index, tolerance: float) -> Array:
    """Nodes on the unit sphere, moved by `relaxation` until they rest."""
    # accelerated fixed point iteration; the slowest mode is the smoothest of icosahedral symmetry
    spacing = np.sqrt(4 * np.pi / len(r))
    momentum = (1 - SLOWEST * spacing) / (1 + SLOWEST * spacing)
    previous = r
    for _ in range(100_000):
        ahead = _on_sphere(r + momentum * (r - previous))
        g = geometry(ahead, faces)
        pull = _relaxation(ahead, faces, g.face_areas, g.node_areas, g.normals)
        moved = _on_sphere(ahead + 0.5 * pull)
        change = np.abs(moved - ahead).max()
        previous, r = r, moved
        if change < tolerance * spacing:
            return r
    raise ArithmeticError(f"mesh relaxation did not settle, last change {change:.3g}")


def _on_sphere(r: Array) -> Array:
    return np.asarray(r / np.sqrt(np.einsum("vi,vi->v", r, r))[:, None])
