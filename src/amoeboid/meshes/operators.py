"""Matrices over the nodes of a mesh: products, stiffness, normal projection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import Geometry
from amoeboid.numerics.compiled import compiled

if TYPE_CHECKING:
    from scipy.sparse import bsr_array, csr_array


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
            x, y, z = gradients[f, a, 0], gradients[f, a, 1], gradients[f, a, 2]
            for b in range(3):
                p, q, w = gradients[f, b, 0], gradients[f, b, 1], gradients[f, b, 2]
                entries[slots[f, a, b]] += areas[f] * (x * p + y * q + z * w)
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
        share = areas[f] / 12.0
        for a in range(3):
            for b in range(3):
                entries[slots[f, a, b]] += 2.0 * share if a == b else share
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
    for f in range(areas.shape[0]):
        # tangent basis: t along the gradient of corner 0, and s across
        g, s = gradients[f], stress[f]
        over = 1.0 / np.sqrt(g[0, 0] ** 2 + g[0, 1] ** 2 + g[0, 2] ** 2)
        tx, ty, tz = g[0, 0] * over, g[0, 1] * over, g[0, 2] * over
        nx, ny, nz = normals[f, 0], normals[f, 1], normals[f, 2]
        sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        ax = s[0, 0] * tx + s[0, 1] * ty + s[0, 2] * tz
        ay = s[1, 0] * tx + s[1, 1] * ty + s[1, 2] * tz
        az = s[2, 0] * tx + s[2, 1] * ty + s[2, 2] * tz
        bx = s[0, 0] * sx + s[0, 1] * sy + s[0, 2] * sz
        by = s[1, 0] * sx + s[1, 1] * sy + s[1, 2] * sz
        bz = s[2, 0] * sx + s[2, 1] * sy + s[2, 2] * sz
        tt, ss = tx * ax + ty * ay + tz * az, sx * bx + sy * by + sz * bz
        ts = tx * bx + ty * by + tz * bz
        mean, half = 0.5 * (tt + ss), 0.5 * (tt - ss)
        radius = np.sqrt(half * half + ts * ts)
        if mean < radius:  # compression in one direction, or in both
            high = max(mean + radius, 0.0)
            share = 0.5 * high / radius if radius > 0.0 else 0.0
            tt, ts, ss = 0.5 * high + share * half, share * ts, 0.5 * high - share * half
        for a in range(3):
            along = tx * g[a, 0] + ty * g[a, 1] + tz * g[a, 2]
            across = sx * g[a, 0] + sy * g[a, 1] + sz * g[a, 2]
            first = areas[f] * (tt * along + ts * across)
            second = areas[f] * (ts * along + ss * across)
            for b in range(3):
                entries[slots[f, a, b]] += first * (
                    tx * g[b, 0] + ty * g[b, 1] + tz * g[b, 2]
                ) + second * (sx * g[b, 0] + sy * g[b, 1] + sz * g[b, 2])
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
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y = u[i, 0] + u[j, 0] + u[k, 0], u[i, 1] + u[j, 1] + u[k, 1]
        z = u[i, 2] + u[j, 2] + u[k, 2]
        for b in range(3):
            # integral of phi_b u over the triangle, u linear: area (sum of u + u_b) / 12
            v, share = faces[f, b], areas[f] / 12.0
            p, q, w = share * (x + u[v, 0]), share * (y + u[v, 1]), share * (z + u[v, 2])
            for a in range(3):
                flow = p * gradients[f, a, 0] + q * gradients[f, a, 1] + w * gradients[f, a, 2]
                entries[slots[f, a, b]] += flow
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
    return normal_blocks_on(entries, normals, mesh.row_start, mesh.columns)


def normal_blocks_on(entries: Array, normals: Array, row_start: Index, columns: Index) -> Array:
    """The same on any pattern in compressed row form."""
    return np.asarray(_normal_blocks(entries, normals, row_start, columns))


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
    y = np.empty(len(row_start) - 1)
    for i in range(len(row_start) - 1):
        total = 0.0
        for k in range(row_start[i], row_start[i + 1]):
            total += entries[k] * x[columns[k]]
        y[i] = total
    return y


def block_product(blocks: Array, mesh: Connectivity, v: Array) -> Array:
    """The matrix of blocks given on the pattern of `mesh` times node vectors v (V, 3), (V, 3)."""
    return np.asarray(_block_product(blocks, mesh.row_start, mesh.columns, v))


@compiled
def _block_product(blocks, row_start, columns, v):  # type: ignore[no-untyped-def]
    product = np.empty((len(row_start) - 1, 3))
    for i in range(len(row_start) - 1):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(row_start[i], row_start[i + 1]):
            p, q, w = v[columns[k], 0], v[columns[k], 1], v[columns[k], 2]
            x += blocks[k, 0, 0] * p + blocks[k, 0, 1] * q + blocks[k, 0, 2] * w
            y += blocks[k, 1, 0] * p + blocks[k, 1, 1] * q + blocks[k, 1, 2] * w
            z += blocks[k, 2, 0] * p + blocks[k, 2, 1] * q + blocks[k, 2, 2] * w
        product[i, 0], product[i, 1], product[i, 2] = x, y, z
    return product


def block_matrix(blocks: Array, mesh: Connectivity) -> bsr_array:
    """The (3V, 3V) matrix of blocks given on the pattern of `mesh`."""
    from scipy.sparse import bsr_array  # not for every run that imports this

    return bsr_array((blocks, mesh.columns, mesh.row_start), shape=(3 * mesh.n_nodes,) * 2)


def scalar_matrix(entries: Array, mesh: Connectivity) -> csr_array:
    """The (V, V) matrix of entries given on the pattern of `mesh`."""
    from scipy.sparse import csr_array

    return csr_array((entries, mesh.columns, mesh.row_start), shape=(mesh.n_nodes,) * 2)
