"""A better mesh for a shape that has outgrown its old one, with the same filaments on it.

Edges that are too long are split, edges that are too short collapsed, and edges flipped where that
makes the worse of their two triangles better (M. Botsch, L. Kobbelt, Symposium on Geometry
Processing 2004, section 4). The membrane area is constant, so that the number of nodes hardly
changes. The rest of the mesh stays as it is, and its nodes keep their values exactly. What is
changed keeps its filaments: the nodes around each change hold as many after it as before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.geometry import (
    area_along,
    extreme_edges,
    face_vectors,
    geometry,
    mesh_quality,
    node_areas,
    triangle_quality,
)
from amoeboid.surface.mesh import Connectivity, Index, connectivity, narrow_numbering
from amoeboid.surface.model import Model, State

Array = NDArray[np.float64]

# Edges are split and collapsed beyond these multiples of the length that they were made with.
LONGEST, SHORTEST = 1.5, 0.6
# A mesh is left alone until an edge or a triangle (quality 1 is equilateral) is beyond these: every
# change takes the run its past, so that many are made at once.
OVERLONG, OVERSHORT, POOR_QUALITY = 1.8, 0.45, 0.5
# Where not all can be put right, a change is made if what is worst, or how much is beyond these
# limits, becomes that much less.
IMPROVEMENT = 0.8
# Flips are looked for where a triangle is worse than this, ...
GOOD_QUALITY = 0.7
# ... and done where the worse triangle becomes this much better.
GAIN = 1.1
# Cosine of the largest angle between neighboring triangles that a change may make.
FLATNESS = 0.5
LEAST_VALENCE, MOST_VALENCE = 4, 9
MOST_ROUNDS = 10


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


def remeshed(model: Model, state: State) -> tuple[Model, State]:
    """`model` and `state` on a better mesh; the same objects if nothing is to be done.

    The state keeps its filaments, the area A0 exactly and, up to the change of the polyhedron, its
    shape. What came before it has no place on the new mesh: a discrete surface changes its speed
    with its mesh. So a change is made only if it makes the mesh clearly better.
    """
    if disorder(state.r, model.mesh.faces, model.edge_length) <= 1.0:
        return model, state
    new, mesh = state, model.mesh
    # flips make room for more collapses
    for find in (splits, collapses, flips, collapses, flips):
        for _ in range(MOST_ROUNDS):
            change = find(new.r, mesh, model.edge_length)
            if change is None:
                break
            new, mesh = carried(new, mesh, change), connectivity(change.faces)
    if not _better(new.r, mesh.faces, state.r, model.mesh.faces, model.edge_length):
        return model, state
    order, faces = narrow_numbering(mesh.faces)
    new = replace(new, r=new.r[order], c=new.c[order])
    new = replace(new, r=new.r + _swelling(new.r, faces, model.A0))
    new = _refilled(new, faces, state, model.mesh.faces)
    return Model(model.parameters, connectivity(faces), model.edge_length), new


def _better(r: Array, faces: Index, old_r: Array, old_faces: Index, edge_length: float) -> bool:
    """Whether a mesh is in order, or what is worst on it, or how much is beyond the limits, is less
    than before by IMPROVEMENT."""
    worst = disorder(r, faces, edge_length)
    old_worst = disorder(old_r, old_faces, edge_length)
    if worst <= max(1.0, IMPROVEMENT * old_worst):
        return True
    count, old_count = (_beyond(*mesh, edge_length) for mesh in ((r, faces), (old_r, old_faces)))
    return worst <= old_worst and count <= IMPROVEMENT * old_count


def _beyond(r: Array, faces: Index, edge_length: float) -> int:
    """How many edges and triangles are beyond what is left alone."""
    length = edges(r, faces).length / edge_length
    poor = np.sum(triangle_quality(r, faces) < POOR_QUALITY)
    return int(poor + np.sum(length < OVERSHORT) + np.sum(length > OVERLONG))


def _swelling(r: Array, faces: Index, wanted: float) -> Array:
    """Displacement (V, 3), the same along all node normals, that gives the surface its area."""
    normals = geometry(r, faces).normals
    amount = 0.0
    for _ in range(4):  # Newton from next to the solution
        found, growth = area_along(r + amount * normals, faces, normals)
        amount += (wanted - found) / growth
    return amount * normals


def _refilled(new: State, faces: Index, old: State, old_faces: Index) -> State:
    """`new` with as many filaments as `old`: what swelling has changed is spread evenly."""
    held, found = (s.c @ node_areas(s.r, f) for s, f in ((old, old_faces), (new, faces)))
    return replace(new, c=new.c * (held / found)) if found > 0 else new


def disorder(r: Array, faces: Index, edge_length: float) -> float:
    """How far the worst edge or triangle is beyond what is left alone: 1 is the limit."""
    shortest, longest = extreme_edges(r, faces)
    quality = mesh_quality(r, faces)
    if not (shortest > 0 and quality > 0):
        return float("inf")
    return max(
        OVERSHORT * edge_length / shortest,
        longest / (OVERLONG * edge_length),
        POOR_QUALITY / quality,
    )


def splits(r: Array, mesh: Connectivity, edge_length: float) -> Change | None:
    """A new node in the middle of edges that are too long, the longest first."""
    e = edges(r, mesh.faces)
    long = _in_order(e.length > LONGEST * edge_length, -e.length)
    chosen, patch = _disjoint(long, len(r), lambda k: np.array([e.a[k], e.b[k], e.c[k], e.d[k]]))
    if not chosen:
        return None
    faces, added = mesh.faces.copy(), []
    for middle, k in enumerate(chosen, start=len(r)):
        a, b, c, d = e.a[k], e.b[k], e.c[k], e.d[k]
        faces[e.left[k]], faces[e.right[k]] = (a, middle, c), (b, middle, d)
        added += [(middle, b, c), (middle, a, d)]
    nodes = np.arange(len(r))
    return Change(
        np.concatenate([faces, np.array(added)]),
        np.concatenate([nodes, e.a[chosen]]),
        np.concatenate([nodes, e.b[chosen]]),
        patch,
    )


def collapses(r: Array, mesh: Connectivity, edge_length: float) -> Change | None:
    """Both ends of edges that are too short become one node between them, the shortest first."""
    e = edges(r, mesh.faces)
    short = _in_order(e.length < SHORTEST * edge_length, e.length)
    around = _faces_around(mesh)

    def ring(k: int) -> Index:
        a, b = e.a[k], e.b[k]
        shared = np.intersect1d(neighbors(mesh, a), neighbors(mesh, b))
        valence = mesh.valence[a] + mesh.valence[b] - 4
        enough = min(mesh.valence[e.c[k]], mesh.valence[e.d[k]]) > LEAST_VALENCE
        if len(shared) != 4 or not LEAST_VALENCE <= valence <= MOST_VALENCE or not enough:
            return np.empty(0, dtype=np.int64)
        faces = mesh.faces[np.setdiff1d(np.union1d(around(a), around(b)), [e.left[k], e.right[k]])]
        middle = 0.5 * (r[a] + r[b])
        before = face_vectors(r, faces)
        corners = np.where((faces == a)[:, :, None] | (faces == b)[:, :, None], middle, r[faces])
        after = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        cosine = np.einsum("fi,fi->f", before, after) / (
            np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        )
        if cosine.min() < FLATNESS or sides.max() > LONGEST * edge_length:
            return np.empty(0, dtype=np.int64)
        return np.union1d(neighbors(mesh, a), neighbors(mesh, b))

    chosen, patch = _disjoint(short, len(r), ring)
    if not chosen:
        return None
    gone = e.b[chosen]
    merged = np.arange(len(r))
    merged[gone] = e.a[chosen]
    faces = np.delete(mesh.faces, np.concatenate([e.left[chosen], e.right[chosen]]), axis=0)
    kept = np.setdiff1d(np.arange(len(r)), gone)
    new_number = np.empty(len(r), dtype=np.int64)
    new_number[kept] = np.arange(len(kept))
    second = np.arange(len(r))
    second[e.a[chosen]] = gone
    return Change(new_number[merged[faces]], kept, second[kept], patch)


def flips(r: Array, mesh: Connectivity, edge_length: float) -> Change | None:
    """Edges that connect the other two corners of their triangles, where these become better."""
    if mesh_quality(r, mesh.faces) > GOOD_QUALITY:
        return None
    e = edges(r, mesh.faces)
    old = np.minimum(*_qualities(r, (e.a, e.b, e.c), (e.b, e.a, e.d)))
    new = np.minimum(*_qualities(r, (e.a, e.d, e.c), (e.d, e.b, e.c)))
    better = _in_order(new > GAIN * old, -new / old)

    def corners(k: int) -> Index:
        a, b, c, d = nodes = np.array([e.a[k], e.b[k], e.c[k], e.d[k]])
        normals = face_vectors(r, np.array([(a, b, c), (b, a, d), (a, d, c), (d, b, c)]))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        few = min(mesh.valence[a], mesh.valence[b]) <= LEAST_VALENCE
        many = max(mesh.valence[c], mesh.valence[d]) >= MOST_VALENCE
        if few or many or d in neighbors(mesh, c) or (normals @ normals.T).min() < FLATNESS:
            return np.empty(0, dtype=np.int64)
        return nodes

    chosen, patch = _disjoint(better, len(r), corners)
    if not chosen:
        return None
    faces = mesh.faces.copy()
    for k in chosen:
        a, b, c, d = e.a[k], e.b[k], e.c[k], e.d[k]
        faces[e.left[k]], faces[e.right[k]] = (a, d, c), (d, b, c)
    nodes = np.arange(len(r))
    return Change(faces, nodes, nodes, patch)


def carried(state: State, mesh: Connectivity, change: Change) -> State:
    """The state after a change: curved middles, as many filaments in each patch."""
    g = geometry(state.r, mesh.faces)
    i, j = change.first, change.second
    edge = state.r[j] - state.r[i]
    # cubic between the nodes, normal to their normals (zero where both are one node)
    out_i, out_j = (
        np.einsum("vi,vi->v", edge, g.normals[k])[:, None] * g.normals[k] for k in (i, j)
    )
    r = 0.5 * (state.r[i] + state.r[j]) + (out_j - out_i) / 8.0
    m = g.node_areas
    c = (m[i] * state.c[i] + m[j] * state.c[j]) / (m[i] + m[j])

    after = geometry(r, change.faces).node_areas
    old, new = change.patch, change.patch[i]
    count = int(old.max()) + 1
    held = np.bincount(old[old >= 0], (m * state.c)[old >= 0], count)
    found = np.bincount(new[new >= 0], (after * c)[new >= 0], count)
    ratio = np.divide(held, found, out=np.ones(count), where=found > 0)
    return replace(state, r=r, c=np.where(new >= 0, ratio[new] * c, c))


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


def neighbors(mesh: Connectivity, i: int) -> Index:
    """Nodes that share an edge with node i, and i itself."""
    return mesh.columns[mesh.row_start[i] : mesh.row_start[i + 1]]


def _faces_around(mesh: Connectivity) -> Callable[[int], Index]:
    order = np.argsort(mesh.faces.ravel(), kind="stable") // 3
    ends = np.searchsorted(np.sort(mesh.faces.ravel()), np.arange(mesh.n_nodes + 1))
    return lambda i: order[ends[i] : ends[i + 1]]


def _qualities(r: Array, *triangles: tuple[Index, Index, Index]) -> list[Array]:
    return [triangle_quality(r, np.column_stack(t)) for t in triangles]


def _in_order(wanted: NDArray[np.bool_], key: Array) -> Index:
    found = np.flatnonzero(wanted)
    return found[np.argsort(key[found], kind="stable")]


def _disjoint(
    candidates: Index, n_nodes: int, patch_of: Callable[[int], Index]
) -> tuple[list[int], Index]:
    """Candidates whose patches of nodes do not touch each other; an empty patch is none."""
    patch = np.full(n_nodes, -1)
    chosen: list[int] = []
    for k in candidates.tolist():
        nodes = patch_of(k)
        if len(nodes) > 0 and patch[nodes].max() < 0:
            patch[nodes] = len(chosen)
            chosen.append(k)
    return chosen, patch
