"""Multifrontal Cholesky factorization of symmetric positive definite matrices over a mesh.

Fronts as in `fronts`, dense kernels as in `tiles`. A panel holds the columns of the factor that
belong to one front, with the inverse of the diagonal: the pivot rows and the boundary rows, either
filled up to whole tiles.
"""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.banded import SingularMatrix
from amoeboid.numerics.compiled import compiled
from amoeboid.numerics.fronts import (
    BOUNDARY,
    CHILD,
    ENTRY,
    FIRST,
    LEADING,
    LIST,
    PANEL,
    PIVOTS,
    UPDATE,
    Fronts,
    fronts,
)
from amoeboid.numerics.tiles import COLUMNS, ROWS, TILES, cholesky, dots, subtract

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Unknowns of a node.
SIZE = 3
# Nodes in a piece that is not divided further.
MOST = 8
# Right-hand sides that are solved for together.
VECTORS = 4
# Columns of a panel that are brought up to date together.
BLOCK = 96
# Numbers of a panel that stay in the cache while they are used again.
CACHED = 24_000

_cholesky_6, _cholesky_3 = cholesky(COLUMNS), cholesky(SIZE)
_dots_31, _dots_34 = dots(SIZE, 1), dots(SIZE, VECTORS)


class BlockCholesky:
    """Cholesky factorization of matrices with 3 x 3 blocks on one symmetric pattern.

    The pattern of V nodes is in compressed rows and contains the diagonal. Kept are the analysis of
    the pattern and the memory of factors no longer in use.
    """

    def __init__(self, row_start: Index, columns: Index) -> None:
        self.n = SIZE * (len(row_start) - 1)
        self._fronts = fronts(row_start, columns, SIZE, MOST)
        self._updates = np.zeros(self._fronts.updates)
        self._unused: list[Array] = []

    def factor(self, entries: Array) -> CholeskyFactor:
        """Factorize; `entries` (P, 3, 3) on the pattern. Raises SingularMatrix."""
        f = self._fronts
        panels = self._unused.pop() if self._unused else np.empty(f.panels)
        blocks = np.ascontiguousarray(entries, dtype=float).reshape(-1, SIZE, SIZE)
        if not _factorized(
            blocks, f.table, f.row_in_parent, f.entries, f.children, panels, self._updates
        ):
            self._unused.append(panels)
            raise SingularMatrix("the matrix must be positive definite; it is not")
        factor = CholeskyFactor(f, panels)
        weakref.finalize(factor, self._unused.append, panels)
        return factor


@compiled
def _factorized(entries, table, row_in_parent, blocks, children, panels, updates):  # type: ignore[no-untyped-def]
    panels[:] = 0.0
    for f in range(len(table) - 1):
        k, r, l0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL]
        u0, leading = table[f, UPDATE], table[f, LEADING]
        for e in range(table[f, ENTRY], table[f + 1, ENTRY]):
            p, row, column = blocks[e]
            for a in range(SIZE):
                place = l0 + (row + a) // ROWS * (ROWS * k) + (row + a) % ROWS + ROWS * column
                for b in range(SIZE):
                    panels[place + ROWS * b] = entries[p, b, a]
        updates[u0 : u0 + leading * r] = 0.0
        for c in range(table[f, CHILD], table[f + 1, CHILD]):
            _extend(table, children[c], row_in_parent, panels, updates, l0, k, u0, leading)
        first, tiles = (k + ROWS - 1) // ROWS, (k + ROWS - 1) // ROWS + leading // ROWS
        if not _eliminated(panels, l0, k, tiles):
            return False
        _subtract(
            updates, u0 - ROWS * first, ROWS, leading, panels, l0, k, k, ROWS * first, r, tiles
        )
    return True


@compiled
def _extend(table, child, row_in_parent, panels, updates, l0, k, u0, leading):  # type: ignore[no-untyped-def]
    """Add the update of a child to panel and update of its parent."""
    r, long, begin = table[child, BOUNDARY], table[child, LEADING], table[child, LIST]
    high = (k + ROWS - 1) // ROWS * ROWS
    rows = row_in_parent[begin : begin + r]
    inside = 0
    while inside < r and rows[inside] < k:
        inside += 1
    for j in range(inside):
        source, target = table[child, UPDATE] + j * long, l0 + ROWS * rows[j]
        for i in range(j, r):
            row = rows[i]
            panels[target + row // ROWS * (ROWS * k) + row % ROWS] += updates[source + i]
    for j in range(inside, r):
        source = table[child, UPDATE] + j * long
        target = u0 + (rows[j] - high) * leading - high
        for i in range(j, r):
            updates[target + rows[i]] += updates[source + i]


@compiled
def _eliminated(panels, l0, k, tiles):  # type: ignore[no-untyped-def]
    """Eliminate the k pivots of a panel; whether it is positive definite."""
    for begin in range(0, k, BLOCK):
        end = min(k, begin + BLOCK)
        if begin > 0:
            _subtract(
                panels, l0 + ROWS * begin, ROWS * k, ROWS, panels, l0, k, begin, begin,
                end - begin, tiles,
            )  # fmt: skip
        l1 = l0 + ROWS * begin
        for j in range(begin, end, COLUMNS):
            wide = min(COLUMNS, end - j)
            if j > begin:
                _subtract(
                    panels, l0 + ROWS * j, ROWS * k, ROWS, panels, l1, k, j - begin, j, wide, tiles
                )
            if wide == COLUMNS:
                sound = _cholesky_6(panels, l0, j, k, tiles)
            else:
                sound = _cholesky_3(panels, l0, j, k, tiles)
            if not sound:
                return False
    return True


@compiled
def _subtract(c, c0, cv, cc, panels, l0, k, depth, row, columns, tiles):  # type: ignore[no-untyped-def]
    """c -= (rows of the panel) (its rows from `row`)^T, on and below the diagonal, tile by tile.

    Tile t, column j of c is at c0 + t cv + j cc; the diagonal is at row `row` + j. l0: place of the
    first of the `depth` columns of the panel, of width k, that count.
    """
    first = row // ROWS
    together = max(TILES, CACHED // (ROWS * depth))
    for low in range(first, tiles, together):
        high = min(tiles, low + together)
        for j in range(0, columns, COLUMNS):
            subtract(
                c, c0 + j * cc, cv, cc, panels, l0, panels, l0, row + j, k, depth,
                max(low, (row + j) // ROWS), high, min(COLUMNS, columns - j),
            )  # fmt: skip


@compiled
def _forward(table, boundary, panels, x, vectors, local, solved):  # type: ignore[no-untyped-def]
    n = len(x) // vectors
    for f in range(len(table) - 1):
        k, r, l0, x0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL], table[f, FIRST]
        first, b0 = (k + ROWS - 1) // ROWS, table[f, LIST]
        tiles = first + table[f, LEADING] // ROWS
        long = tiles * ROWS
        local[: vectors * long] = 0.0
        for v in range(vectors):
            for j in range(k):
                local[v * long + j] = x[v * n + x0 + j]
        for t in range(first):
            place, row = l0 + t * ROWS * k, t * ROWS
            subtract(
                local, 0, ROWS, long, panels, l0, solved, 0, 0, k, row, t, t + 1, vectors
            )  # fmt: skip
            for j in range(row, min(row + ROWS, k)):
                for v in range(vectors):
                    at = v * long + row
                    y = local[at + j - row] * panels[place + ROWS * j + j - row]
                    solved[ROWS * j + v] = y
                    x[v * n + x0 + j] = y
                    for i in range(ROWS):
                        local[at + i] -= panels[place + ROWS * j + i] * y
        subtract(
            local, 0, ROWS, long, panels, l0, solved, 0, 0, k, k, first, tiles, vectors
        )  # fmt: skip
        for v in range(vectors):
            at = v * long + first * ROWS
            for i in range(r):
                x[v * n + boundary[b0 + i]] += local[at + i]


@compiled
def _backward(table, boundary, panels, x, vectors, local, solved):  # type: ignore[no-untyped-def]
    n = len(x) // vectors
    for f in range(len(table) - 2, -1, -1):
        k, r, l0, x0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL], table[f, FIRST]
        first, b0 = (k + ROWS - 1) // ROWS, table[f, LIST]
        tiles = first + table[f, LEADING] // ROWS
        long = tiles * ROWS
        local[: vectors * long] = 0.0
        for v in range(vectors):
            at = v * long + first * ROWS
            for i in range(r):
                local[at + i] = x[v * n + boundary[b0 + i]]
        for j in range(k - SIZE, -1, -SIZE):
            for v in range(vectors):
                for d in range(SIZE):
                    solved[SIZE * v + d] = x[v * n + x0 + j + d]
            if vectors == 1:
                _dots_31(solved, 0, panels, l0, j, k, j // ROWS, tiles, local, 0, long)
            else:
                _dots_34(solved, 0, panels, l0, j, k, j // ROWS, tiles, local, 0, long)
            for v in range(vectors):
                for d in range(SIZE - 1, -1, -1):
                    y = solved[SIZE * v + d]
                    for e in range(d + 1, SIZE):
                        row = j + e
                        place = l0 + row // ROWS * (ROWS * k) + row % ROWS + ROWS * (j + d)
                        y -= panels[place] * local[v * long + row]
                    row = j + d
                    y *= panels[l0 + row // ROWS * (ROWS * k) + row % ROWS + ROWS * row]
                    local[v * long + row] = y
                    x[v * n + x0 + row] = y


@compiled
def _solve(table, order, boundary, panels, b, begin, vectors, out):  # type: ignore[no-untyped-def]
    n = len(b)
    count = min(vectors, b.shape[1] - begin)
    x, long = np.zeros(vectors * n), 0
    for v in range(count):
        for i in range(len(order)):
            for d in range(SIZE):
                x[v * n + SIZE * i + d] = b[SIZE * order[i] + d, begin + v]
    for f in range(len(table) - 1):
        long = max(long, table[f, PIVOTS] + ROWS + table[f, LEADING])
    local, solved = np.empty(vectors * long), np.empty(ROWS * long)
    _forward(table, boundary, panels, x, vectors, local, solved)
    _backward(table, boundary, panels, x, vectors, local, solved)
    for v in range(count):
        for i in range(len(order)):
            for d in range(SIZE):
                out[SIZE * order[i] + d, begin + v] = x[v * n + SIZE * i + d]


class CholeskyFactor:
    """A factorized matrix."""

    def __init__(self, analysis: Fronts, panels: Array) -> None:
        self._fronts, self._panels = analysis, panels

    def solve(self, b: Array) -> Array:
        """Solution x of A x = b; b (n,) or (n, k)."""
        f = self._fronts
        rhs = np.ascontiguousarray(b, dtype=float).reshape(len(b), -1)
        x = np.empty(rhs.shape)
        for begin in range(0, rhs.shape[1], VECTORS):
            vectors = 1 if rhs.shape[1] - begin == 1 else VECTORS
            _solve(f.table, f.order, f.boundary, self._panels, rhs, begin, vectors, x)
        return x.reshape(b.shape)
