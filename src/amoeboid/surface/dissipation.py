"""The viscous cortex: matrix of the dissipation function, and viscous stress."""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import Geometry
from amoeboid.numerics.compiled import compiled


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
    for f in range(areas.shape[0]):
        n, bulk, shear = normals[f], eta_b * areas[f], eta_s * areas[f]
        for a in range(3):
            x = gradients[f, a]
            for b in range(a, 3):
                y = gradients[f, b]
                block, mirror = slots[f, a, b], slots[f, b, a]
                isotropic = shear * (x[0] * y[0] + x[1] * y[1] + x[2] * y[2])
                for p in range(3):
                    for q in range(3):
                        entry = bulk * x[p] * y[q] + shear * y[p] * x[q] - isotropic * n[p] * n[q]
                        if p == q:
                            entry += isotropic
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
    stress = np.empty((faces.shape[0], 3, 3))
    for f in range(faces.shape[0]):
        i, j, k, n = faces[f, 0], faces[f, 1], faces[f, 2], normals[f]
        for p in range(3):
            # derivative of v along axis p, without its normal part
            a, b, c = gradients[f, 0, p], gradients[f, 1, p], gradients[f, 2, p]
            x = a * v[i, 0] + b * v[j, 0] + c * v[k, 0]
            y = a * v[i, 1] + b * v[j, 1] + c * v[k, 1]
            z = a * v[i, 2] + b * v[j, 2] + c * v[k, 2]
            along = x * n[0] + y * n[1] + z * n[2]
            stress[f, p, 0], stress[f, p, 1] = x - along * n[0], y - along * n[1]
            stress[f, p, 2] = z - along * n[2]
        bulk = eta_b * (stress[f, 0, 0] + stress[f, 1, 1] + stress[f, 2, 2])
        for p in range(3):
            for q in range(p):
                mean = eta_s * (stress[f, p, q] + stress[f, q, p]) - bulk * n[p] * n[q]
                stress[f, p, q], stress[f, q, p] = mean, mean
            stress[f, p, p] = 2.0 * eta_s * stress[f, p, p] + bulk * (1.0 - n[p] * n[p])
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
            v, area = faces[f, a], areas[f]
            x, y, z = gradients[f, a, 0], gradients[f, a, 1], gradients[f, a, 2]
            for p in range(3):
                pull = stress[f, p, 0] * x + stress[f, p, 1] * y + stress[f, p, 2] * z
                forces[v, p] -= area * pull
    return forces
