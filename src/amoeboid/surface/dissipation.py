"""The viscous cortex: dissipation function, its matrix, and the stress that follows from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.surface.geometry import Geometry
from amoeboid.surface.mesh import Connectivity

Array = NDArray[np.float64]


def dissipation_blocks(g: Geometry, mesh: Connectivity, eta_s: float, eta_b: float) -> Array:
    """Second derivative of the dissipation function with respect to node velocities.

    SI `dissipation`: D = integral of (eta_b/2) (tr e)^2 + eta_s e:e, e = half the rate of change
    of the metric, exact for velocities that are linear on each triangle. Returns the 3 x 3 blocks
    on the pattern of `mesh` (P, 3, 3) [M/T]; D = v.K.v/2, the viscous force on node i is -(K v)_i.
    """
    return _dissipation_blocks(
        g.face_areas, g.face_normals, g.gradients, mesh.slots, len(mesh.columns), eta_s, eta_b
    )


@compiled
def _dissipation_blocks(areas, normals, gradients, slots, n_slots, eta_s, eta_b):  # type: ignore[no-untyped-def]
    blocks = np.zeros((n_slots, 3, 3))
    tangent = np.empty((3, 3))
    for f in range(areas.shape[0]):
        for p in range(3):
            for q in range(3):
                tangent[p, q] = -normals[f, p] * normals[f, q]
            tangent[p, p] += 1.0
        for a in range(3):
            for b in range(a, 3):
                block, mirror = slots[f, a, b], slots[f, b, a]
                overlap = 0.0
                for d in range(3):
                    overlap += gradients[f, a, d] * gradients[f, b, d]
                for p in range(3):
                    for q in range(3):
                        entry = areas[f] * (
                            eta_b * gradients[f, a, p] * gradients[f, b, q]
                            + eta_s * gradients[f, b, p] * gradients[f, a, q]
                            + eta_s * overlap * tangent[p, q]
                        )
                        blocks[block, p, q] += entry
                        if a != b:
                            blocks[mirror, q, p] += entry
    return blocks


def viscous_stress(g: Geometry, mesh: Connectivity, v: Array, eta_s: float, eta_b: float) -> Array:
    """Stress of the cortex on each triangle (F, 3, 3) [M/T^2] for node velocities v (V, 3).

    eta_b (tr e) P + 2 eta_s e, with the strain rate e of `dissipation_blocks` and P the projector
    on the triangle; minus the derivative of the dissipation function.
    """
    return _viscous_stress(g.face_normals, g.gradients, mesh.faces, v, eta_s, eta_b)


@compiled
def _viscous_stress(normals, gradients, faces, v, eta_s, eta_b):  # type: ignore[no-untyped-def]
    stress = np.zeros((faces.shape[0], 3, 3))
    slope = np.empty((3, 3))
    for f in range(faces.shape[0]):
        n = normals[f]
        for p in range(3):
            along = 0.0
            for d in range(3):
                slope[p, d] = 0.0
            for a in range(3):
                for d in range(3):
                    slope[p, d] += gradients[f, a, p] * v[faces[f, a], d]
            for d in range(3):
                along += slope[p, d] * n[d]
            for d in range(3):
                slope[p, d] -= along * n[d]
        trace = slope[0, 0] + slope[1, 1] + slope[2, 2]
        for p in range(3):
            for q in range(3):
                stress[f, p, q] = eta_s * (slope[p, q] + slope[q, p]) - eta_b * trace * n[p] * n[q]
            stress[f, p, p] += eta_b * trace
    return stress


def viscous_forces(g: Geometry, mesh: Connectivity, v: Array, eta_s: float, eta_b: float) -> Array:
    """Node forces (V, 3) of the viscous stress: -K v, K the matrix of `dissipation_blocks`."""
    stress = viscous_stress(g, mesh, v, eta_s, eta_b)
    return np.asarray(_stress_forces(g.face_areas, g.gradients, mesh.faces, stress, len(v)))


@compiled
def _stress_forces(areas, gradients, faces, stress, n_nodes):  # type: ignore[no-untyped-def]
    forces = np.zeros((n_nodes, 3))
    for f in range(faces.shape[0]):
        for a in range(3):
            for p in range(3):
                for q in range(3):
                    forces[faces[f, a], p] -= areas[f] * stress[f, p, q] * gradients[f, a, q]
    return forces
