"""Remeshing of a deformed surface, with conservative transfer of a density on it.

Edges that are too long are split, edges that are too short are collapsed, and edges are flipped if
the worse of their two triangles improves (see `topology`). The membrane area is constant, so that
the number of nodes hardly changes. The rest of the mesh is not changed, and its nodes keep their
values exactly. The total of the density over the nodes around each change is conserved.
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

# A mesh is changed once an edge (relative to the wanted length) or the quality of a triangle (1 is
# equilateral) is beyond these limits. Every change discards the past of the run, so that many
# changes are made at once.
TOO_LONG, TOO_SHORT, POOR_QUALITY = 1.8, 0.45, 0.5
# If not all limits can be met, the mesh is changed only if the distortion, or the number of edges
# and triangles beyond the limits, decreases to this share.
IMPROVEMENT = 0.8
MAX_ROUNDS = 10
# A strongly stretched mesh first becomes worse: its splits, collapses and flips are repeated.
MAX_SWEEPS = 3
# After an unsuccessful attempt the next one waits until an edge is longer or shorter by this
# factor.
EDGE_CHANGE = 1.1


def due(r: Array, faces: Index, edge_length: float, tried: Array | None) -> bool:
    """Whether to try remeshing: the mesh is beyond its limits, and has changed since the last try.

    `tried`: the nodes (V, 3) of the last unsuccessful attempt on this mesh, or None.
    """
    if distortion(r, faces, edge_length) <= 1.0:
        return False
    return tried is None or _edge_change(tried, r, faces) > EDGE_CHANGE


def remeshed(
    r: Array, c: Array, faces: Index, edge_length: float, area: float
) -> tuple[Array, Array, Index] | None:
    """Nodes (V', 3), a density there (V',) and faces (F', 3) of a better mesh of the surface.

    None if no change is needed, or if changes would not clearly improve the mesh. The total of the
    density is conserved, the area of the surface is `area` exactly, and the shape is kept up to the
    change of the polyhedron.
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
    # the change of the total by the correction of the area is spread uniformly
    return new_r, new_c * (held / found) if found > 0 else new_c, new_faces


def swept(r: Array, c: Array, faces: Index, edge_length: float) -> tuple[Array, Array, Index]:
    """The mesh after splits, collapses and flips, each repeated as long as there are any."""
    # flips allow more collapses
    for find in (splits, collapses, flips, collapses, flips):
        for _ in range(MAX_ROUNDS):
            change = find(r, faces, edge_length)
            if change is None:
                break
            (r, c), faces = transferred(r, c, faces, change), change.faces
    return r, c, faces


def _better(r: Array, faces: Index, old_r: Array, old_faces: Index, edge_length: float) -> bool:
    """Whether a mesh is within the limits, or its distortion or the number of edges and triangles
    beyond the limits is below IMPROVEMENT times that of the old mesh."""
    worst = distortion(r, faces, edge_length)
    old_worst = distortion(old_r, old_faces, edge_length)
    if worst <= max(1.0, IMPROVEMENT * old_worst):
        return True
    count, old_count = (_beyond(*mesh, edge_length) for mesh in ((r, faces), (old_r, old_faces)))
    return worst <= old_worst and count <= IMPROVEMENT * old_count


def _beyond(r: Array, faces: Index, edge_length: float) -> int:
    """Number of edges and triangles beyond the limits."""
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
    """Ratio of the worst edge length or triangle quality to its limit; above 1 is beyond it."""
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
    """Nodes and density after a change: on the curved surface, totals of patches conserved."""
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
