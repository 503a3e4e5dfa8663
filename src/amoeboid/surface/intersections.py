"""Self-intersection of a triangulation, decided exactly on a fine grid.

Coordinates are rounded to whole numbers below 2^29, on a grid of 2e-9 to 4e-9 of the size of the
surface whose spacing is a power of two: short binary fractions stay what they are. There the sign
of every determinant is found in 64-bit arithmetic without rounding, so that flat, touching and
nearly touching parts are no special risk. Candidates come from sorting the bounding boxes along
the longest axis of the surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.surface.mesh import Index

Array = NDArray[np.float64]

GRID = 2**29 - 1


def intersecting_pair(r: Array, faces: Index) -> tuple[int, int] | None:
    """Two triangles that meet elsewhere than in a common node or edge, or None.

    r (V, 3), faces (F, 3) without degenerate triangles; touching counts as meeting.
    """
    extent = np.ptp(r, axis=0)
    spacing = 2.0 ** np.ceil(np.log2(extent.max() / GRID))
    nodes = np.rint((r - r.min(axis=0)) / spacing).astype(np.int64)
    axes = np.argsort(-extent, kind="stable")
    corners = nodes[faces]
    low, high = corners.min(axis=1)[:, axes], corners.max(axis=1)[:, axes]
    order = np.argsort(low[:, 0], kind="stable")
    first, second = _first_meeting(nodes, faces[order], low[order], high[order])
    return None if first < 0 else (int(order[first]), int(order[second]))


@compiled
def _first_meeting(nodes, faces, low, high):  # type: ignore[no-untyped-def]
    """Sweep along the first axis; faces, low, high in ascending order of low[:, 0]."""
    for i in range(len(faces)):
        for j in range(i + 1, len(faces)):
            if low[j, 0] > high[i, 0]:
                break
            apart = False
            for d in (1, 2):
                apart = apart or low[j, d] > high[i, d] or low[i, d] > high[j, d]
            if not apart and _meet(nodes, faces[i], faces[j]):
                return i, j
    return -1, -1


@compiled
def _meet(nodes, first, second):  # type: ignore[no-untyped-def]
    """Whether two triangles meet elsewhere than in the nodes that they share."""
    common = 0
    apex, other_apex = -1, -1  # corners that are not shared
    for k in range(3):
        shared = first[k] == second[0] or first[k] == second[1] or first[k] == second[2]
        other_shared = second[k] == first[0] or second[k] == first[1] or second[k] == first[2]
        common += shared
        if not shared:
            apex = k
        if not other_shared:
            other_apex = k
    if common < 2:
        # what meets at a common node only ends on the edges opposite to it
        for k in range(3):
            i, j = first[k], first[(k + 1) % 3]
            if i not in second and j not in second and _edge_meets(nodes, i, j, second):
                return True
            i, j = second[k], second[(k + 1) % 3]
            if i not in first and j not in first and _edge_meets(nodes, i, j, first):
                return True
        return False
    if common == 2:
        # only if folded flat onto each other
        a, b, c = first[apex], first[(apex + 1) % 3], first[(apex + 2) % 3]
        d = second[other_apex]
        if _side_of_plane(nodes, a, b, c, d) != 0:
            return False
        p, q = _plane_axes(nodes, first)
        return _turn(nodes, b, c, a, p, q) == _turn(nodes, b, c, d, p, q)
    return True


@compiled
def _edge_meets(nodes, i, j, triangle):  # type: ignore[no-untyped-def]
    """Whether the edge from node i to node j and the triangle have a point in common."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    begin, end = _side_of_plane(nodes, a, b, c, i), _side_of_plane(nodes, a, b, c, j)
    if begin * end > 0:
        return False
    if begin == 0 and end == 0:
        return _edge_meets_in_plane(nodes, i, j, triangle)
    x = _side_of_plane(nodes, i, j, a, b)
    y = _side_of_plane(nodes, i, j, b, c)
    z = _side_of_plane(nodes, i, j, c, a)
    return (x >= 0 and y >= 0 and z >= 0) or (x <= 0 and y <= 0 and z <= 0)


@compiled
def _edge_meets_in_plane(nodes, i, j, triangle):  # type: ignore[no-untyped-def]
    p, q = _plane_axes(nodes, triangle)
    a, b, c = triangle[0], triangle[1], triangle[2]
    x, y, z = _turn(nodes, a, b, i, p, q), _turn(nodes, b, c, i, p, q), _turn(nodes, c, a, i, p, q)
    if (x >= 0 and y >= 0 and z >= 0) or (x <= 0 and y <= 0 and z <= 0):
        return True
    for k in range(3):
        u, v = triangle[k], triangle[(k + 1) % 3]
        s, t = _turn(nodes, i, j, u, p, q), _turn(nodes, i, j, v, p, q)
        e, f = _turn(nodes, u, v, i, p, q), _turn(nodes, u, v, j, p, q)
        if s == 0 and t == 0:  # on one line
            overlap = True
            for d in (p, q):
                overlap = overlap and (
                    max(nodes[i, d], nodes[j, d]) >= min(nodes[u, d], nodes[v, d])
                    and max(nodes[u, d], nodes[v, d]) >= min(nodes[i, d], nodes[j, d])
                )
            if overlap:
                return True
        elif s * t <= 0 and e * f <= 0:
            return True
    return False


@compiled
def _minor(nodes, a, b, c, p, q):  # type: ignore[no-untyped-def]
    """Component of (b - a) x (c - a) normal to the axes p and q; below 2^59."""
    return (nodes[b, p] - nodes[a, p]) * (nodes[c, q] - nodes[a, q]) - (
        nodes[b, q] - nodes[a, q]
    ) * (nodes[c, p] - nodes[a, p])


@compiled
def _turn(nodes, a, b, c, p, q):  # type: ignore[no-untyped-def]
    """+1 where a, b, c turn left in the plane of the axes p and q, -1 right, 0 on one line."""
    return np.sign(_minor(nodes, a, b, c, p, q))


@compiled
def _plane_axes(nodes, triangle):  # type: ignore[no-untyped-def]
    """The two axes onto which the triangle projects with the largest area."""
    best, p, q = -1, 0, 1
    for d in range(3):
        u, v = (d + 1) % 3, (d + 2) % 3
        size = abs(_minor(nodes, triangle[0], triangle[1], triangle[2], u, v))
        if size > best:
            best, p, q = size, u, v
    return p, q


@compiled
def _side_of_plane(nodes, a, b, c, d):  # type: ignore[no-untyped-def]
    """Sign of ((b - a) x (c - a)).(d - a), exactly.

    The products reach 2^88: each minor is split in two halves of 30 bits, so that sums of
    products stay below 2^62.
    """
    upper, lower = 0, 0
    for axis in range(3):
        minor = _minor(nodes, a, b, c, (axis + 1) % 3, (axis + 2) % 3)
        length = nodes[d, axis] - nodes[a, axis]
        half = minor >> 30
        upper += half * length
        lower += (minor - (half << 30)) * length
    upper += lower >> 30
    rest = lower & (2**30 - 1)
    if upper > 0:
        return 1
    if upper < 0:
        return -1
    return 1 if rest > 0 else 0
