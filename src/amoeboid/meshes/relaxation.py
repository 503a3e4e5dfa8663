"""Tangential relaxation of the mesh: nodes move towards the mean center of their triangles.

Relaxation keeps the triangles uniform when the shape deforms. With it every discretization error
decreases at second order; on an icosphere whose triangles are only subdivided it does not.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.connectivity import Connectivity, icosahedron, renumbered, subdivided
from amoeboid.meshes.geometry import Geometry, geometry
from amoeboid.numerics.compiled import compiled

# Tolerance for the coarser meshes from which `uniform_icosphere` starts.
COARSE_TOLERANCE = 1e-4
# Damping of the slowest mode of relaxation in units of the mesh spacing, measured.
SLOWEST_DAMPING = 2.0


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


def uniform_icosphere(subdivisions: int, tolerance: float = 1e-10) -> tuple[Array, Index]:
    """An icosphere (unit sphere) relaxed by `relaxation`: nodes (V, 3), faces (F, 3).

    The faces are those of `icosphere`. Every subdivision starts from the relaxed coarser mesh, so
    that only perturbations of short wavelength remain, which decay quickly.
    """
    r, faces = icosahedron()
    for _ in range(subdivisions - 1):
        r, faces = subdivided(r, faces)
        r = _relaxed(r, faces, COARSE_TOLERANCE)
    if subdivisions > 0:
        r, faces = subdivided(r, faces)
    r, faces = renumbered(r, faces)
    return _relaxed(r, faces, tolerance), faces


def _relaxed(r: Array, faces: Index, tolerance: float) -> Array:
    """Nodes on the unit sphere, moved by `relaxation` until they converge."""
    # accelerated fixed point iteration; the slowest mode is the smoothest of icosahedral symmetry
    spacing = np.sqrt(4 * np.pi / len(r))
    momentum = (1 - SLOWEST_DAMPING * spacing) / (1 + SLOWEST_DAMPING * spacing)
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
    raise ArithmeticError(f"mesh relaxation did not converge, last change {change:.3g}")


def _on_sphere(r: Array) -> Array:
    return np.asarray(r / np.sqrt(np.einsum("vi,vi->v", r, r))[:, None])
