"""A better mesh for a shape that has outgrown its old one, with the same density on it.

Edges that are too long are split, edges that are too short collapsed, and edges flipped where that
makes the worse of their two triangles better (see `mesh_changes`). The membrane area is constant,
so that the number of nodes hardly changes. The rest of the mesh stays as it is, and its nodes keep
their values exactly. What is changed keeps its filaments: the nodes around each change hold as many
after it as before.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.connectivity import narrow_numbering
from amoeboid.meshes.geometry import (
    area_along,
    extreme_edges,
    geometry,
    mesh_quality,
    node_areas,
    triangle_quality,
)
from amoeboid.meshes.topology import Change, collapses, edges, flips, splits
from amoeboid.numerics.compiled import compiled

# A mesh is left alone until an edge or a triangle (quality 1 is equilateral) is beyond these: every
# change takes the run its past, so that many are made at once.
TOO_LONG, TOO_SHORT, POOR_QUALITY = 1.8, 0.45, 0.5
# Where not all can be put right, a change is made if what is worst, or how much is beyond these
# limits, becomes that much less.
IMPROVEMENT = 0.8
MAX_ROUNDS = 10
# A strongly stretched mesh first becomes worse: its splits, collapses and flips are repeated.
MAX_SWEEPS = 3
# After an attempt in vain the next one waits until an edge is this much longer or shorter.
EDGE_CHANGE = 1.1


def due(r: Array, faces: Index, edge_length: float, tried: Array | None) -> bool:
    """Whether an attempt to remesh is worth its time: the mesh is out of order, and has changed.

    `tried`: the nodes (V, 3) with which the last attempt was made in vain on this mesh, or None.
    """
    if distortion(r, faces, edge_length) <= 1.0:
        return False
    return tried is None or _edge_change(tried, r, faces) > EDGE_CHANGE


def remeshed(
    r: Array, c: Array, faces: Index, edge_length: float, area: float
) -> tuple[Array, Array, Index] | None:
    """Nodes (V', 3), a density there (V',) and faces (F', 3) of a better mesh of the surface.

    None if nothing is to be done: a change is made only if it makes the mesh clearly better. What
    the density sums to is kept, the surface is given `area` exactly, and its shape is kept up to
    the change of the polyhedron.
    """
    if distortion(r, faces, edge_length) <= 1.0:
        return None
    new_r, new_c, new_faces = r, c, faces
    for _ in range(MAX_SWEEPS):
        before = new_faces
        new_r, new_c, new_faces = swept(new_r, new_c, new_faces, edge_length)
        if new_faces is before:
            return None
        if _better(new_r, new_faces, r, faces, edge_length):
            break
    else:
        return None
    order, new_faces = narrow_numbering(new_faces)
    new_r, new_c = new_r[order], new_c[order]
    new_r = new_r + _area_correction(new_r, new_faces, area)
    held, found = c @ node_areas(r, faces), new_c @ node_areas(new_r, new_faces)
    # what the correction of the area has changed is spread evenly
    return new_r, new_c * (held / found) if found > 0 else new_c, new_faces


def swept(r: Array, c: Array, faces: Index, edge_length: float) -> tuple[Array, Array, Index]:
    """Splits, collapses and flips, each as long as there are any; the same if there are none."""
    # flips make room for more collapses
    for find in (splits, collapses, flips, collapses, flips):
        for _ in range(MAX_ROUNDS):
            change = find(r, faces, edge_length)
            if change is None:
                break
            (r, c), faces = transferred(r, c, faces, change), change.faces
    return r, c, faces


def _better(r: Array, faces: Index, old_r: Array, old_faces: Index, edge_length: float) -> bool:
    """Whether a mesh is in order, or what is worst on it, or how much is beyond the limits, is less
    than before by IMPROVEMENT."""
    worst = distortion(r, faces, edge_length)
    old_worst = distortion(old_r, old_faces, edge_length)
    if worst <= max(1.0, IMPROVEMENT * old_worst):
        return True
    count, old_count = (_beyond(*mesh, edge_length) for mesh in ((r, faces), (old_r, old_faces)))
    return worst <= old_worst and count <= IMPROVEMENT * old_count


def _beyond(r: Array, faces: Index, edge_length: float) -> int:
    """How many edges and triangles are beyond what is left alone."""
    length = edges(r, faces).length / edge_length
    poor = np.sum(triangle_quality(r, faces) < POOR_QUALITY)
    return int(poor + np.sum(length < TOO_SHORT) + np.sum(length > TOO_LONG))


def _area_correction(r: Array, faces: Index, wanted: float) -> Array:
    """Displacement (V, 3), the same along all node normals, that gives the surface its area."""
    normals = geometry(r, faces).normals
    amount = 0.0
    for _ in range(4):  # Newton from next to the solution
        found, growth = area_along(r + amount * normals, faces, normals)
        amount += (wanted - found) / growth
    return amount * normals


def distortion(r: Array, faces: Index, edge_length: float) -> float:
    """How far the worst edge or triangle is beyond what is left alone: 1 is the limit."""
    shortest, longest = extreme_edges(r, faces)
    quality = mesh_quality(r, faces)
    if not (shortest > 0 and quality > 0):
        return float("inf")
    return max(
        TOO_SHORT * edge_length / shortest,
        longest / (TOO_LONG * edge_length),
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


def transferred(r: Array, c: Array, faces: Index, change: Change) -> tuple[Array, Array]:
    """Nodes and density after a change: curved middles, as much of it in each patch."""
    g = geometry(r, faces)
    i, j = change.first, change.second
    edge = r[j] - r[i]
    # cubic between the nodes, normal to their normals (zero where both are one node)
    out_i, out_j = (
        np.einsum("vi,vi->v", edge, g.normals[k])[:, None] * g.normals[k] for k in (i, j)
    )
    new_r = 0.5 * (r[i] + r[j]) + (out_j - out_i) / 8.0
    m = g.node_areas
    new_c = (m[i] * c[i] + m[j] * c[j]) / (m[i] + m[j])

    after = geometry(new_r, change.faces).node_areas
    old, new = change.patch, change.patch[i]
    count = int(old.max()) + 1
    held = np.bincount(old[old >= 0], (m * c)[old >= 0], count)
    found = np.bincount(new[new >= 0], (after * new_c)[new >= 0], count)
    ratio = np.divide(held, found, out=np.ones(count), where=found > 0)
    return new_r, np.where(new >= 0, ratio[new] * new_c, new_c)
