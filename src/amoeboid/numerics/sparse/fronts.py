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

from amoeboid.arrays import Index
from amoeboid.numerics.compiled import compiled
from amoeboid.numerics.sparse.dissection import dissected
from amoeboid.numerics.sparse.tiles import ROWS

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
    table = _table(first, bounds, parent, size)
    by_parent = np.argsort(parent, kind="stable")
    children = by_parent[np.count_nonzero(parent < 0) :]
    table[:, CHILD] = np.searchsorted(parent[children], np.arange(len(parent) + 1))
    keys = np.repeat(np.arange(len(parent)), np.diff(bounds)) * len(order) + boundary
    rows = _Rows(size, table[:-1, PIVOTS], first, bounds, keys)
    down, across = _in_parent(table, boundary, parent, rows)
    entries = _entries(row_start, columns, order, new, table, rows)
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


def _table(first: Index, bounds: Index, parent: Index, size: int) -> Index:
    """The table of the fronts, but for children and entries.

    Updates lie on two stacks, fronts of even depth on one and of odd depth on the other: a front
    finds those of its children on top of one and puts its own on the other.
    """
    table = np.zeros((len(first), 10), np.int64)
    k, r = size * np.diff(first), size * np.diff(bounds)
    high, long = (k + ROWS - 1) & -ROWS, (r + ROWS - 1) & -ROWS
    table[:, FIRST], table[:, LIST] = size * first, size * bounds
    table[:-1, PIVOTS], table[:-1, BOUNDARY], table[:-1, LEADING] = k, r, long
    table[1:, PANEL] = np.cumsum((high + long) * k)
    up, lengths = parent.tolist(), (long * r).tolist()
    odd, used, places = [0] * len(up), [0] * len(up), []
    for f in range(len(up) - 1, -1, -1):
        odd[f] = 1 - odd[up[f]] if up[f] >= 0 else 0
    top, most = [0, 0], [0, 0]
    for f, length in enumerate(lengths):
        places.append(top[odd[f]])
        top[odd[f]] += length
        most[odd[f]] = max(most[odd[f]], top[odd[f]])
        top[1 - odd[f]] -= used[f]
        if up[f] >= 0:
            used[up[f]] += length
    table[:-1, UPDATE] = np.array(places) + most[0] * np.array(odd)
    table[-1, UPDATE] = sum(most)
    return table


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows in the panels of fronts; `keys`: front times number of nodes plus node, ascending."""

    size: int
    pivots: Index
    first: Index
    bounds: Index
    keys: Index

    def of(self, front: Index, node: Index) -> tuple[Index, NDArray[np.bool_], Index]:
        """First row of each node in its front, whether it is a pivot, first row of a boundary."""
        inside = node < self.first[front + 1]
        high = (self.pivots[front] + ROWS - 1) & -ROWS
        place = np.searchsorted(self.keys, front * self.first[-1] + node) - self.bounds[front]
        among = np.where(inside, node - self.first[front], place)
        return np.where(inside, 0, high) + self.size * among, inside, high


def _in_parent(table: Index, boundary: Index, parent: Index, rows: _Rows) -> tuple[Index, Index]:
    front = np.repeat(np.arange(len(parent)), np.diff(rows.bounds))
    row, inside, high = rows.of(parent[front], boundary)
    table[:-1, INSIDE] = rows.size * np.bincount(front[inside], minlength=len(parent))
    row = row[:, None] + np.arange(rows.size)
    width = rows.pivots[parent[front]][:, None]
    down = (row >> 3) * (ROWS * width) + (row & 7)
    across = np.where(inside[:, None], ROWS * row, row - high[:, None])
    return down.ravel(), across.ravel()


def _entries(
    row_start: Index, columns: Index, order: Index, new: Index, table: Index, rows: _Rows
) -> Index:
    """Blocks on and below the diagonal, in the order of elimination, with their places."""
    counts = np.diff(row_start)[order]
    begin = row_start[order] - (np.cumsum(counts) - counts)
    j = np.repeat(np.arange(len(order)), counts)
    p = np.arange(len(columns)) + begin[j]
    i = new[columns[p]]
    # the pattern is that of column j as well as of row j
    lower = i >= j
    p, i, j = p[lower], i[lower], j[lower]
    front = np.repeat(np.arange(len(table) - 1), np.diff(rows.first))[j]
    table[:, ENTRY] = np.searchsorted(front, np.arange(len(table)))
    return np.stack([p, rows.of(front, i)[0], rows.size * (j - rows.first[front])], axis=1)
