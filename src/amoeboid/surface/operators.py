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


def mass(g: Geometry, mesh: Connectivity) -> Array:
    """Entries of the mass matrix on the pattern of `mesh` (P,).

    (M c)_i is the integral of phi_i c, exact for c linear on every triangle; rows and columns sum
    to the node areas.
    """
    return _mass(g.face_areas, mesh.slots, len(mesh.columns))


@compiled
def _mass(areas, slots, n_slots):  # type: ignore[no-untyped-def]
    entries = np.zeros(n_slots)
    for f in range(areas.shape[0]):
        for a in range(3):
            for b in range(3):
                entries[slots[f, a, b]] += areas[f] / (6.0 if a == b else 12.0)
    return entries


def tensile_stiffness(g: Geometry, mesh: Connectivity, stress: Array) -> Array:
    """Entries (P,) of the stiffness of normal motion under a tangential stress (F, 3, 3).

    (S u)_i is the integral of grad phi_i . stress . grad u, with compression left out: of each
    stress tensor only what pulls counts, so that the matrix is positive semidefinite.
    """
    return _tensile_stiffness(
        g.face_areas, g.face_normals, g.gradients, mesh.slots, len(mesh.columns), stress
    )


@compiled
def _tensile_stiffness(areas, normals, gradients, slots, n_slots, stress):  # type: ignore[no-untyped-def]
    entries = np.zeros(n_slots)
    t, s = np.empty(3), np.empty(3)
    along, across = np.empty(3), np.empty(3)
    for f in range(areas.shape[0]):
        # tangent basis: along the gradient of corner 0, and across
        length = np.sqrt(
            gradients[f, 0, 0] ** 2 + gradients[f, 0, 1] ** 2 + gradients[f, 0, 2] ** 2
        )
        for d in range(3):
            t[d] = gradients[f, 0, d] / length
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            s[d] = normals[f, p] * t[q] - normals[f, q] * t[p]
        tt, ts, ss = 0.0, 0.0, 0.0
        for p in range(3):
            for q in range(3):
                tt += t[p] * stress[f, p, q] * t[q]
                ts += t[p] * stress[f, p, q] * s[q]
                ss += s[p] * stress[f, p, q] * s[q]
        mean, half = 0.5 * (tt + ss), 0.5 * (tt - ss)
        radius = np.sqrt(half * half + ts * ts)
        high, low = max(mean + radius, 0.0), max(mean - radius, 0.0)
        if radius > 0.0:
            even, uneven = 0.5 * (high + low), 0.5 * (high - low) / radius
            tt, ts, ss = even + uneven * half, uneven * ts, even - uneven * half
        else:
            tt, ts, ss = high, 0.0, high
        for a in range(3):
            along[a], across[a] = 0.0, 0.0
            for d in range(3):
                along[a] += t[d] * gradients[f, a, d]
                across[a] += s[d] * gradients[f, a, d]
        for a in range(3):
            for b in range(3):
                entries[slots[f, a, b]] += areas[f] * (
                    tt * along[a] * along[b]
                    + ts * (along[a] * across[b] + across[a] * along[b])
                    + ss * across[a] * across[b]
                )
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
    total = np.empty(3)
    for f in range(areas.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            total[d] = u[i, d] + u[j, d] + u[k, d]
        for b in range(3):
            v = faces[f, b]
            for a in range(3):
                # integral of phi_b u over the triangle, u linear: area (sum of u + u_b) / 12
                flow = 0.0
                for d in range(3):
                    flow += (total[d] + u[v, d]) * gradients[f, a, d]
                entries[slots[f, a, b]] += areas[f] * flow / 12.0
    return entries


def normal_projection(entries: Array, normals: Array, mesh: Connectivity) -> Array:
    """Entries (P,) of N^T S N for a scalar matrix S given by `entries`, N the node normals:
    n_i . (S (n u))_i for a normal motion u."""
    return np.asarray(_normal_projection(entries, normals, mesh.row_start, mesh.columns))


@compiled
def _normal_projection(entries, normals, row_start, columns):  # type: ignore[no-untyped-def]
    projected = np.empty(len(columns))
    for i in range(len(row_start) - 1):
        for k in range(row_start[i], row_start[i + 1]):
            j = columns[k]
            projected[k] = entries[k] * (
                normals[i, 0] * normals[j, 0]
                + normals[i, 1] * normals[j, 1]
                + normals[i, 2] * normals[j, 2]
            )
    return projected


def normal_blocks(entries: Array, normals: Array, mesh: Connectivity) -> Array:
    """Blocks (P, 3, 3) of N S N^T for a scalar matrix S given by `entries`, N the node normals."""
    return np.asarray(_normal_blocks(entries, normals, mesh.row_start, mesh.columns))


@compiled
def _normal_blocks(entries, normals, row_start, columns):  # type: ignore[no-untyped-def]
    blocks = np.empty((len(columns), 3, 3))
    for i in range(len(row_start) - 1):
        for k in range(row_start[i], row_start[i + 1]):
            for p in range(3):
                for q in range(3):
                    blocks[k, p, q] = entries[k] * normals[i, p] * normals[columns[k], q]
    return blocks


def product(entries: Array, mesh: Connectivity, x: Array) -> Array:
    """The matrix of entries given on the pattern of `mesh` times node values x (V,), (V,)."""
    return np.asarray(_product(entries, mesh.row_start, mesh.columns, x))


@compiled
def _product(entries, row_start, columns, x):  # type: ignore[no-untyped-def]
    y = np.zeros(len(row_start) - 1)
    for i in range(len(row_start) - 1):
        for k in range(row_start[i], row_start[i + 1]):
            y[i] += entries[k] * x[columns[k]]
    return y


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
