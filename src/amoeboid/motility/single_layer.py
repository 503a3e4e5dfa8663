"""Stokes flow around a triangulated surface: the integral equation for the tractions at its nodes.

Tractions are linear on flat triangles, the equation holds at the nodes: errors are of second order
in the size of the triangles. On triangles that meet in the node the integral is exact along rays
from it; on others it is by Gauss points, more of them nearby.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.geometry import geometry
from amoeboid.numerics.compiled import compiled

# Triangles within so many times their size of a node have seven points, others three.
NEAR = 2.5
# Gauss points over the angle of a triangle as seen from its corner.
RAYS = 4

_A, _B = (6.0 - np.sqrt(15.0)) / 21.0, (6.0 + np.sqrt(15.0)) / 21.0
_WA, _WB = (155.0 - np.sqrt(15.0)) / 1200.0, (155.0 + np.sqrt(15.0)) / 1200.0
# Points and weights of rules of degree 2 and 5 on a triangle (J. Radon, 1948).
THREE = (
    np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0,
    np.full(3, 1.0 / 3.0),
)
SEVEN = (
    np.array(
        [
            [1 / 3, 1 / 3, 1 / 3],
            *(np.roll([1 - 2 * _A, _A, _A], k) for k in range(3)),
            *(np.roll([1 - 2 * _B, _B, _B], k) for k in range(3)),
        ]
    ),
    np.array([9.0 / 40.0, *(3 * [_WA]), *(3 * [_WB])]),
)


class StokesSurface:
    """Tractions on a closed surface of nodes r (V, 3) that moves in a fluid of viscosity 1."""

    def __init__(self, r: Array, faces: Index) -> None:
        from scipy.linalg import lu_factor  # not for every run that imports this

        self.r, self.faces, self.geometry = r, faces, geometry(r, faces)
        size = np.sqrt(self.geometry.area / (4.0 * np.pi))
        rays = np.polynomial.legendre.leggauss(RAYS)
        matrix = _single_layer(r, faces, *THREE, *SEVEN, *rays, NEAR)
        # without this a pressure, which drives no flow, would be free
        along = (self.geometry.normals * self.geometry.node_areas[:, None]).ravel()
        matrix += np.outer(self.geometry.normals.ravel() / size, along)
        self._factors = lu_factor(matrix, overwrite_a=True, check_finite=False)

    def tractions(self, velocities: Array) -> Array:
        """Those (k, V, 3) of velocities (k, V, 3) with no flow inside, of rigid motions."""
        from scipy.linalg import lu_solve

        rows = velocities.reshape(len(velocities), -1)
        found = lu_solve(self._factors, rows.T, check_finite=False).T
        return -np.ascontiguousarray(found).reshape(velocities.shape)

    def outside_tractions(self, velocities: Array) -> Array:
        """Those (k, V, 3) of any velocities (k, V, 3), by the fluid outside."""
        sources = [
            v - _double_layer(self.r, self.faces, np.ascontiguousarray(v), *THREE, *SEVEN, NEAR)
            for v in velocities
        ]
        return self.tractions(np.stack(sources))


@compiled
def _single_layer(  # type: ignore[no-untyped-def]
    r, faces, three, weights_3, seven, weights_7, rays, ray_weights, near
):
    # (3V, 3V): velocities at the nodes from linear densities, viscosity 1
    n_nodes, n_faces = r.shape[0], faces.shape[0]
    matrix = np.zeros((3 * n_nodes, 3 * n_nodes))
    over = 1.0 / (8.0 * np.pi)
    far_x, near_x = np.empty((n_faces, 3, 3)), np.empty((n_faces, 7, 3))
    areas, centers, sizes = np.empty(n_faces), np.empty((n_faces, 3)), np.empty(n_faces)
    for f in range(n_faces):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            centers[f, d] = (r[i, d] + r[j, d] + r[k, d]) / 3.0
            for q in range(3):
                far_x[f, q, d] = (
                    three[q, 0] * r[i, d] + three[q, 1] * r[j, d] + three[q, 2] * r[k, d]
                )
            for q in range(7):
                near_x[f, q, d] = (
                    seven[q, 0] * r[i, d] + seven[q, 1] * r[j, d] + seven[q, 2] * r[k, d]
                )
        ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        areas[f] = 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)
        longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
        longest = max(longest, (ux - vx) ** 2 + (uy - vy) ** 2 + (uz - vz) ** 2)
        sizes[f] = near * near * longest
    corner = np.empty((3, 6))
    for p in range(n_nodes):
        px, py, pz = r[p, 0], r[p, 1], r[p, 2]
        for f in range(n_faces):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            corner[:, :] = 0.0
            if p in (i, j, k):
                at = 0 if p == i else (1 if p == j else 2)
                b, c = faces[f, (at + 1) % 3], faces[f, (at + 2) % 3]
                # along the ray to a point of the opposite edge, linear in its place s there
                bx, by, bz = r[b, 0] - px, r[b, 1] - py, r[b, 2] - pz
                cx, cy, cz = r[c, 0] - px, r[c, 1] - py, r[c, 2] - pz
                for q in range(rays.shape[0]):
                    s = 0.5 * (rays[q] + 1.0)
                    x, y, z = bx + s * (cx - bx), by + s * (cy - by), bz + s * (cz - bz)
                    inverse = 1.0 / np.sqrt(x * x + y * y + z * z)
                    cube = inverse * inverse * inverse
                    # the element is 2 area u du ds, the kernel 1/u: u goes from 0 to 1
                    scale = ray_weights[q] * areas[f] * over
                    g0 = scale * (inverse + x * x * cube)
                    g1 = scale * (inverse + y * y * cube)
                    g2 = scale * (inverse + z * z * cube)
                    g3, g4, g5 = scale * x * y * cube, scale * x * z * cube, scale * y * z * cube
                    for n in range(3):
                        # integrals over u of 1 - u, u (1 - s), u s
                        share = 0.5 if n == 0 else (0.5 * (1.0 - s) if n == 1 else 0.5 * s)
                        place = (at + n) % 3
                        corner[place, 0] += share * g0
                        corner[place, 1] += share * g1
                        corner[place, 2] += share * g2
                        corner[place, 3] += share * g3
                        corner[place, 4] += share * g4
                        corner[place, 5] += share * g5
            else:
                dx, dy, dz = centers[f, 0] - px, centers[f, 1] - py, centers[f, 2] - pz
                close = dx * dx + dy * dy + dz * dz < sizes[f]
                count = 7 if close else 3
                for q in range(count):
                    if close:
                        x, y, z = near_x[f, q, 0] - px, near_x[f, q, 1] - py, near_x[f, q, 2] - pz
                        w0, w1, w2, weight = seven[q, 0], seven[q, 1], seven[q, 2], weights_7[q]
                    else:
                        x, y, z = far_x[f, q, 0] - px, far_x[f, q, 1] - py, far_x[f, q, 2] - pz
                        w0, w1, w2, weight = three[q, 0], three[q, 1], three[q, 2], weights_3[q]
                    inverse = 1.0 / np.sqrt(x * x + y * y + z * z)
                    scale = weight * areas[f] * over * inverse
                    cube = scale * inverse * inverse
                    g0, g1, g2 = scale + x * x * cube, scale + y * y * cube, scale + z * z * cube
                    g3, g4, g5 = x * y * cube, x * z * cube, y * z * cube
                    for n, share in ((0, w0), (1, w1), (2, w2)):
                        corner[n, 0] += share * g0
                        corner[n, 1] += share * g1
                        corner[n, 2] += share * g2
                        corner[n, 3] += share * g3
                        corner[n, 4] += share * g4
                        corner[n, 5] += share * g5
            for n in range(3):
                v = 3 * faces[f, n]
                matrix[3 * p, v] += corner[n, 0]
                matrix[3 * p, v + 1] += corner[n, 3]
                matrix[3 * p, v + 2] += corner[n, 4]
                matrix[3 * p + 1, v] += corner[n, 3]
                matrix[3 * p + 1, v + 1] += corner[n, 1]
                matrix[3 * p + 1, v + 2] += corner[n, 5]
                matrix[3 * p + 2, v] += corner[n, 4]
                matrix[3 * p + 2, v + 1] += corner[n, 5]
                matrix[3 * p + 2, v + 2] += corner[n, 2]
    return matrix


@compiled
def _double_layer(  # type: ignore[no-untyped-def]
    r, faces, velocities, three, weights_3, seven, weights_7, near
):
    # (V, 3): integral of (v(y) - v(x)).T.n/(8 pi) at the nodes x, T = -6 d d d/|d|^5, d = y - x;
    # triangles that meet in x lie in planes through it and give nothing
    n_nodes, n_faces = r.shape[0], faces.shape[0]
    found = np.zeros((n_nodes, 3))
    over = -6.0 / (8.0 * np.pi)
    for f in range(n_faces):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
        # twice the area along the normal
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
        longest = max(longest, (ux - vx) ** 2 + (uy - vy) ** 2 + (uz - vz) ** 2)
        size = near * near * longest
        for p in range(n_nodes):
            if p in (i, j, k):
                continue
            dx = (r[i, 0] + r[j, 0] + r[k, 0]) / 3.0 - r[p, 0]
            dy = (r[i, 1] + r[j, 1] + r[k, 1]) / 3.0 - r[p, 1]
            dz = (r[i, 2] + r[j, 2] + r[k, 2]) / 3.0 - r[p, 2]
            close = dx * dx + dy * dy + dz * dz < size
            height = 0.5 * (dx * nx + dy * ny + dz * nz)
            count = 7 if close else 3
            for q in range(count):
                if close:
                    w0, w1, w2, weight = seven[q, 0], seven[q, 1], seven[q, 2], weights_7[q]
                else:
                    w0, w1, w2, weight = three[q, 0], three[q, 1], three[q, 2], weights_3[q]
                x = w0 * r[i, 0] + w1 * r[j, 0] + w2 * r[k, 0] - r[p, 0]
                y = w0 * r[i, 1] + w1 * r[j, 1] + w2 * r[k, 1] - r[p, 1]
                z = w0 * r[i, 2] + w1 * r[j, 2] + w2 * r[k, 2] - r[p, 2]
                sx = w0 * velocities[i, 0] + w1 * velocities[j, 0] + w2 * velocities[k, 0]
                sy = w0 * velocities[i, 1] + w1 * velocities[j, 1] + w2 * velocities[k, 1]
                sz = w0 * velocities[i, 2] + w1 * velocities[j, 2] + w2 * velocities[k, 2]
                sx -= velocities[p, 0]
                sy -= velocities[p, 1]
                sz -= velocities[p, 2]
                square = x * x + y * y + z * z
                scale = over * weight * height / (square * square * np.sqrt(square))
                scale *= sx * x + sy * y + sz * z
                found[p, 0] += scale * x
                found[p, 1] += scale * y
                found[p, 2] += scale * z
    return found
