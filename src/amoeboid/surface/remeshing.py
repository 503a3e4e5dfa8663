"""A better mesh for a shape that has outgrown its old one, with the same filaments on it.

Edges that are too long are split, edges that are too short collapsed, and edges flipped where that
makes the worse of their two triangles better (M. Botsch, L. Kobbelt, Symposium on Geometry
Processing 2004, section 4). The membrane area is constant, so that the number of nodes hardly
changes. The rest of the mesh stays as it is, and its nodes keep their values exactly. What is
changed keeps its filaments: the nodes around each change hold as many after it as before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled, nested
from amoeboid.surface.geometry import (
    area_along,
    extreme_edges,
    geometry,
    mesh_quality,
    node_areas,
    triangle_quality,
)
from amoeboid.surface.mesh import Index, connectivity, narrow_numbering
from amoeboid.surface.model import Model, State
from amoeboid.surface.stepping import LEAST_QUALITY

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
# Strongly stretched meshes are not better before all of this is done a second time.
MAX_SWEEPS = 3
MAX_EVENING = 30
# After an attempt in vain the next one waits until an edge is this much longer or shorter.
EDGE_CHANGE = 1.1


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


def due(model: Model, state: State, tried: Array | None) -> bool:
    """Whether an attempt to remesh is worth its time: the mesh is out of order, and has changed.

    `tried`: the nodes (V, 3) with which the last attempt was made in vain on this mesh, or None.
    """
    if disorder(state.r, model.mesh.faces, model.edge_length) <= 1.0:
        return False
    return tried is None or _edge_change(tried, state.r, model.mesh.faces) > EDGE_CHANGE


def remeshed(model: Model, state: State) -> tuple[Model, State]:
    """`model` and `state` on a better mesh; the same objects if nothing is to be done.

    The state keeps its filaments, the area A0 exactly and, up to the change of the polyhedron, its
    shape. What came before it has no place on the new mesh: a discrete surface changes its speed
    with its mesh. So a change is made only if it makes the mesh clearly better.
    """
    if disorder(state.r, model.mesh.faces, model.edge_length) <= 1.0:
        return model, state
    new, faces = state, model.mesh.faces
    for _ in range(MAX_SWEEPS):
        before = faces
        new, faces = _swept(new, faces, model.edge_length)
        if faces is before:
            return model, state
        if _better(new.r, faces, state.r, model.mesh.faces, model.edge_length):
            break
    else:
        return model, state
    order, faces = narrow_numbering(faces)
    new = replace(new, r=new.r[order], c=new.c[order])
    new = replace(new, r=new.r + _swelling(new.r, faces, model.A0))
    new = _refilled(new, faces, state, model.mesh.faces)
    return Model(model.parameters, connectivity(faces), model.edge_length), new


def evened(r: Array, faces: Index, edge_length: float) -> tuple[Array, Index]:
    """Nodes (V, 3) and faces of a surface, remeshed with edges of about this length."""
    state = State(0.0, r, np.ones(len(r)), 0.0, np.zeros(3))
    for _ in range(MAX_EVENING):
        before = faces
        state, faces = _swept(state, faces, edge_length)
        if faces is before:
            break
    return state.r, faces


def _swept(state: State, faces: Index, edge_length: float) -> tuple[State, Index]:
    """Splits, collapses and flips, each as long as there are any; the same if there are none."""
    # flips make room for more collapses
    for find in (splits, collapses, flips, collapses, flips):
        for _ in range(MOST_ROUNDS):
            change = find(state.r, faces, edge_length)
            if change is None:
                break
            state, faces = carried(state, faces, change), change.faces
    return state, faces


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


@compiled
def _edge_change(old, new, faces):  # type: ignore[no-untyped-def]
    """The largest factor by which an edge is longer or shorter with new nodes than with old."""
    largest = 1.0
    for f in range(faces.shape[0]):
        for a in range(3):
            i, j = faces[f, a], faces[f, a - 1]
            before, after = 0.0, 0.0
            for d in range(3):
                before += (old[i, d] - old[j, d]) ** 2
                after += (new[i, d] - new[j, d]) ** 2
            largest = max(largest, before / after, after / before)
    return np.sqrt(largest)


def splits(r: Array, faces: Index, edge_length: float) -> Change | None:
    """A new node in the middle of edges that are too long, the longest first."""
    e = edges(r, faces)
    long = _in_order(e.length > LONGEST * edge_length, -e.length)
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
    short = _in_order(e.length < SHORTEST * edge_length, e.length)
    if len(short) == 0:
        return None
    start, around = _triangles_around(faces, len(r))
    chosen, patch = _chosen_collapses(
        short, e.corners, r, faces, start, around, LONGEST * edge_length
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
    chosen, patch = _chosen_flips(better, e.corners, r, faces, start, around, LEAST_VALENCE)
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
def _chosen_flips(candidates, corners, r, faces, start, around, least_valence):  # type: ignore[no-untyped-def]
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
        if few <= least_valence or many >= MOST_VALENCE:
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
        if not LEAST_VALENCE <= valence <= MOST_VALENCE or opposite <= LEAST_VALENCE:
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
    for place in range(start[i], start[i + 1]):
        if _following(faces, around[place], i) == j:
            return True
    return False


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
    mx, my, mz = 0.0, 0.0, 0.0
    for end in (a, b):
        for place in range(start[end], start[end + 1]):
            f = around[place]
            px, py, pz, _ = _normal_and_quality(r, faces[f, 0], faces[f, 1], faces[f, 2])
            mx, my, mz = mx + px, my + py, mz + pz
    for end, other in ((a, b), (b, a)):
        for place in range(start[end], start[end + 1]):
            f = around[place]
            i = _following(faces, f, end)
            j = _following(faces, f, i)
            if other in (i, j):
                continue
            px, py, pz, quality = _normal_and_quality(r, end, i, j)
            if quality < LEAST_QUALITY:
                px, py, pz = mx, my, mz
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
    thin = np.empty(4, np.bool_)
    for n, (i, j, k) in enumerate(((a, b, c), (b, a, d), (a, d, c), (d, b, c))):
        x, y, z, quality = _normal_and_quality(r, i, j, k)
        normals[n, 0], normals[n, 1], normals[n, 2] = x, y, z
        thin[n] = quality < LEAST_QUALITY
    for axis in range(3):
        mean = normals[0, axis] + normals[1, axis]
        for n in range(2):
            normals[n, axis] = mean if thin[n] else normals[n, axis]
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
def _normal_and_quality(r, i, j, k):  # type: ignore[no-untyped-def]
    """Twice the area vector of a triangle, and its quality: one so thin has no normal of its own.

    Where the quality is below LEAST_QUALITY callers take the normal of what is around.
    """
    ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
    vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    squares = 2.0 * (uu + vv - (ux * vx + uy * vy + uz * vz))
    quality = 2.0 * np.sqrt(3.0) * np.sqrt(x * x + y * y + z * z) / squares if squares > 0 else 0.0
    return x, y, z, quality


def carried(state: State, faces: Index, change: Change) -> State:
    """The state after a change: curved middles, as many filaments in each patch."""
    g = geometry(state.r, faces)
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


def _qualities(r: Array, *triangles: tuple[Index, Index, Index]) -> list[Array]:
    return [triangle_quality(r, np.column_stack(t)) for t in triangles]


def _in_order(wanted: NDArray[np.bool_], key: Array) -> Index:
    found = np.flatnonzero(wanted)
    return found[np.argsort(key[found], kind="stable")]
