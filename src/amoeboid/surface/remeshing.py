"""A better mesh for a shape that has outgrown its old one, with the same filaments on it.

Edges that are too long are split, edges that are too short collapsed, and edges flipped where that
makes the worse of their two triangles better (see `mesh_changes`). The membrane area is constant,
so that the number of nodes hardly changes. The rest of the mesh stays as it is, and its nodes keep
their values exactly. What is changed keeps its filaments: the nodes around each change hold as many
after it as before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.surface.geometry import (
    area_along,
    extreme_edges,
    geometry,
    mesh_quality,
    node_areas,
    triangle_quality,
)
from amoeboid.surface.mesh import Index, connectivity, narrow_numbering
from amoeboid.surface.mesh_changes import Change, collapses, edges, flips, splits
from amoeboid.surface.model import Model, State

Array = NDArray[np.float64]

# A mesh is left alone until an edge or a triangle (quality 1 is equilateral) is beyond these: every
# change takes the run its past, so that many are made at once.
OVERLONG, OVERSHORT, POOR_QUALITY = 1.8, 0.45, 0.5
# Where not all can be put right, a change is made if what is worst, or how much is beyond these
# limits, becomes that much less.
IMPROVEMENT = 0.8
MAX_ROUNDS = 10
# A strongly stretched mesh first becomes worse: its splits, collapses and flips are repeated.
MAX_SWEEPS = 3
# After an attempt in vain the next one waits until an edge is this much longer or shorter.
EDGE_CHANGE = 1.1


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
        new, faces = swept(new, faces, model.edge_length)
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


def swept(state: State, faces: Index, edge_length: float) -> tuple[State, Index]:
    """Splits, collapses and flips, each as long as there are any; the same if there are none."""
    # flips make room for more collapses
    for find in (splits, collapses, flips, collapses, flips):
        for _ in range(MAX_ROUNDS):
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
    return replace(state, r=r, c=np.where(new >= 0, ratio[new] * c, c), turning=None)
