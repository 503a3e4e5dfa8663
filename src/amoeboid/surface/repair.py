"""Mends a user's surface on request: joins, orientation, slivers, an even mesh.

What is changed is told. Holes, handles, several pieces and parts that cross are left as they are,
for `imported.check_surface` to refuse: what belongs there is not known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from amoeboid.numerics.compiled import compiled, nested
from amoeboid.surface.geometry import area, mesh_quality, triangle_quality, volume
from amoeboid.surface.imported import (
    FEWEST_NODES,
    MOST_NODES,
    check_mesh,
    check_size,
    check_triangles,
    joined,
)
from amoeboid.surface.mesh import Index
from amoeboid.surface.model import even_edge_length
from amoeboid.surface.remeshing import POOR_QUALITY, disorder, evened

Array = NDArray[np.float64]

# Nodes on a surface remeshed with edges of the length of that many even triangles, measured.
EXCESS = 1.27


def repaired(
    r: Array, faces: Index, n_nodes: int, name: str
) -> tuple[Array, Index, tuple[str, ...]]:
    """The surface with all mended that can be, and what was changed, in words.

    A mesh out of order becomes one of about `n_nodes`.

    Points that coincide up to rounding are joined; triangles without area in their numbering,
    repeated ones and unused points removed; triangles turned to look outward. If the mesh then has
    slivers or edges of very different lengths it is remeshed. Raises InvalidInput, beginning with
    `name`, for what cannot be mended.
    """
    check_size(r, name)
    r, faces, changes = joined(r, faces)
    r, faces, removed = _cleaned(r, faces)
    faces, turned = _oriented(r, faces)
    changes = (*changes, *removed, *turned)
    check_mesh(r, faces, name)
    if volume(r - r.mean(axis=0), faces) < 0:
        faces = faces[:, ::-1]
        changes = (*changes, "turned all triangles round, the surface was inside out")
    r, faces, remeshed = _even(r, np.ascontiguousarray(faces), n_nodes, name)
    return r, faces, (*changes, *remeshed)


def _cleaned(r: Array, faces: Index) -> tuple[Array, Index, list[str]]:
    """Without triangles that use a point twice or are there twice, and without unused points."""
    changes = []
    corners = np.sort(faces, axis=1)
    proper = (corners[:, 0] < corners[:, 1]) & (corners[:, 1] < corners[:, 2])
    _, first = np.unique(corners, axis=0, return_index=True)
    once = np.zeros(len(faces), dtype=bool)
    once[first] = True
    kept = proper & once
    if not np.all(kept) and np.any(kept):
        changes.append(f"removed {np.sum(~kept)} triangles without area, or there twice")
        faces = faces[kept]
    used, which = np.unique(faces, return_inverse=True)
    if len(used) < len(r):
        changes.append(f"removed {len(r) - len(used)} points that no triangle uses")
    return r[used], which.reshape(-1, 3), changes


def _oriented(r: Array, faces: Index) -> tuple[Index, list[str]]:
    """Every triangle turned like its neighbors, if each edge has two and that is possible."""
    n, count = len(r), len(faces)
    tails, heads = faces.T.ravel(), np.roll(faces, -1, axis=1).T.ravel()
    face = np.tile(np.arange(count), 3)
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    order = np.argsort(low * n + high, kind="stable")
    pairs = order.reshape(-1, 2) if len(order) % 2 == 0 else order[:0].reshape(-1, 2)
    a, b = pairs.T
    if len(pairs) == 0 or np.any(low[a] != low[b]) or np.any(high[a] != high[b]):
        return faces, []
    # every triangle twice, as it is and turned; neighbors that agree are joined
    opposed = tails[a] == tails[b]
    here, there = face[a], face[b] + count * opposed
    mirrored_here, mirrored_there = here + count, face[b] + count * ~opposed
    links = (np.concatenate([here, mirrored_here]), np.concatenate([there, mirrored_there]))
    graph = coo_array((np.ones(2 * len(a)), links), shape=(2 * count, 2 * count))
    label = connected_components(graph, directed=False)[1]
    as_is, turned = label[:count], label[count:]
    if np.any(as_is == turned):
        return faces, []  # one-sided
    # of both ways of a piece the one that turns fewer triangles
    sizes = np.bincount(as_is, minlength=int(label.max()) + 1)
    turns = sizes[turned] > sizes[as_is]
    ties = (sizes[turned] == sizes[as_is]) & (turned < as_is)
    turns |= ties
    if not turns.any():
        return faces, []
    faces = np.where(turns[:, None], faces[:, ::-1], faces)
    return faces, [f"turned {turns.sum()} triangles round, to look out where their neighbors do"]


def _even(r: Array, faces: Index, n_nodes: int, name: str) -> tuple[Array, Index, list[str]]:
    """The surface on an even mesh of about `n_nodes`, if its own is out of order."""
    size = np.ptp(r, axis=0).max()
    own_length = even_edge_length(area(r, faces), len(faces))
    in_order = disorder(r, faces, own_length) <= 1.0
    if in_order and FEWEST_NODES <= len(r) <= MOST_NODES:
        return r, faces, []
    # first as it is but for slivers, so that a crossing is seen; then coarser or finer
    fine, fine_faces = (r, faces) if in_order else evened(r, faces, own_length)
    check_triangles(fine / size, fine_faces, name)
    wanted = even_edge_length(area(fine, fine_faces), 2 * n_nodes - 4) * np.sqrt(EXCESS)
    new, new_faces = evened(fine, fine_faces, float(wanted))
    moved = _distance(new, r, faces) / size
    change = volume(new, new_faces) / volume(r, faces) - 1.0
    slivers = int(np.sum(triangle_quality(r, faces) < POOR_QUALITY))
    told = (
        f"remeshed {len(r)} points as {len(new)} ({slivers} of {len(faces)} triangles had a "
        f"quality below {POOR_QUALITY:g}, the worst {mesh_quality(r, faces):.2g}, now "
        f"{mesh_quality(new, new_faces):.2g}); the points lie within {moved:.1g} of its size from "
        f"the surface given, its volume is {change:+.1%} different"
    )
    return new, new_faces, [told]


def _distance(points: Array, r: Array, faces: Index) -> float:
    """How far points (N, 3) lie from a surface at most; to the planes of near triangles."""
    centers = r[faces].mean(axis=1)
    near = cKDTree(centers).query(points, k=min(12, len(faces)))[1]
    return float(_to_triangles(points, r, faces, near))


@compiled
def _to_triangles(points, r, faces, near):  # type: ignore[no-untyped-def]
    largest = 0.0
    for p in range(len(points)):
        least = np.inf
        for f in near[p]:
            least = min(least, _square_distance(points[p], r, faces[f]))
        largest = max(largest, least)
    return np.sqrt(largest)


@nested
def _square_distance(x, r, triangle):  # type: ignore[no-untyped-def]
    """Square of the distance of a point from a triangle."""
    a, b, c = r[triangle[0]], r[triangle[1]], r[triangle[2]]
    normal = np.zeros(3)
    for d in range(3):
        e, g = (d + 1) % 3, (d + 2) % 3
        normal[d] = (b[e] - a[e]) * (c[g] - a[g]) - (b[g] - a[g]) * (c[e] - a[e])
    square, height = 0.0, 0.0
    for d in range(3):
        square += normal[d] ** 2
        height += normal[d] * (x[d] - a[d])
    inside = square > 0.0
    least = np.inf
    for k in range(3):
        p, q = r[triangle[k]], r[triangle[(k + 1) % 3]]
        along, length, side = 0.0, 0.0, 0.0
        for d in range(3):
            e, g = (d + 1) % 3, (d + 2) % 3
            along += (q[d] - p[d]) * (x[d] - p[d])
            length += (q[d] - p[d]) ** 2
            side += normal[d] * ((q[e] - p[e]) * (x[g] - p[g]) - (q[g] - p[g]) * (x[e] - p[e]))
        inside = inside and side >= 0.0
        share = min(1.0, max(0.0, along / length)) if length > 0.0 else 0.0
        distance = 0.0
        for d in range(3):
            distance += (p[d] + share * (q[d] - p[d]) - x[d]) ** 2
        least = min(least, distance)
    return height**2 / square if inside else least
