"""Closed triangulations: the icosphere, its connectivity and the checks a surface must pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.graphs import components, reverse_cuthill_mckee
from amoeboid.validation import InvalidInput


@dataclass(frozen=True, eq=False, repr=False)
class Connectivity:
    """Connectivity of a closed triangulation: V nodes, F triangles, E = 3F/2 edges.

    `faces` (F, 3) counter-clockwise seen from outside. The node-to-node pattern is in compressed
    row form: the neighbors of node i, itself included, ascending, are
    `columns[row_start[i]:row_start[i + 1]]`; `slots[f, a, b]` is the place of the pair
    (faces[f, a], faces[f, b]) in it.
    """

    faces: Index
    row_start: Index
    columns: Index
    slots: Index

    def __repr__(self) -> str:
        return f"Connectivity({self.n_nodes} nodes, {len(self.faces)} triangles)"

    @property
    def n_nodes(self) -> int:
        """Number of nodes V."""
        return len(self.row_start) - 1

    @cached_property
    def rows(self) -> Index:
        """Row of every entry of the pattern."""
        return np.repeat(np.arange(self.n_nodes), np.diff(self.row_start))

    @cached_property
    def valence(self) -> Index:
        """Number of neighbors of each node (V,)."""
        return np.diff(self.row_start) - 1


def connectivity(faces: Index) -> Connectivity:
    """The connectivity of a closed, oriented, connected triangulation.

    Raises InvalidInput if an edge does not belong to exactly two triangles that run along it in
    opposite directions, if a node is not used, or if the surface falls apart.
    """
    faces = np.ascontiguousarray(faces, dtype=np.int64)
    _check_closed(faces)
    n = int(faces.max()) + 1
    row_start, columns, slots = _pattern(faces, n)
    return Connectivity(faces=faces, row_start=row_start, columns=columns, slots=slots)


def _pattern(faces: Index, n: int) -> tuple[Index, Index, Index]:
    """The node-to-node pattern of `Connectivity`."""
    rows = np.repeat(faces, 3, axis=1).ravel()
    columns = np.tile(faces, (1, 3)).ravel()
    pairs, slots = np.unique(rows * n + columns, return_inverse=True)
    row_start = np.searchsorted(pairs, np.arange(n + 1) * n).astype(np.int64)
    return row_start, pairs % n, slots.reshape(-1, 3, 3).astype(np.int64)


def _check_closed(faces: Index) -> None:
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) < 4:
        raise InvalidInput(f"faces must have shape (F, 3) with F >= 4, got {faces.shape}")
    if faces.min() < 0:
        raise InvalidInput(f"faces must hold node numbers >= 0, got {faces.min()}")
    n = int(faces.max()) + 1
    half_edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = np.sort(half_edges[:, 0] * n + half_edges[:, 1])
    backward = np.sort(half_edges[:, 1] * n + half_edges[:, 0])
    if np.any(np.diff(forward) == 0) or not np.array_equal(forward, backward):
        raise InvalidInput(
            "the surface must be closed and consistently oriented: every edge must belong to two "
            "triangles that run along it in opposite directions"
        )
    pieces, _ = components(n, *half_edges.T)
    if pieces != 1:
        raise InvalidInput(
            f"the surface must be one connected piece with no unused node, got {pieces}"
        )


def icosphere(subdivisions: int) -> tuple[Array, Index]:
    """Nodes (V, 3) on the unit sphere and faces (F, 3); V = 10 * 4**subdivisions + 2.

    Every subdivision halves all edges. The middle of an edge of the icosahedron lies on the z axis:
    the poles of the default polarization are ordinary nodes, not two of the twelve of valence
    five. Nodes are numbered by reverse Cuthill-McKee, so that matrices over them have a narrow
    band, and faces are listed along the nodes, so that assembly stays within the cache.
    """
    nodes, faces = icosahedron()
    for _ in range(subdivisions):
        nodes, faces = subdivided(nodes, faces)
    return renumbered(nodes, faces)


def icosahedron() -> tuple[Array, Index]:
    """Nodes (12, 3) on the unit sphere and faces (20, 3); the middle of an edge on the z axis."""
    golden = (1 + np.sqrt(5)) / 2
    corners = np.array([(0.0, a, b) for a in (1, -1) for b in (golden, -golden)])
    nodes = np.concatenate([np.roll(corners, shift, axis=1) for shift in range(3)])
    faces = []
    for corner in combinations(range(12), 3):
        a, b, c = nodes[list(corner)]
        sides = np.linalg.norm([a - b, b - c, c - a], axis=1)
        if sides.max() < 2.1:  # the edges have length 2, all other pairs are farther apart
            outward = np.dot(a, np.cross(b, c)) > 0
            faces.append(corner if outward else corner[::-1])
    return nodes / np.linalg.norm(nodes[0]), np.array(faces, dtype=np.int64)


def subdivided(nodes: Array, faces: Index) -> tuple[Array, Index]:
    """Every triangle split into four; the new nodes, on the unit sphere, follow the old ones."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, which = np.unique(edges, axis=0, return_inverse=True)
    middle = nodes[unique].sum(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = len(nodes) + which.reshape(3, -1)
    a, b, c = faces.T
    split = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.vstack([nodes, middle]), np.concatenate([np.column_stack(t) for t in split])


def renumbered(nodes: Array, faces: Index) -> tuple[Array, Index]:
    """Nodes in reverse Cuthill-McKee order, faces listed along them."""
    order, faces = narrow_numbering(faces)
    return np.ascontiguousarray(nodes[order]), faces


def narrow_numbering(faces: Index) -> tuple[Index, Index]:
    """Reverse Cuthill-McKee: the old numbers of the nodes in their new order (V,), new faces.

    Matrices over nodes so numbered have a narrow band; faces are listed along the nodes.
    """
    n = int(faces.max()) + 1
    row_start, columns, _ = _pattern(faces, n)
    order = reverse_cuthill_mckee(row_start, columns)
    new = np.empty(n, dtype=np.int64)
    new[order] = np.arange(n)
    faces = new[faces]
    along = np.lexsort((faces.max(axis=1), faces.min(axis=1)))
    return order, np.ascontiguousarray(faces[along])
