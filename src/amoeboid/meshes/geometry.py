"""Areas, volume, normals and their exact derivatives on a closed triangulation.

Nodes r (V, 3), faces (F, 3), float64. Lengths in the unit of r.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.numerics.compiled import compiled

# A mesh with worse triangles than this (1 is equilateral) is no longer a discretization.
MIN_QUALITY = 0.02


# Where the normals at the corners of a triangle and its own are farther apart than this cosine, or
# the surface above it has more or less area by more than this share, no surface is resolved.
MIN_COSINE, MAX_LACKING = 0.5, 0.5


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

    @cached_property
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
    node_areas, dual_areas = np.zeros(n_nodes), np.zeros(n_nodes)
    normals = np.zeros((n_nodes, 3))
    # numbers instead of small arrays: those would not be kept in registers
    for f in range(n_faces):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        # edges opposite to the corners i, j, k
        ux, uy, uz = r[k, 0] - r[j, 0], r[k, 1] - r[j, 1], r[k, 2] - r[j, 2]
        vx, vy, vz = r[i, 0] - r[k, 0], r[i, 1] - r[k, 1], r[i, 2] - r[k, 2]
        wx, wy, wz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
        ww = wx * wx + wy * wy + wz * wz
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        square = nx * nx + ny * ny + nz * nz
        twice = np.sqrt(square)
        over_twice, over_square = 1.0 / twice, 1.0 / square
        areas[f] = 0.5 * twice
        face_normals[f, 0] = nx * over_twice
        face_normals[f, 1] = ny * over_twice
        face_normals[f, 2] = nz * over_twice
        third = areas[f] / 3.0
        for a, x, y, z in ((0, ux, uy, uz), (1, vx, vy, vz), (2, wx, wy, wz)):
            # n x (opposite edge) / (2 area)
            gradients[f, a, 0] = (ny * z - nz * y) * over_square
            gradients[f, a, 1] = (nz * x - nx * z) * over_square
            gradients[f, a, 2] = (nx * y - ny * x) * over_square
        for v, opposite, p, q in ((i, uu, vv, ww), (j, vv, ww, uu), (k, ww, uu, vv)):
            node_areas[v] += third
            # an eighth of the square of each edge at the corner times the cotangent opposite to it
            shares = p * (opposite + q - p) + q * (opposite + p - q)
            dual_areas[v] += 0.0625 * over_twice * shares
            weight = 1.0 / (p * q)
            normals[v, 0] += weight * nx
            normals[v, 1] += weight * ny
            normals[v, 2] += weight * nz
    for v in range(n_nodes):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for d in range(3):
            normals[v, d] /= length
    return areas, face_normals, gradients, node_areas, dual_areas, normals


def smooth_area(r: Array, faces: Index, g: Geometry | None = None) -> float:
    """Area of the smooth surface through the nodes r [length^2], to fourth order in edge lengths.

    Its height h above a triangle is the quadratic that vanishes at the corners and has the slopes
    of the normals there. The triangles have less area by the integral of h H - |grad h|^2/2, the
    variation of the area to second order; where that is much, the mesh resolves no surface. `g`:
    the geometry of these nodes, if it is known.
    """
    g = geometry(r, faces) if g is None else g
    return float(_smooth_area(r, faces, g.face_areas, g.face_normals, g.gradients, g.normals))


@compiled
def _smooth_area(r, faces, areas, face_normals, gradients, normals):  # type: ignore[no-untyped-def]
    total, slopes = 0.0, np.empty((3, 3))
    for f in range(faces.shape[0]):
        curvature, squares, middles = 0.0, 0.0, 0.0
        for a in range(3):
            along = 0.0
            for d in range(3):
                along += normals[faces[f, a], d] * face_normals[f, d]
            along = max(along, MIN_COSINE)
            for d in range(3):
                slopes[a, d] = face_normals[f, d] - normals[faces[f, a], d] / along
                curvature -= slopes[a, d] * gradients[f, a, d]
                squares += slopes[a, d] * slopes[a, d]
        for d in range(3):
            squares += (slopes[0, d] + slopes[1, d] + slopes[2, d]) ** 2
        for a in range(3):
            b = (a + 1) % 3
            for d in range(3):
                edge = r[faces[f, b], d] - r[faces[f, a], d]
                middles += (slopes[a, d] - slopes[b, d]) * edge / 8.0
        # squares/12: the mean over a triangle of the square of what is linear
        lacking = curvature * middles / 3.0 - 0.5 * squares / 12.0
        total += areas[f] * (1.0 + min(max(lacking, -MAX_LACKING), MAX_LACKING))
    return total


def area_centroid(r: Array, g: Geometry) -> Array:
    """Center of the surface (3,) [length], of the nodes weighted with their areas."""
    return np.asarray(g.node_areas @ r / g.area)


def normal_part(v: Array, normals: Array) -> Array:
    """The part of node vectors v (V, 3) along the unit vectors `normals` (V, 3)."""
    (x, y, z), (n_x, n_y, n_z) = v.T, normals.T
    return (x * n_x + y * n_y + z * n_z)[:, None] * normals


def face_vectors(r: Array, faces: Index) -> Array:
    """Area vectors of the triangles (F, 3): half the cross product of two edges [length^2]."""
    return np.asarray(_face_vectors(r, faces))


@compiled
def _face_vectors(r, faces):  # type: ignore[no-untyped-def]
    vectors = np.empty((faces.shape[0], 3))
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
        vectors[f, 0] = 0.5 * (uy * vz - uz * vy)
        vectors[f, 1] = 0.5 * (uz * vx - ux * vz)
        vectors[f, 2] = 0.5 * (ux * vy - uy * vx)
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
    total, growth, e = 0.0, 0.0, direction
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
        # how these edges change
        ax, ay, az = e[j, 0] - e[i, 0], e[j, 1] - e[i, 1], e[j, 2] - e[i, 2]
        bx, by, bz = e[k, 0] - e[i, 0], e[k, 1] - e[i, 1], e[k, 2] - e[i, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        dnx = ay * vz - az * vy + uy * bz - uz * by
        dny = az * vx - ax * vz + uz * bx - ux * bz
        dnz = ax * vy - ay * vx + ux * by - uy * bx
        twice = np.sqrt(nx * nx + ny * ny + nz * nz)
        total += 0.5 * twice
        if twice > 0.0:
            growth += 0.5 * (nx * dnx + ny * dny + nz * dnz) / twice
    return total, growth


def node_areas(r: Array, faces: Index) -> Array:
    """A third of the areas of the triangles around each node (V,) [length^2]."""
    return np.asarray(_node_areas(r, faces))


@compiled
def _node_areas(r, faces):  # type: ignore[no-untyped-def]
    node_areas = np.zeros(r.shape[0])
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        share = np.sqrt(nx * nx + ny * ny + nz * nz) / 6.0
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
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
        vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
        uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
        uv = ux * vx + uy * vy + uz * vz
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
            x, y, z = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
            square = x * x + y * y + z * z
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


def equilateral_edge_length(area: float, n_faces: int) -> float:
    """Edge length [L] of `n_faces` equilateral triangles of a total area."""
    return math.sqrt(4.0 * area / (math.sqrt(3.0) * n_faces))
