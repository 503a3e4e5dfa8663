"""Areas, volume, normals and their exact derivatives on a closed triangulation.

Nodes r (V, 3), faces (F, 3), float64. Lengths in the unit of r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.surface.mesh import Index

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """What one shape gives to all operators.

    `face_areas` (F,), `face_normals` (F, 3) outward, `gradients` (F, 3, 3): surface gradient of
    the hat function of corner a on face f, `gradients[f, a]` [1/length]; `node_areas` (V,): a
    third of the areas around each node, they sum to the area; `normals` (V, 3): unit vectors along
    the volume gradient.
    """

    face_areas: Array
    face_normals: Array
    gradients: Array
    node_areas: Array
    normals: Array

    @property
    def area(self) -> float:
        """Surface area [length^2]."""
        return float(self.face_areas.sum())


def geometry(r: Array, faces: Index) -> Geometry:
    """The geometry of nodes r on `faces`."""
    return Geometry(*_geometry(r, faces))


@compiled
def _geometry(r, faces):  # type: ignore[no-untyped-def]
    n_faces, n_nodes = faces.shape[0], r.shape[0]
    areas = np.empty(n_faces)
    face_normals = np.empty((n_faces, 3))
    gradients = np.empty((n_faces, 3, 3))
    node_areas = np.zeros(n_nodes)
    normals = np.zeros((n_nodes, 3))
    n = np.empty(3)
    for f in range(n_faces):
        i, j, k = faces[f]
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            n[d] = (r[j, p] - r[i, p]) * (r[k, q] - r[i, q]) - (r[j, q] - r[i, q]) * (
                r[k, p] - r[i, p]
            )
        twice = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        areas[f] = 0.5 * twice
        for d in range(3):
            face_normals[f, d] = n[d] / twice
        for a in range(3):
            b, c = faces[f, (a + 1) % 3], faces[f, (a + 2) % 3]
            for d in range(3):
                p, q = (d + 1) % 3, (d + 2) % 3
                # n x (opposite edge) / (2 area)
                gradients[f, a, d] = (
                    n[p] * (r[c, q] - r[b, q]) - n[q] * (r[c, p] - r[b, p])
                ) / twice**2
            node_areas[faces[f, a]] += areas[f] / 3.0
            for d in range(3):
                normals[faces[f, a], d] += n[d]
    for v in range(n_nodes):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for d in range(3):
            normals[v, d] /= length
    return areas, face_normals, gradients, node_areas, normals


def normal_part(v: Array, normals: Array) -> Array:
    """The part of node vectors v (V, 3) along the unit vectors `normals` (V, 3)."""
    return np.asarray(np.einsum("vi,vi->v", v, normals)[:, None] * normals)


def face_vectors(r: Array, faces: Index) -> Array:
    """Area vectors of the triangles (F, 3): half the cross product of two edges [length^2]."""
    a, b, c = r[faces[:, 0]], r[faces[:, 1]], r[faces[:, 2]]
    return 0.5 * np.cross(b - a, c - a)


def area(r: Array, faces: Index) -> float:
    """Surface area [length^2]."""
    return float(np.linalg.norm(face_vectors(r, faces), axis=1).sum())


def volume(r: Array, faces: Index) -> float:
    """Enclosed volume, (1/3) of the integral of r.n [length^3]; positive if oriented outward."""
    a, b, c = r[faces[:, 0]], r[faces[:, 1]], r[faces[:, 2]]
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0)


def volume_centroid(r: Array, faces: Index) -> Array:
    """Center of the enclosed volume (3,) [length]."""
    a, b, c = r[faces[:, 0]], r[faces[:, 1]], r[faces[:, 2]]
    tetrahedra = np.einsum("fi,fi->f", a, np.cross(b, c)) / 6.0
    return np.asarray(tetrahedra @ (a + b + c) / (4.0 * tetrahedra.sum()))


def triangle_quality(corners: Array) -> Array:
    """4 sqrt(3) area / (sum of squared edges) of triangles (n, 3, 3): 1 is equilateral, (n,)."""
    edges = corners - np.roll(corners, 1, axis=1)
    twice = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return np.asarray(2 * np.sqrt(3) * twice / np.einsum("fai,fai->f", edges, edges))


def mesh_quality(r: Array, faces: Index) -> float:
    """Smallest quality of a triangle."""
    return float(triangle_quality(r[faces]).min())


def weighted_area_gradient(g: Geometry, faces: Index, weights: Array) -> Array:
    """Derivative of sum_f weights[f] area_f with respect to the nodes, (V, 3) [weight length]."""
    contributions = (weights * g.face_areas)[:, None, None] * g.gradients
    return scatter(contributions, faces, len(g.normals))


def area_gradient(g: Geometry, faces: Index) -> Array:
    """Derivative of the area with respect to the nodes, (V, 3) [length]; equals L r."""
    return weighted_area_gradient(g, faces, np.ones(len(faces)))


def volume_gradient(r: Array, faces: Index) -> Array:
    """Derivative of the volume with respect to the nodes, (V, 3) [length^2]."""
    third = face_vectors(r, faces) / 3.0
    return scatter(np.repeat(third[:, None, :], 3, axis=1), faces, len(r))


def scatter(corner_values: Array, faces: Index, n_nodes: int) -> Array:
    """Sum values given per face and corner (F, 3, d) to the nodes (V, d)."""
    flat = faces.ravel()
    columns = corner_values.reshape(len(flat), -1)
    return np.column_stack(
        [np.bincount(flat, weights=column, minlength=n_nodes) for column in columns.T]
    )
