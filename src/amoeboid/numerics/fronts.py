"""Which dense matrices a sparse factorization consists of, and how they are put together.

Multifrontal method: I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 302 (1983); J. W. H. Liu,
SIAM Rev. 34, 82 (1992). A front holds the rows and columns of a piece of `dissection`, its pivots,
and of its boundary, the later nodes that its elimination touches. What the elimination leaves on
the boundary, the update, is added to the front of the parent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.numerics.dissection import dissected
from amoeboid.numerics.tiles import ROWS

Index = NDArray[np.int64]

# Columns of `Fronts.table`: first pivot (unknown), pivots, boundary unknowns, place of the panel,
# place and leading dimension of the update, first boundary unknown in `boundary`, first entry,
# first child in `children`, boundary unknowns that are pivots of the parent.
FIRST, PIVOTS, BOUNDARY, PANEL, UPDATE, LEADING, LIST, ENTRY, CHILD, INSIDE = range(10)


@dataclass(frozen=True, eq=False)
class Fronts:
    """The fronts of matrices of one sparsity, with `size` unknowns a node; N fronts, in order.

    `order` (V,) nodes in order of elimination. `table` (N + 1, 10) see above. `boundary` unknowns
    in order of elimination, front by front; in the parent, `down` their places in a column of the
    panel, and `across` the place of their column in the panel if they are pivots there, otherwise
    their row in the update. `entries` (E, 3): block of the matrix, row and column of its first
    number in the panel. `children`: fronts, parent by parent. `panels`, `updates`: how many numbers
    all of them take.
    """

    size: int
    order: Index
    table: Index
    boundary: Index
    down: Index
    across: Index
    entries: Index
    children: Index
    panels: int
    updates: int

    @cached_property
    def longest(self) -> int:
        """Rows of the longest front, or a little more: pivots and boundary in whole tiles."""
        return int(np.max(self.table[:, PIVOTS] + ROWS + self.table[:, LEADING]))


def fronts(row_start: Index, columns: Index, size: int, most: int) -> Fronts:
    """The fronts of a symmetric pattern in compressed rows; `most` nodes in an undivided piece."""
    order, first, parent = dissected(row_start, columns, most)
    new = np.empty_like(order)
    new[order] = np.arange(len(order))
    bounds, boundary = _boundaries(row_start, columns, order, new, first, parent)
    boundary = boundary[: bounds[-1]]
    by_parent = np.argsort(parent, kind="stable")
    children = by_parent[np.count_nonzero(parent < 0) :]
    child = np.searchsorted(parent[children], np.arange(len(parent) + 1))
    table = _table(first, bounds, parent, size)
    table[:, CHILD] = child
    down, across = _in_parent(table, boundary, first, bounds, parent, size)
    entries = _entries(row_start, columns, order, new, first, bounds, boundary, table, size)
    entries = entries[: table[-1, ENTRY]]
    unknowns = (size * boundary[:, None] + np.arange(size)).ravel()
    panels, updates = int(table[-1, PANEL]), int(table[-1, UPDATE])
    return Fronts(size, order, table, unknowns, down, across, entries, children, panels, updates)


@compiled
def _boundaries(row_start, columns, order, new, first, parent):  # type: ignore[no-untyped-def]
    """Boundary nodes (new numbers, ascending) of every front, and where they begin."""
    count = len(parent)
    bounds = np.zeros(count + 1, np.int64)
    found = np.empty(8 * len(order), np.int64)
    # numbers of fronts plus one
    seen = np.zeros(len(order), np.int64)
    child, sibling = np.zeros(count, np.int64), np.zeros(count, np.int64)
    total = 0
    for f in range(count):
        end = first[f + 1]
        if total + len(order) - end > len(found):
            longer = np.empty(2 * len(found), np.int64)
            for k in range(total):
                longer[k] = found[k]
            found = longer
        for k in range(first[f], end):
            v = order[k]
            for p in range(row_start[v], row_start[v + 1]):
                w = new[columns[p]]
                if w >= end and seen[w] != f + 1:
                    seen[w] = f + 1
                    found[total] = w
                    total += 1
        c = child[f]
        while c > 0:
            for k in range(bounds[c - 1], bounds[c]):
                w = found[k]
                if w >= end and seen[w] != f + 1:
                    seen[w] = f + 1
                    found[total] = w
                    total += 1
            c = sibling[c - 1]
        for k in range(bounds[f] + 1, total):  # nearly in order
            w, m = found[k], k
            while m > bounds[f] and found[m - 1] > w:
                found[m] = found[m - 1]
                m -= 1
            found[m] = w
        bounds[f + 1] = total
        if parent[f] >= 0:
            sibling[f], child[parent[f]] = child[parent[f]], f + 1
    return bounds, found


@compiled
def _table(first, bounds, parent, size):  # type: ignore[no-untyped-def]
    """The table of the fronts, but for children and entries.

    Updates lie on two stacks, fronts of even depth on one and of odd depth on the other: a front
    finds those of its children on top of one and puts its own on the other.
    """
    count = len(parent)
    table = np.zeros((count + 1, 10), np.int64)
    depth, used = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for f in range(count - 1, -1, -1):
        depth[f] = depth[parent[f]] + 1 if parent[f] >= 0 else 0
    top, most = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for f in range(count):
        k, r = size * (first[f + 1] - first[f]), size * (bounds[f + 1] - bounds[f])
        high, long = (k + ROWS - 1) & -ROWS, (r + ROWS - 1) & -ROWS
        table[f, FIRST], table[f, PIVOTS], table[f, BOUNDARY] = size * first[f], k, r
        table[f, LEADING], table[f, LIST] = long, size * bounds[f]
        table[f + 1, PANEL] = table[f, PANEL] + (high + long) * k
        parity = depth[f] % 2
        table[f, UPDATE] = top[parity]
        top[parity] += long * r
        most[parity] = max(most[parity], top[parity])
        top[1 - parity] -= used[f]
        if parent[f] >= 0:
            used[parent[f]] += long * r
    for f in range(count):
        if depth[f] % 2 == 1:
            table[f, UPDATE] += most[0]
    table[count, FIRST] = size * first[count]
    table[count, LIST] = size * bounds[count]
    table[count, UPDATE] = most[0] + most[1]
    return table


@compiled
def _in_parent(table, boundary, first, bounds, parent, size):  # type: ignore[no-untyped-def]
    down = np.zeros(size * len(boundary), np.int64)
    across = np.zeros(size * len(boundary), np.int64)
    for f in range(len(parent)):
        up = parent[f]
        if up < 0:
            continue
        width = table[up, PIVOTS]
        high = (width + ROWS - 1) & -ROWS
        m = bounds[up]
        for k in range(bounds[f], bounds[f + 1]):
            v = boundary[k]
            inside = v < first[up + 1]
            if inside:
                row = size * (v - first[up])
                table[f, INSIDE] += size
            else:
                while boundary[m] != v:
                    m += 1
                row = high + size * (m - bounds[up])
            for d in range(size):
                down[size * k + d] = ((row + d) >> 3) * (ROWS * width) + ((row + d) & 7)
                across[size * k + d] = ROWS * (row + d) if inside else row + d - high
    return down, across


@compiled
def _entries(row_start, columns, order, new, first, bounds, boundary, table, size):  # type: ignore[no-untyped-def]
    """Blocks on and below the diagonal, in the order of elimination, with their places."""
    entries = np.empty((len(columns), 3), np.int64)
    row = np.empty(len(order), np.int64)
    total = 0
    for f in range(len(first) - 1):
        table[f, ENTRY] = total
        high = (table[f, PIVOTS] + ROWS - 1) & -ROWS
        for m in range(bounds[f], bounds[f + 1]):
            row[boundary[m]] = high + size * (m - bounds[f])
        for j in range(first[f], first[f + 1]):
            row[j] = size * (j - first[f])
        for j in range(first[f], first[f + 1]):
            v = order[j]
            for p in range(row_start[v], row_start[v + 1]):
                i = new[columns[p]]
                if i >= j:
                    # the pattern is that of column j as well as of row j
                    entries[total, 0], entries[total, 1], entries[total, 2] = p, row[i], row[j]
                    total += 1
    table[len(first) - 1, ENTRY] = total
    return entries
