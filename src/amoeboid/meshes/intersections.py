"""Self-intersection of a triangulation, decided exactly on a fine grid.

Coordinates are rounded to whole numbers below 2^29, on a grid of 2e-9 to 4e-9 of the size of the
surface whose spacing is a power of two: short binary fractions stay what they are. There the sign
of every determinant is found in 64-bit arithmetic without rounding, so that flat, touching and
nearly touching parts are no special risk. Candidates come from sorting the bounding boxes along
the longest axis of the surface.

A surface that a center sees from inside, every triangle once, cannot cross itself. That takes one
pass over the triangles and spares runs the search, as long as the cell has no deep folds.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.geometry import volume_centroid
from amoeboid.numerics.compiled import compiled, nested

GRID = 2**29 - 1
# Least share of the product of the distances of its corners that the volume between the center and
# a triangle counts as positive with; far above rounding.
SEEN_FROM_INSIDE = 1e-6


def embedded(r: Array, faces: Index) -> bool:
    """Whether a closed surface nowhere touches or crosses itself; r (V, 3), faces (F, 3)."""
    return _star_shaped(r - volume_centroid(r, faces), faces) or intersecting_pair(r, faces) is None


def intersecting_pair(r: Array, faces: Index) -> tuple[int, int] | None:
    """Two triangles that meet elsewhere than in a common node or edge, or None.

    r (V, 3), faces (F, 3) without degenerate triangles; touching counts as meeting.
    """
    extent = np.ptp(r, axis=0)
    spacing = 2.0 ** np.ceil(np.log2(extent.max() / GRID))
    nodes = np.rint((r - r.min(axis=0)) / spacing).astype(np.int64)
    axes = np.argsort(-extent, kind="stable")
    low, high = _boxes(nodes, faces, axes)
    order = np.argsort(low[:, 0], kind="stable")
    first, second = _first_meeting(nodes, faces[order], low[order], high[order])
    return None if first < 0 else (int(order[first]), int(order[second]))


@compiled
def _star_shaped(x, faces):  # type: ignore[no-untyped-def]
    """Whether rays from the origin pierce each one triangle, from inside.

    All triangles seen from inside cover the sphere of directions without folds; it is covered once
    where the sum of their solid angles is 4 pi (A. van Oosterom, J. Strackee, IEEE Trans. Biomed.
    Eng. 30, 1983).
    """
    total = 0.0
    for f in range(faces.shape[0]):
        a, b, c = x[faces[f, 0]], x[faces[f, 1]], x[faces[f, 2]]
        sixfold = (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
        aa, bb, cc, ab, bc, ca = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for d in range(3):
            aa, bb, cc = aa + a[d] * a[d], bb + b[d] * b[d], cc + c[d] * c[d]
            ab, bc, ca = ab + a[d] * b[d], bc + b[d] * c[d], ca + c[d] * a[d]
        aa, bb, cc = np.sqrt(aa), np.sqrt(bb), np.sqrt(cc)
        if not sixfold > SEEN_FROM_INSIDE * aa * bb * cc:
            return False
        total += 2.0 * np.arctan2(sixfold, aa * bb * cc + ab * cc + bc * aa + ca * bb)
    return total < 6.0 * np.pi


@compiled
def _boxes(nodes, faces, axes):  # type: ignore[no-untyped-def]
    """Least and largest coordinates (F, 3) of the corners, along `axes` in this order."""
    low, high = np.empty(faces.shape, np.int64), np.empty(faces.shape, np.int64)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            a, b, c = nodes[i, axes[d]], nodes[j, axes[d]], nodes[k, axes[d]]
            low[f, d], high[f, d] = min(a, b, c), max(a, b, c)
    return low, high


@compiled
def _first_meeting(nodes, faces, low, high):  # type: ignore[no-untyped-def]
    """Sweep along the first axis; faces, low, high in ascending order of low[:, 0]."""
    for i in range(len(faces)):
        for j in range(i + 1, len(faces)):
            if low[j, 0] > high[i, 0]:
                break
            if low[j, 1] > high[i, 1] or low[i, 1] > high[j, 1]:
                continue
            if low[j, 2] > high[i, 2] or low[i, 2] > high[j, 2]:
                continue
            if _meet(nodes, faces[i], faces[j]):
                return i, j
    return -1, -1


@nested
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
        if _beside(nodes, first, second) or _beside(nodes, second, first):
            return False
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


@nested
def _beside(nodes, first, second):  # type: ignore[no-untyped-def]
    """Whether all corners of `second`, but for common ones, are clearly on one side of `first`.

    In floating point, where the determinant exceeds every rounding error of products up to 2^88.
    """
    o, b, c = first[0], first[1], first[2]
    normal_x = float(_minor(nodes, o, b, c, 1, 2))
    normal_y = float(_minor(nodes, o, b, c, 2, 0))
    normal_z = float(_minor(nodes, o, b, c, 0, 1))
    above, below = False, False
    for k in range(3):
        i = second[k]
        if i in (o, b, c):
            continue
        distance = (
            normal_x * (nodes[i, 0] - nodes[o, 0])
            + normal_y * (nodes[i, 1] - nodes[o, 1])
            + normal_z * (nodes[i, 2] - nodes[o, 2])
        )
        if abs(distance) < 2.0**40:
            return False
        above, below = above or distance > 0, below or distance < 0
    return not (above and below)


@nested
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


@nested
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


@nested
def _minor(nodes, a, b, c, p, q):  # type: ignore[no-untyped-def]
    """Component of (b - a) x (c - a) normal to the axes p and q; below 2^59."""
    return (nodes[b, p] - nodes[a, p]) * (nodes[c, q] - nodes[a, q]) - (
        nodes[b, q] - nodes[a, q]
    ) * (nodes[c, p] - nodes[a, p])


@nested
def _turn(nodes, a, b, c, p, q):  # type: ignore[no-untyped-def]
    """+1 where a, b, c turn left in the plane of the axes p and q, -1 right, 0 on one line."""
    return np.sign(_minor(nodes, a, b, c, p, q))


@nested
def _plane_axes(nodes, triangle):  # type: ignore[no-untyped-def]
    """The two axes onto which the triangle projects with the largest area."""
    best, p, q = -1, 0, 1
    for d in range(3):
        u, v = (d + 1) % 3, (d + 2) % 3
        size = abs(_minor(nodes, triangle[0], triangle[1], triangle[2], u, v))
        if size > best:
            best, p, q = size, u, v
    return p, q


@nested
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
