"""Bending energy of a triangulated surface, its derivative, and its stiffness.

The energy per bending stiffness is E = 1/2 sum over nodes of |Y|^2 A, with A the dual area of a
node and Y = (dA_total/dr)/A its curvature vector, H n of the smooth surface (cotangent formula).
Source: Meyer et al., *Discrete differential-geometry operators for triangulated 2-manifolds*, 2003.

The tangential part of Y is an error of the mesh. Without it the derivative vanishes, to rounding,
on every mesh whose nodes lie on a sphere, where Y = 2 r/R^2. Energy and virtual work are of second
order in the edge length (tests/surface/test_bending.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import Geometry, area_gradient, normal_part
from amoeboid.meshes.operators import normal_blocks_on, product, stiffness
from amoeboid.numerics.compiled import compiled


def curvature_vectors(g: Geometry, faces: Index) -> Array:
    """H n at the nodes (V, 3) [1/L]."""
    return np.asarray(area_gradient(g, faces) / g.dual_areas[:, None])


def bending_energy(g: Geometry, faces: Index) -> float:
    """Half the integral of H^2 over the surface [1]: 8 pi on a sphere."""
    Y = curvature_vectors(g, faces)
    return 0.5 * float(g.dual_areas @ np.einsum("vi,vi->v", Y, Y))


def bending_gradient(r: Array, g: Geometry, faces: Index, Y: Array | None = None) -> Array:
    """Derivative (V, 3) of the energy to the nodes r (V, 3) [1/L].

    The exact one of `bending_energy` for Y = `curvature_vectors`; for None, the one with their
    normal part alone.
    """
    if Y is None:
        Y = normal_part(curvature_vectors(g, faces), g.normals)
    return np.asarray(_gradient(r, faces, Y))


@dataclass(frozen=True, eq=False)
class BendingStiffness:
    """L A^-1 L, with L the stiffness matrix and A the areas: the leading part of that of normal
    displacements. `entries` (P,) are those of L, `areas` (V,)."""

    mesh: Connectivity
    entries: Array
    areas: Array

    @classmethod
    def on(cls, g: Geometry, mesh: Connectivity) -> BendingStiffness:
        """That of a shape."""
        return cls(mesh, stiffness(g, mesh), g.node_areas)

    def product(self, h: Array) -> Array:
        """Its product with displacements h (V,)."""
        return product(self.entries, self.mesh, product(self.entries, self.mesh, h) / self.areas)


class TwoRings:
    """The pattern of products of two matrices on the pattern of `mesh`: neighbors of neighbors.

    In compressed row form, as in `Connectivity`; `within` (P,) are the places of the entries on the
    pattern of the mesh.
    """

    def __init__(self, mesh: Connectivity) -> None:
        n, count = mesh.n_nodes, np.diff(mesh.row_start)
        # all pairs of an entry (i, j) and an entry (j, k)
        lengths = count[mesh.columns]
        self._left = np.repeat(np.arange(len(mesh.columns)), lengths)
        starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        offsets = np.arange(len(self._left)) - np.repeat(starts, lengths)
        self._right = mesh.row_start[mesh.columns[self._left]] + offsets
        keys = mesh.rows[self._left] * n + mesh.columns[self._right]
        unique, self._slots = np.unique(keys, return_inverse=True)
        self.columns = unique % n
        self.row_start = np.searchsorted(unique, np.arange(n + 1) * n)
        self.within = np.searchsorted(unique, mesh.rows * n + mesh.columns)
        self._middle = mesh.columns[self._left]

    def added(
        self, matrix: Array, factor: float, bending: BendingStiffness, normals: Array
    ) -> Array:
        """Blocks on this pattern: `matrix` (P, 3, 3) plus `factor` N B N^T of a stiffness B."""
        entries = bending.entries
        terms = entries[self._left] / bending.areas[self._middle] * entries[self._right]
        squared = factor * np.bincount(self._slots, terms, len(self.columns))
        blocks = normal_blocks_on(squared, normals, self.row_start, self.columns)
        blocks[self.within] += matrix
        return np.asarray(blocks)


@compiled
def _gradient(r, faces, Y):  # type: ignore[no-untyped-def]
    # With Y held, dE = sum over triangles and edges ij, opposite to the corner k, of d(cot_k s),
    # s = (r_i - r_j).(Y_i - Y_j)/2 - |r_i - r_j|^2 (|Y_i|^2 + |Y_j|^2)/16.
    found = np.zeros(r.shape)
    p, q = np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        for corner in range(3):
            k = faces[f, corner]
            i, j = faces[f, (corner + 1) % 3], faces[f, (corner + 2) % 3]
            dot, pp, qq, along, squared, weight = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for d in range(3):
                p[d], q[d] = r[i, d] - r[k, d], r[j, d] - r[k, d]
                dot += p[d] * q[d]
                pp += p[d] * p[d]
                qq += q[d] * q[d]
                along += (r[i, d] - r[j, d]) * (Y[i, d] - Y[j, d])
                squared += (r[i, d] - r[j, d]) ** 2
                weight += Y[i, d] ** 2 + Y[j, d] ** 2
            twice = np.sqrt(pp * qq - dot * dot)
            cot = dot / twice
            s = 0.5 * along - 0.0625 * squared * weight
            of_p, of_q = cot / (twice * twice) * qq, cot / (twice * twice) * pp
            # d(cot)/dp = (1/twice + dot^2/twice^3) q - dot qq/twice^3 p, and q for p
            mixed = 1.0 / twice + cot * cot / twice
            for d in range(3):
                dp = mixed * q[d] - of_p * p[d]
                dq = mixed * p[d] - of_q * q[d]
                edge = r[i, d] - r[j, d]
                bend = 0.5 * cot * (Y[i, d] - Y[j, d]) - 0.125 * cot * weight * edge
                found[i, d] += s * dp + bend
                found[j, d] += s * dq - bend
                found[k, d] -= s * (dp + dq)
    return found
