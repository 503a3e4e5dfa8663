"""Matrices over the nodes of a mesh: products, stiffness, normal projection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from amoeboid.numerics.compiled import compiled
from amoeboid.surface.geometry import Geometry
from amoeboid.surface.mesh import Connectivity

Array = NDArray[np.float64]


def stiffness(g: Geometry, mesh: Connectivity) -> Array:
    """Entries of the cotangent stiffness matrix L on the pattern of `mesh` (P,).

    (L c)_i is the integral of grad phi_i . grad c; positive semidefinite; L r = dA/dr.
    """
    return _stiffness(g.face_areas, g.gradients, mesh.slots, len(mesh.columns))


@compiled
def _stiffness(areas, gradients, slots, n_slots):  # type: ignore[no-untyped-def]
    entries = np.zeros(n_slots)
    for f in range(areas.shape[0]):
        for a in range(3):
            for b in range(3):
                overlap = 0.0
                for d in range(3):
                    overlap += gradients[f, a, d] * gradients[f, b, d]
                entries[slots[f, a, b]] += areas[f] * overlap
    return entries


def advection(g: Geometry, mesh: Connectivity, u: Array) -> Array:
    """Entries of the advection matrix C on the pattern of `mesh` (P,), for velocities u (V, 3).

    (C c)_i is the integral of c u . grad phi_i: what flows into the patch of node i. Columns sum
    to zero, so that the total of c is conserved.
    """
    return _advection(g.face_areas, g.gradients, mesh.faces, mesh.slots, len(mesh.columns), u)


@compiled
def _advection(areas, gradients, faces, slots, n_slots, u):  # type: ignore[no-untyped-def]
    entries = np.zeros(n_slots)
    for f in range(areas.shape[0]):
        for b in range(3):
            for a in range(3):
                # integral of phi_b u over the triangle, u linear: area (sum of u + u_b) / 12
                flow = 0.0
                for d in range(3):
                    total = u[faces[f, b], d]
                    for k in range(3):
                        total += u[faces[f, k], d]
                    flow += total * gradients[f, a, d]
                entries[slots[f, a, b]] += areas[f] * flow / 12.0
    return entries


def normal_blocks(entries: Array, normals: Array, mesh: Connectivity) -> Array:
    """Blocks of N N^T S N N^T for a scalar matrix S given by `entries`: S on the normal motion."""
    return np.asarray(_normal_blocks(entries, normals, mesh.row_start, mesh.columns))


@compiled
def _normal_blocks(entries, normals, row_start, columns):  # type: ignore[no-untyped-def]
    blocks = np.empty((len(columns), 3, 3))
    for i in range(len(row_start) - 1):
        for k in range(row_start[i], row_start[i + 1]):
            j = columns[k]
            overlap = entries[k] * (
                normals[i, 0] * normals[j, 0]
                + normals[i, 1] * normals[j, 1]
                + normals[i, 2] * normals[j, 2]
            )
            for p in range(3):
                for q in range(3):
                    blocks[k, p, q] = overlap * normals[i, p] * normals[j, q]
    return blocks


def block_product(blocks: Array, mesh: Connectivity, v: Array) -> Array:
    """The matrix of blocks given on the pattern of `mesh` times node vectors v (V, 3), (V, 3)."""
    return np.asarray(_block_product(blocks, mesh.row_start, mesh.columns, v))


@compiled
def _block_product(blocks, row_start, columns, v):  # type: ignore[no-untyped-def]
    product = np.zeros((len(row_start) - 1, 3))
    for i in range(len(row_start) - 1):
        for k in range(row_start[i], row_start[i + 1]):
            for p in range(3):
                for q in range(3):
                    product[i, p] += blocks[k, p, q] * v[columns[k], q]
    return product


def block_matrix(blocks: Array, mesh: Connectivity) -> bsr_array:
    """The (3V, 3V) matrix of blocks given on the pattern of `mesh`."""
    return bsr_array((blocks, mesh.columns, mesh.row_start), shape=(3 * mesh.n_nodes,) * 2)


def scalar_matrix(entries: Array, mesh: Connectivity) -> csr_array:
    """The (V, V) matrix of entries given on the pattern of `mesh`."""
    return csr_array((entries, mesh.columns, mesh.row_start), shape=(mesh.n_nodes,) * 2)
