"""Areas, volume, normals and their exact derivatives on a closed triangulation.

Nodes r (V, 3), faces (F, 3), float64. Lengths in the unit of r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled, nested
from amoeboid.surface.mesh import Index

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """What one shape gives to all operators.

    `face_areas` (F,), `face_normals` (F, 3) outward, `gradients` (F, 3, 3): surface gradient of
    the hat function of corner a on face f, `gradients[f, a]` [1/length]; `node_areas` (V,): a
    third of the areas around each node, they sum to the area; `dual_areas` (V,): the share of each
    node as the stiffness matrix sees it, the part of the surface that is nearest to it, and they
    sum to the area, too (M. Meyer et al., in Visualization and Mathematics III, 35, 2003; with the
    circumcenters of obtuse triangles where they are, outside, so that a share can be negative);
    `normals` (V, 3): unit vectors, exact where the node and its neighbors lie on a sphere (N. Max,
    J. Graphics Tools 4, 1, 1999).

    On nodes of a sphere of radius R the derivative of the area along the normals is 2/R dual_areas,
    whatever the mesh.
    """

    face_areas: Array
    face_normals: Array
    gradients: Array
    node_areas: Array
    dual_areas: Array
    normals: Array

    @property
    def area(self) -> float:
        """Surface area [length^2]."""
        return float(self.face_areas.sum())


def geometry(r: Array, faces: Index) -> Geometry:
    """The geometry of nodes r on `faces`."""
    return Geometry(*_geometry(r, faces))


@nested
def _dual_shares(area, squares, share):  # type: ignore[no-untyped-def]
    # squares[a]: that of the edge opposite to corner a; dot: of the two edges that meet in a
    for a in range(3):
        share[a] = 0.0
        for b in ((a + 1) % 3, (a + 2) % 3):
            dot = 0.5 * (squares[0] + squares[1] + squares[2]) - squares[b]
            share[a] += 0.0625 * squares[b] * dot / area


@compiled
def _geometry(r, faces):  # type: ignore[no-untyped-def]
    n_faces, n_nodes = faces.shape[0], r.shape[0]
    areas = np.empty(n_faces)
    face_normals = np.empty((n_faces, 3))
    gradients = np.empty((n_faces, 3, 3))
    node_areas, dual_areas = np.zeros(n_nodes), np.zeros(n_nodes)
    normals = np.zeros((n_nodes, 3))
    n, x = np.empty(3), np.empty((3, 3))
    squares, share = np.empty(3), np.empty(3)
    for f in range(n_faces):
        for a in range(3):
            for d in range(3):
                x[a, d] = r[faces[f, a], d]
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            n[d] = (x[1, p] - x[0, p]) * (x[2, q] - x[0, q]) - (x[1, q] - x[0, q]) * (
                x[2, p] - x[0, p]
            )
        square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
        twice = np.sqrt(square)
        areas[f] = 0.5 * twice
        over_twice, over_square = 1.0 / twice, 1.0 / square
        for d in range(3):
            face_normals[f, d] = n[d] * over_twice
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            squares[a] = 0.0
            for d in range(3):
                p, q = (d + 1) % 3, (d + 2) % 3
                # n x (opposite edge) / (2 area)
                gradients[f, a, d] = (
                    n[p] * (x[c, q] - x[b, q]) - n[q] * (x[c, p] - x[b, p])
                ) * over_square
                squares[a] += (x[c, d] - x[b, d]) ** 2
        _dual_shares(areas[f], squares, share)
        for a in range(3):
            node_areas[faces[f, a]] += areas[f] / 3.0
            dual_areas[faces[f, a]] += share[a]
            weight = 1.0 / (squares[(a + 1) % 3] * squares[(a + 2) % 3])
            for d in range(3):
                normals[faces[f, a], d] += weight * n[d]
    for v in range(n_nodes):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for d in range(3):
            normals[v, d] /= length
    return areas, face_normals, gradients, node_areas, dual_areas, normals


def normal_part(v: Array, normals: Array) -> Array:
    """The part of node vectors v (V, 3) along the unit vectors `normals` (V, 3)."""
    return np.asarray(_normal_part(np.ascontiguousarray(v), normals))


@compiled
def _normal_part(v, normals):  # type: ignore[no-untyped-def]
    part = np.empty(v.shape)
    for i in range(v.shape[0]):
        along = v[i, 0] * normals[i, 0] + v[i, 1] * normals[i, 1] + v[i, 2] * normals[i, 2]
        for d in range(3):
            part[i, d] = along * normals[i, d]
    return part


def face_vectors(r: Array, faces: Index) -> Array:
    """Area vectors of the triangles (F, 3): half the cross product of two edges [length^2]."""
    return np.asarray(_face_vectors(r, faces))


@compiled
def _face_vectors(r, faces):  # type: ignore[no-untyped-def]
    vectors = np.empty((faces.shape[0], 3))
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            vectors[f, d] = 0.5 * (
                (r[j, p] - r[i, p]) * (r[k, q] - r[i, q])
                - (r[j, q] - r[i, q]) * (r[k, p] - r[i, p])
            )
    return vectors


def area(r: Array, faces: Index) -> float:
    """Surface area [length^2]."""
    vectors = face_vectors(r, faces)
    return float(np.sqrt(np.einsum("fi,fi->f", vectors, vectors)).sum())


def area_along(r: Array, faces: Index, direction: Array) -> tuple[float, float]:
    """Surface area, and its derivative as the nodes move along `direction` (V, 3)."""
    return _area_along(r, faces, direction)


@compiled
def _area_along(r, faces, direction):  # type: ignore[no-untyped-def]
    u, v, n = np.empty(3), np.empty(3), np.empty(3)
    du, dv, dn = np.empty(3), np.empty(3), np.empty(3)
    total, growth = 0.0, 0.0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            u[d], v[d] = r[j, d] - r[i, d], r[k, d] - r[i, d]
            du[d], dv[d] = direction[j, d] - direction[i, d], direction[k, d] - direction[i, d]
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            n[d] = u[p] * v[q] - u[q] * v[p]
            dn[d] = du[p] * v[q] - du[q] * v[p] + u[p] * dv[q] - u[q] * dv[p]
        twice = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        total += 0.5 * twice
        if twice > 0.0:
            growth += 0.5 * (n[0] * dn[0] + n[1] * dn[1] + n[2] * dn[2]) / twice
    return total, growth


def node_areas(r: Array, faces: Index) -> Array:
    """A third of the areas of the triangles around each node (V,) [length^2]."""
    return np.asarray(_node_areas(r, faces))


@compiled
def _node_areas(r, faces):  # type: ignore[no-untyped-def]
    node_areas = np.zeros(r.shape[0])
    u, v = np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            u[d], v[d] = r[j, d] - r[i, d], r[k, d] - r[i, d]
        square = 0.0
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            square += (u[p] * v[q] - u[q] * v[p]) ** 2
        share = np.sqrt(square) / 6.0
        node_areas[i] += share
        node_areas[j] += share
        node_areas[k] += share
    return node_areas


def volume(r: Array, faces: Index) -> float:
    """Enclosed volume, (1/3) of the integral of r.n [length^3]; positive if oriented outward."""
    return float(_volume_moments(r, faces)[0])


def volume_centroid(r: Array, faces: Index) -> Array:
    """Center of the enclosed volume (3,) [length]."""
    moments = _volume_moments(r, faces)
    return np.asarray(moments[1:] / moments[0])


@compiled
def _volume_moments(r, faces):  # type: ignore[no-untyped-def]
    # volume and first moments of the tetrahedra between the triangles and the origin
    volume, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        sixfold = (
            r[i, 0] * (r[j, 1] * r[k, 2] - r[j, 2] * r[k, 1])
            + r[i, 1] * (r[j, 2] * r[k, 0] - r[j, 0] * r[k, 2])
            + r[i, 2] * (r[j, 0] * r[k, 1] - r[j, 1] * r[k, 0])
        )
        volume += sixfold
        mx += sixfold * (r[i, 0] + r[j, 0] + r[k, 0])
        my += sixfold * (r[i, 1] + r[j, 1] + r[k, 1])
        mz += sixfold * (r[i, 2] + r[j, 2] + r[k, 2])
    return np.array([volume / 6.0, mx / 24.0, my / 24.0, mz / 24.0])


def triangle_quality(r: Array, faces: Index) -> Array:
    """Quality of the triangles, 4 sqrt(3) area / (sum of squared edges), (F,): 1 is equilateral."""
    return np.asarray(_triangle_quality(r, faces))


@compiled
def _triangle_quality(r, faces):  # type: ignore[no-untyped-def]
    quality = np.empty(faces.shape[0])
    u, v = np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        uu, uv, vv = 0.0, 0.0, 0.0
        for d in range(3):
            u[d], v[d] = r[j, d] - r[i, d], r[k, d] - r[i, d]
            uu += u[d] * u[d]
            uv += u[d] * v[d]
            vv += v[d] * v[d]
        twice = np.sqrt(max(uu * vv - uv * uv, 0.0))
        squares = 2.0 * (uu + vv - uv)
        quality[f] = 2.0 * np.sqrt(3.0) * twice / squares if squares > 0.0 else 0.0
    return quality


def mesh_quality(r: Array, faces: Index) -> float:
    """Smallest quality of a triangle."""
    return float(triangle_quality(r, faces).min())


def extreme_edges(r: Array, faces: Index) -> tuple[float, float]:
    """Lengths of the shortest and the longest edge."""
    return _extreme_edges(r, faces)


@compiled
def _extreme_edges(r, faces):  # type: ignore[no-untyped-def]
    low, high = np.inf, 0.0
    for f in range(faces.shape[0]):
        for a in range(3):
            i, j = faces[f, a], faces[f, (a + 1) % 3]
            square = 0.0
            for d in range(3):
                square += (r[j, d] - r[i, d]) ** 2
            low, high = min(low, square), max(high, square)
    return np.sqrt(low), np.sqrt(high)


def weighted_area_gradient(g: Geometry, faces: Index, weights: Array) -> Array:
    """Derivative of sum_f weights[f] area_f with respect to the nodes, (V, 3) [weight length]."""
    return np.asarray(_scattered(weights * g.face_areas, g.gradients, faces, len(g.normals)))


def area_gradient(g: Geometry, faces: Index) -> Array:
    """Derivative of the area with respect to the nodes, (V, 3) [length]; equals L r."""
    return weighted_area_gradient(g, faces, np.ones(len(faces)))


def scatter(corner_values: Array, faces: Index, n_nodes: int) -> Array:
    """Sum values given per face and corner (F, 3, d) to the nodes (V, d)."""
    return np.asarray(_scattered(np.ones(len(faces)), corner_values, faces, n_nodes))


@compiled
def _scattered(weights, corner_values, faces, n_nodes):  # type: ignore[no-untyped-def]
    sums = np.zeros((n_nodes, corner_values.shape[2]))
    for f in range(faces.shape[0]):
        for a in range(3):
            for d in range(corner_values.shape[2]):
                sums[faces[f, a], d] += weights[f] * corner_values[f, a, d]
    return sums
