"""Nested dissection: an order of elimination for the nodes of a mesh on a surface.

A. George, SIAM J. Numer. Anal. 10, 345 (1973). A piece of the mesh is cut in two by a separator, a
set of nodes without which its halves do not touch; halves come before separators, so that their
eliminations do not meet. Separators start as levels of distance from an outlying node (A. George,
J. W. H. Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981, ch. 8) and are then
shortened by moving single nodes.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Index
from amoeboid.numerics.compiled import compiled, nested

# Least share of the nodes of a piece that either side of a cut should have.
MIN_SHARE = 0.3
# Rounds of shortening a separator.
ROUNDS = 8
LEFT, RIGHT, CUT = 0, 1, 2


def dissected(row_start: Index, columns: Index, most: int) -> tuple[Index, Index, Index]:
    """Order (V,), first (N + 1,) and parent (N,) of the pieces of a symmetric pattern.

    Piece f consists of the nodes order[first[f]:first[f + 1]], eliminated together; it is a
    separator, or a rest of at most `most` nodes, and touches, apart from pieces before it, only its
    ancestors. Parents follow their children, and the descendants of a piece come right before it;
    the parent of a root is -1.
    """
    order = np.arange(len(row_start) - 1)
    ends, parents, found = _dissected(row_start, columns, most, order)
    ends, parents = ends[:found], parents[:found]
    by_place = np.argsort(ends[:, 1], kind="stable")
    place = np.empty(len(by_place) + 1, dtype=np.int64)
    place[by_place] = np.arange(len(by_place))
    place[-1] = -1
    first = np.append(ends[by_place, 0], len(order))
    return order, first, place[parents[by_place]]


@compiled
def _dissected(row_start, columns, most, order):  # type: ignore[no-untyped-def]
    """Sort `order`; where pieces begin and end in it, and their parents, as they are found."""
    n = len(order)
    piece, level = np.zeros(n, np.int64), np.zeros(n, np.int64)
    queue, side = np.empty(n, np.int64), np.zeros(n, np.int64)
    ends, parents = np.empty((n, 2), np.int64), np.empty(n, np.int64)
    waiting = np.empty((n + 1, 3), np.int64)
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, n, -1
    found, stamp, top = 0, 0, 1
    while top > 0:
        top -= 1
        low, high, parent = waiting[top, 0], waiting[top, 1], waiting[top, 2]
        stamp += 1
        for k in range(low, high):
            piece[order[k]] = stamp
        left, cut = low, low
        if high - low > most:
            left, cut = _halved(
                row_start, columns, order, low, high, piece, stamp, level, queue, side
            )
        if cut < high:
            ends[found, 0], ends[found, 1], parents[found] = cut, high, parent
            parent = found
            found += 1
        if left > low:
            waiting[top, 0], waiting[top, 1], waiting[top, 2] = low, left, parent
            top += 1
        if cut > left:
            waiting[top, 0], waiting[top, 1], waiting[top, 2] = left, cut, parent
            top += 1
    return ends, parents, found


@nested
def _halved(row_start, columns, order, low, high, piece, stamp, level, queue, side):  # type: ignore[no-untyped-def]
    """Sort order[low:high] into two sides and their separator; where the latter two begin."""
    size = high - low
    last, reached = order[low], 0
    for _ in range(2):
        reached = _levels(row_start, columns, last, piece, stamp, level, queue)
        last = queue[reached - 1]
    if reached < size:  # already in pieces
        for k in range(reached):
            piece[queue[k]] = -stamp
        rest = low + reached
        for k in range(low, high):
            if piece[order[k]] == stamp:
                queue[reached] = order[k]
                reached += 1
        for k in range(size):
            order[low + k] = queue[k]
        return rest, high
    middle = _middle(level, queue, size)
    for k in range(size):
        v = queue[k]
        side[v] = LEFT if level[v] < middle else (RIGHT if level[v] > middle else CUT)
    _shorten(row_start, columns, queue, size, piece, stamp, side)
    place, left, cut = low, low, low
    for kind in (LEFT, RIGHT, CUT):
        left, cut = cut, place
        for k in range(size):
            if side[queue[k]] == kind:
                order[place] = queue[k]
                place += 1
    return left, cut


@nested
def _levels(row_start, columns, start, piece, stamp, level, queue):  # type: ignore[no-untyped-def]
    """Distances in the piece from `start`, and a queue of the nodes by them; how many there are."""
    mark = -stamp
    queue[0], level[start], piece[start] = start, 0, mark
    reached, k = 1, 0
    while k < reached:
        v = queue[k]
        k += 1
        for p in range(row_start[v], row_start[v + 1]):
            w = columns[p]
            if piece[w] == stamp:
                piece[w] = mark
                level[w] = level[v] + 1
                queue[reached] = w
                reached += 1
    for k in range(reached):
        piece[queue[k]] = stamp
    return reached


@nested
def _middle(level, queue, size):  # type: ignore[no-untyped-def]
    """The level with the fewest nodes among those that leave enough on both sides."""
    best, least, k = level[queue[size // 2]], np.inf, 0
    while k < size:
        begin = k
        while k < size and level[queue[k]] == level[queue[begin]]:
            k += 1
        balance = min(begin, size - k) / size
        cost = (k - begin) * (1.0 + (0.5 - balance))
        if balance >= MIN_SHARE and cost < least:
            best, least = level[queue[begin]], cost
    return best


@nested
def _shorten(row_start, columns, queue, size, piece, stamp, side):  # type: ignore[no-untyped-def]
    """Move nodes of the separator to a side if this shortens it or balances the halves better."""
    sizes = np.zeros(3, np.int64)
    for k in range(size):
        sizes[side[queue[k]]] += 1
    if min(sizes[LEFT], sizes[RIGHT]) == 0:
        return
    least = int(MIN_SHARE * size)
    for _ in range(ROUNDS):
        moved = 0
        for k in range(size):
            v = queue[k]
            if side[v] != CUT:
                continue
            touched = np.zeros(3, np.int64)
            for p in range(row_start[v], row_start[v + 1]):
                if piece[columns[p]] == stamp:
                    touched[side[columns[p]]] += 1
            # to the side that loses fewer nodes to the separator; to the smaller one if equal
            to = LEFT if touched[RIGHT] < touched[LEFT] else RIGHT
            if touched[RIGHT] == touched[LEFT]:
                to = LEFT if sizes[LEFT] < sizes[RIGHT] else RIGHT
            other = 1 - to
            lost = touched[other]
            balanced = lost == 1 and sizes[to] + 1 < sizes[other]
            if not (lost == 0 or balanced) or sizes[other] - lost < max(
                1, min(least, sizes[other])
            ):
                continue
            side[v] = to
            sizes[to] += 1
            sizes[CUT] += lost - 1
            sizes[other] -= lost
            moved += 1
            for p in range(row_start[v], row_start[v + 1]):
                w = columns[p]
                if piece[w] == stamp and side[w] == other:
                    side[w] = CUT
        if moved == 0:
            return
