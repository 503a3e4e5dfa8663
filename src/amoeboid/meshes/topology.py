"""Local changes of a mesh: splits, collapses and flips of edges, many at once.

Changes whose patches of nodes touch are never made together. None pinches a neck, cuts off a ridge
or leaves a node with too few or too many neighbors (M. Botsch, L. Kobbelt, Symposium on Geometry
Processing 2004, section 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array, Index
from amoeboid.meshes.geometry import mesh_quality, triangle_quality
from amoeboid.numerics.compiled import compiled, nested

# Edges are split and collapsed beyond these multiples of the length that they were made with.
MAX_LENGTH, MIN_LENGTH = 1.5, 0.6
# Flips are looked for where a triangle is worse than this, ...
GOOD_QUALITY = 0.7
# ... and done where the worse triangle becomes this much better.
GAIN = 1.1
# Cosine of the largest angle between neighboring triangles that a change may make.
FLATNESS = 0.5
MIN_VALENCE, MAX_VALENCE = 4, 9


@dataclass(frozen=True, eq=False)
class Edges:
    """All edges a < b (E,): opposite corners c, d, faces (a, b, c) and (b, a, d), lengths."""

    a: Index
    b: Index
    c: Index
    d: Index
    left: Index
    right: Index
    length: Array

    @property
    def corners(self) -> Index:
        """a, b, c, d of all edges (E, 4)."""
        return np.column_stack([self.a, self.b, self.c, self.d])


@dataclass(frozen=True, eq=False)
class Change:
    """Local changes of a mesh: new faces (F', 3) over V' nodes.

    New node k lies at the old node `first[k]`, or, if `second[k]` is another one, in the middle
    between the two. `patch` (V,): number of the change that an old node takes part in, or -1; a
    new node belongs to the patch of first[k].
    """

    faces: Index
    first: Index
    second: Index
    patch: Index


def splits(r: Array, faces: Index, edge_length: float) -> Change | None:
    """A new node in the middle of edges that are too long, the longest first."""
    e = edges(r, faces)
    long = _in_order(e.length > MAX_LENGTH * edge_length, -e.length)
    chosen, patch = _chosen_splits(long, e.corners, len(r))
    if len(chosen) == 0:
        return None
    a, b, c, d = e.corners[chosen].T
    middle = len(r) + np.arange(len(chosen))
    faces = faces.copy()
    faces[e.left[chosen]] = np.column_stack([a, middle, c])
    faces[e.right[chosen]] = np.column_stack([b, middle, d])
    added = np.stack([np.column_stack([middle, b, c]), np.column_stack([middle, a, d])], axis=1)
    nodes = np.arange(len(r))
    return Change(
        np.concatenate([faces, added.reshape(-1, 3)]),
        np.concatenate([nodes, a]),
        np.concatenate([nodes, b]),
        patch,
    )


def collapses(r: Array, faces: Index, edge_length: float) -> Change | None:
    """Both ends of edges that are too short become one node between them, the shortest first."""
    e = edges(r, faces)
    short = _in_order(e.length < MIN_LENGTH * edge_length, e.length)
    if len(short) == 0:
        return None
    start, around = _triangles_around(faces, len(r))
    chosen, patch = _chosen_collapses(
        short, e.corners, r, faces, start, around, MAX_LENGTH * edge_length
    )
    if len(chosen) == 0:
        return None
    gone = e.b[chosen]
    merged = np.arange(len(r))
    merged[gone] = e.a[chosen]
    faces = np.delete(faces, np.concatenate([e.left[chosen], e.right[chosen]]), axis=0)
    kept = np.setdiff1d(np.arange(len(r)), gone)
    new_number = np.empty(len(r), dtype=np.int64)
    new_number[kept] = np.arange(len(kept))
    second = np.arange(len(r))
    second[e.a[chosen]] = gone
    return Change(new_number[merged[faces]], kept, second[kept], patch)


def flips(r: Array, faces: Index, edge_length: float) -> Change | None:
    """Edges that connect the other two corners of their triangles, where these become better."""
    if mesh_quality(r, faces) > GOOD_QUALITY:
        return None
    e = edges(r, faces)
    old = np.minimum(*_qualities(r, (e.a, e.b, e.c), (e.b, e.a, e.d)))
    new = np.minimum(*_qualities(r, (e.a, e.d, e.c), (e.d, e.b, e.c)))
    gain = np.divide(new, old, out=np.where(new > 0, np.inf, 0.0), where=old > 0)
    better = _in_order(gain > GAIN, -gain)
    start, around = _triangles_around(faces, len(r))
    chosen, patch = _chosen_flips(better, e.corners, r, faces, start, around, MIN_VALENCE)
    if len(chosen) == 0:
        return None
    a, b, c, d = e.corners[chosen].T
    faces = faces.copy()
    faces[e.left[chosen]] = np.column_stack([a, d, c])
    faces[e.right[chosen]] = np.column_stack([d, b, c])
    nodes = np.arange(len(r))
    return Change(faces, nodes, nodes, patch)


@compiled
def _triangles_around(faces, n_nodes):  # type: ignore[no-untyped-def]
    """Triangles around each node in compressed row form: starts (V + 1,), triangles (3F,)."""
    start = np.zeros(n_nodes + 1, np.int64)
    for f in range(len(faces)):
        for k in range(3):
            start[faces[f, k] + 1] += 1
    for i in range(n_nodes):
        start[i + 1] += start[i]
    free = start[:-1].copy()
    around = np.empty(3 * len(faces), np.int64)
    for f in range(len(faces)):
        for k in range(3):
            around[free[faces[f, k]]] = f
            free[faces[f, k]] += 1
    return start, around


@compiled
def _chosen_splits(candidates, corners, n_nodes):  # type: ignore[no-untyped-def]
    """Candidates whose corners no earlier one has taken (K,), and the patch of each node (V,)."""
    patch = np.full(n_nodes, -1)
    chosen = np.empty(len(candidates), np.int64)
    count = 0
    for k in candidates:
        taken = False
        for j in range(4):
            taken |= patch[corners[k, j]] >= 0
        if not taken:
            for j in range(4):
                patch[corners[k, j]] = count
            chosen[count] = k
            count += 1
    return chosen[:count], patch


@compiled
def _chosen_flips(candidates, corners, r, faces, start, around, min_valence):  # type: ignore[no-untyped-def]
    """The same of edges that may flip; the patch are the corners of their triangles."""
    patch = np.full(len(r), -1)
    chosen = np.empty(len(candidates), np.int64)
    count = 0
    for k in candidates:
        a, b, c, d = corners[k, 0], corners[k, 1], corners[k, 2], corners[k, 3]
        if patch[a] >= 0 or patch[b] >= 0 or patch[c] >= 0 or patch[d] >= 0:
            continue
        few = min(start[a + 1] - start[a], start[b + 1] - start[b])
        many = max(start[c + 1] - start[c], start[d + 1] - start[d])
        if few <= min_valence or many >= MAX_VALENCE:
            continue
        if _adjacent(c, d, faces, start, around) or not _nearly_flat(r, a, b, c, d):
            continue
        for j in range(4):
            patch[corners[k, j]] = count
        chosen[count] = k
        count += 1
    return chosen[:count], patch


@compiled
def _chosen_collapses(candidates, corners, r, faces, start, around, longest):  # type: ignore[no-untyped-def]
    """The same of edges that may collapse; the patch are all neighbors of both ends."""
    patch = np.full(len(r), -1)
    chosen = np.empty(len(candidates), np.int64)
    count = 0
    for k in candidates:
        a, b, c, d = corners[k, 0], corners[k, 1], corners[k, 2], corners[k, 3]
        valence = start[a + 1] - start[a] + start[b + 1] - start[b] - 4
        opposite = min(start[c + 1] - start[c], start[d + 1] - start[d])
        if not MIN_VALENCE <= valence <= MAX_VALENCE or opposite <= MIN_VALENCE:
            continue
        if _taken(patch, a, faces, start, around) or _taken(patch, b, faces, start, around):
            continue
        shared = 0
        for place in range(start[a], start[a + 1]):
            i = _following(faces, around[place], a)
            shared += _adjacent(b, i, faces, start, around)
        if shared != 2 or not _may_collapse(r, a, b, faces, start, around, longest):
            continue
        for end in (a, b):
            for place in range(start[end], start[end + 1]):
                for j in range(3):
                    patch[faces[around[place], j]] = count
        chosen[count] = k
        count += 1
    return chosen[:count], patch


@nested
def _following(faces, f, i):  # type: ignore[no-untyped-def]
    """The corner of triangle f after node i; around i it meets every neighbor once."""
    if faces[f, 0] == i:
        return faces[f, 1]
    return faces[f, 2] if faces[f, 1] == i else faces[f, 0]


@nested
def _adjacent(i, j, faces, start, around):  # type: ignore[no-untyped-def]
    found = False
    for place in range(start[i], start[i + 1]):
        found |= _following(faces, around[place], i) == j
    return found


@nested
def _taken(patch, i, faces, start, around):  # type: ignore[no-untyped-def]
    """Whether a node or one of its neighbors belongs to a patch already."""
    for place in range(start[i], start[i + 1]):
        for j in range(3):
            if patch[faces[around[place], j]] >= 0:
                return True
    return False


@nested
def _may_collapse(r, a, b, faces, start, around, longest):  # type: ignore[no-untyped-def]
    """Whether the triangles around an edge stay nearly parallel to what they were, and small."""
    x, y, z = 0.5 * (r[a, 0] + r[b, 0]), 0.5 * (r[a, 1] + r[b, 1]), 0.5 * (r[a, 2] + r[b, 2])
    for end, other in ((a, b), (b, a)):
        for place in range(start[end], start[end + 1]):
            f = around[place]
            i = _following(faces, f, end)
            j = _following(faces, f, i)
            if other in (i, j):
                continue
            px, py, pz = _normal(r, end, i, j)
            ux, uy, uz = r[i, 0] - x, r[i, 1] - y, r[i, 2] - z
            vx, vy, vz = r[j, 0] - x, r[j, 1] - y, r[j, 2] - z
            wx, wy, wz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
            qx, qy, qz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            sizes = np.sqrt((px * px + py * py + pz * pz) * (qx * qx + qy * qy + qz * qz))
            if not px * qx + py * qy + pz * qz >= FLATNESS * sizes > 0.0:
                return False
            square = max(
                ux * ux + uy * uy + uz * uz,
                vx * vx + vy * vy + vz * vz,
                wx * wx + wy * wy + wz * wz,
            )
            if square > longest * longest:
                return False
    return True


@nested
def _nearly_flat(r, a, b, c, d):  # type: ignore[no-untyped-def]
    """Whether the triangles abc, bad and those after a flip, adc, dbc, are nearly parallel."""
    normals = np.empty((4, 3))
    for n, (i, j, k) in enumerate(((a, b, c), (b, a, d), (a, d, c), (d, b, c))):
        normals[n, 0], normals[n, 1], normals[n, 2] = _normal(r, i, j, k)
    for n in range(4):
        for m in range(n):
            inner, nn, mm = 0.0, 0.0, 0.0
            for axis in range(3):
                inner += normals[n, axis] * normals[m, axis]
                nn += normals[n, axis] * normals[n, axis]
                mm += normals[m, axis] * normals[m, axis]
            if not inner >= FLATNESS * np.sqrt(nn * mm) > 0.0:
                return False
    return True


@nested
def _normal(r, i, j, k):  # type: ignore[no-untyped-def]
    """Twice the area vector of a triangle."""
    ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
    vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def edges(r: Array, faces: Index) -> Edges:
    """The edges of a closed mesh with nodes r (V, 3)."""
    n = len(r)
    tails, heads = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    opposite, face = np.roll(faces, -2, axis=1).ravel(), np.repeat(np.arange(len(faces)), 3)
    there, back = np.flatnonzero(tails < heads), np.flatnonzero(tails > heads)
    there = there[np.argsort(tails[there] * n + heads[there])]
    back = back[np.argsort(heads[back] * n + tails[back])]
    a, b = tails[there], heads[there]
    length = np.linalg.norm(r[b] - r[a], axis=1)
    return Edges(a, b, opposite[there], opposite[back], face[there], face[back], length)


def _qualities(r: Array, *triangles: tuple[Index, Index, Index]) -> list[Array]:
    return [triangle_quality(r, np.column_stack(t)) for t in triangles]


def _in_order(wanted: NDArray[np.bool_], key: Array) -> Index:
    found = np.flatnonzero(wanted)
    return found[np.argsort(key[found], kind="stable")]
