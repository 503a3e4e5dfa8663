"""Multifrontal Cholesky factorization of symmetric positive definite matrices over a mesh.

Fronts as in `fronts`, dense kernels as in `tiles`. A panel holds the columns of the factor that
belong to one front, with the inverse of the diagonal: the pivot rows and the boundary rows, either
filled up to whole tiles.
"""

from __future__ import annotations

import weakref
from typing import NoReturn

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.numerics.compiled import compiled, nested
from amoeboid.numerics.sparse.banded import SingularMatrix
from amoeboid.numerics.sparse.fronts import (
    BOUNDARY,
    CHILD,
    ENTRY,
    FIRST,
    INSIDE,
    LEADING,
    LIST,
    PANEL,
    PIVOTS,
    UPDATE,
    Fronts,
    fronts,
)
from amoeboid.numerics.sparse.tiles import (
    COLUMNS,
    NONE,
    ROWS,
    TILE,
    add_dots,
    address,
    cholesky,
    scatter,
    subtract,
)

# Unknowns of a node.
SIZE = 3
# Maximum number of nodes of a piece that is not divided further.
MAX_UNDIVIDED = 8
# Right-hand sides that are solved for together.
VECTORS = 4
# Columns of a panel that are brought up to date together.
BLOCK = 96
# Numbers of a panel that stay in the cache while they are used again.
CACHED = 24_000

_cholesky_6, _cholesky_3 = cholesky(COLUMNS), cholesky(SIZE)


class SparseCholesky:
    """Cholesky factorization of matrices with 3 x 3 blocks on one symmetric pattern.

    The pattern of V nodes is in compressed rows and contains the diagonal. The analysis of the
    pattern is kept, and the memory of factors that are no longer in use.
    """

    def __init__(self, row_start: Index, columns: Index) -> None:
        self.n, self._entries = SIZE * (len(row_start) - 1), len(columns)
        self._fronts = fronts(row_start, columns, SIZE, MAX_UNDIVIDED)
        self._updates = np.zeros(self._fronts.updates)
        self._unused: list[Array] = []

    def factor(self, entries: Array) -> CholeskyFactor:
        """Factorize; `entries` (P, 3, 3) on the pattern. Raises SingularMatrix."""
        f = self._fronts
        panels = self._unused.pop() if self._unused else np.empty(f.panels)
        blocks = np.ascontiguousarray(entries, dtype=float).reshape(self._entries, SIZE, SIZE)
        if not _factorized(
            blocks, f.table, f.down, f.across, f.entries, f.children, panels, self._updates
        ):
            self._unused.append(panels)
            raise SingularMatrix("the matrix must be positive definite; it is not")
        factor = CholeskyFactor(f, panels)
        weakref.finalize(factor, self._unused.append, panels)
        return factor


@compiled
def _factorized(entries, table, down, across, blocks, children, panels, updates):  # type: ignore[no-untyped-def]
    for i in range(len(panels)):
        panels[i] = 0.0
    for f in range(len(table) - 1):
        k, r, l0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL]
        u0, long = table[f, UPDATE], table[f, LEADING]
        for e in range(table[f, ENTRY], table[f + 1, ENTRY]):
            p, row, column = blocks[e, 0], blocks[e, 1], blocks[e, 2]
            for a in range(SIZE):
                place = l0 + ((row + a) >> 3) * (ROWS * k) + ((row + a) & 7) + ROWS * column
                for b in range(SIZE):
                    panels[place + ROWS * b] = entries[p, b, a]
        for i in range(u0, u0 + long * r):
            updates[i] = 0.0
        panel, update = address(panels, l0), address(updates, u0)
        for c in range(table[f, CHILD], table[f + 1, CHILD]):
            _extend(table, children[c], down, across, updates, panel, update, long)
        first = (k + ROWS - 1) >> 3
        tiles = first + (long >> 3)
        if not _eliminated(panel, k, tiles):
            return False
        origin = update - 8 * ROWS * first
        _subtract(origin, TILE, long, panel, k, k, ROWS * first, r, tiles)
    return True


@nested
def _extend(table, child, down, across, updates, panel, update, leading):  # type: ignore[no-untyped-def]
    """Add the update of a child to panel and update of its parent, at these addresses."""
    r, inside, begin = table[child, BOUNDARY], table[child, INSIDE], table[child, LIST]
    to_panel, to_update = address(down, begin), address(across, begin)
    for j in range(r):
        source = address(updates, table[child, UPDATE] + j * table[child, LEADING])
        column = across[begin + j]
        if j < inside:
            scatter(panel + 8 * column, to_panel, source, j, r)
        else:
            scatter(update + 8 * column * leading, to_update, source, j, r)


@nested
def _eliminated(panel, k, tiles):  # type: ignore[no-untyped-def]
    """Eliminate the k pivots of a panel; whether it is positive definite."""
    for begin in range(0, k, BLOCK):
        end = min(k, begin + BLOCK)
        if begin > 0:
            column = panel + 8 * ROWS * begin
            _subtract(column, ROWS * k, TILE, panel, k, begin, begin, end - begin, tiles)
        recent = panel + 8 * ROWS * begin
        for j in range(begin, end, COLUMNS):
            wide, column = min(COLUMNS, end - j), panel + 8 * ROWS * j
            if j > begin:
                subtract(
                    column, ROWS * k, TILE, recent, recent, j, k, j - begin, j >> 3, tiles, wide
                )
            if wide == COLUMNS:
                sound = _cholesky_6(panel, j, k, tiles)
            else:
                sound = _cholesky_3(panel, j, k, tiles)
            if not sound:
                return False
    return True


@nested
def _subtract(c, cv, cc, panel, k, depth, row, columns, tiles):  # type: ignore[no-untyped-def]
    """c -= (rows of the panel) (its rows from `row`)^T, on and below the diagonal, tile by tile.

    Number t, j of c, of tile t and column j, is t cv + j cc after the address c; the diagonal is at
    row `row` + j. Of the k columns of the panel the first `depth` count.
    """
    together = max(1, CACHED // (ROWS * depth))
    for low in range(row >> 3, tiles, together):
        high = min(tiles, low + together)
        for j in range(0, columns, COLUMNS):
            first, wide = max(low, (row + j) >> 3), min(COLUMNS, columns - j)
            subtract(c + 8 * j * cc, cv, cc, panel, panel, row + j, k, depth, first, high, wide)


@compiled
def _forward(table, order, boundary, panels, b, begin, vectors, x, local, solved):  # type: ignore[no-untyped-def]
    """x, in order of elimination: the columns of b from `begin` on, with L divided out."""
    n = len(b)
    for v in range(min(vectors, b.shape[1] - begin)):
        for i in range(len(order)):
            for d in range(SIZE):
                x[v * n + SIZE * i + d] = b[SIZE * order[i] + d, begin + v]
    mine, known = address(local, 0), address(solved, 0)
    for f in range(len(table) - 1):
        k, r, l0, x0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL], table[f, FIRST]
        first, b0, panel = (k + ROWS - 1) >> 3, table[f, LIST], address(panels, l0)
        tiles = first + (table[f, LEADING] >> 3)
        long = tiles * ROWS
        for i in range(vectors * long):
            local[i] = 0.0
        for v in range(vectors):
            for j in range(k):
                local[v * long + j] = x[v * n + x0 + j]
        for t in range(first):
            place, row = l0 + t * ROWS * k, t * ROWS
            subtract(mine, TILE, long, panel, known, NONE, k, row, t, t + 1, vectors)
            for j in range(row, min(row + ROWS, k)):
                for v in range(vectors):
                    at = v * long + row
                    y = local[at + j - row] * panels[place + ROWS * j + j - row]
                    solved[ROWS * j + v] = y
                    x[v * n + x0 + j] = y
                    for i in range(ROWS):
                        local[at + i] -= panels[place + ROWS * j + i] * y
        subtract(mine, TILE, long, panel, known, NONE, k, k, first, tiles, vectors)
        for v in range(vectors):
            at = v * long + first * ROWS
            for i in range(r):
                x[v * n + boundary[b0 + i]] += local[at + i]


@compiled
def _backward(table, order, boundary, panels, x, vectors, local, sums, begin, out):  # type: ignore[no-untyped-def]
    """Divide x by the transposed L; the columns of `out` from `begin` on become the solution."""
    n = len(out)
    known, total = address(local, 0), address(sums, 0)
    for f in range(len(table) - 2, -1, -1):
        k, r, l0, x0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL], table[f, FIRST]
        first, b0 = (k + ROWS - 1) >> 3, table[f, LIST]
        tiles = first + (table[f, LEADING] >> 3)
        for v in range(vectors):
            at = v * n
            for i in range(r):
                local[i] = x[at + boundary[b0 + i]]
            for i in range(r, table[f, LEADING]):
                local[i] = 0.0
            for i in range(ROWS * k):
                sums[i] = 0.0
            add_dots(total, address(panels, l0 + first * ROWS * k), k, known, k, tiles - first)
            for t in range(first - 1, -1, -1):
                row = t * ROWS
                place = l0 + t * ROWS * k
                last = min(row + ROWS, k)
                for i in range(ROWS):
                    local[i] = 0.0
                for j in range(last - 1, row - 1, -1):
                    y = x[at + x0 + j]
                    for i in range(ROWS):
                        y -= sums[ROWS * j + i]
                    for i in range(j + 1 - row, last - row):
                        y -= panels[place + ROWS * j + i] * local[i]
                    y *= panels[place + ROWS * j + j - row]
                    local[j - row] = y
                    x[at + x0 + j] = y
                add_dots(total, address(panels, place), k, known, row, 1)
    for v in range(min(vectors, out.shape[1] - begin)):
        for i in range(len(order)):
            for d in range(SIZE):
                out[SIZE * order[i] + d, begin + v] = x[v * n + SIZE * i + d]


class CholeskyFactor:
    """A factorized matrix. It cannot be copied: its memory is used again when it is gone."""

    def __init__(self, analysis: Fronts, panels: Array) -> None:
        self._fronts, self._panels = analysis, panels

    def __reduce__(self) -> NoReturn:
        raise TypeError("a factor cannot be copied, its memory is used again; factorize once more")

    def solve(self, b: Array) -> Array:
        """Solution x of A x = b; b (n,) or (n, k)."""
        f = self._fronts
        rhs = np.ascontiguousarray(b, dtype=float).reshape(SIZE * len(f.order), -1)
        out = np.empty(rhs.shape)
        for begin in range(0, rhs.shape[1], VECTORS):
            vectors = 1 if rhs.shape[1] - begin == 1 else VECTORS
            x = np.zeros(vectors * len(b))
            local, solved = np.empty(vectors * f.longest), np.empty(ROWS * f.longest)
            system = f.table, f.order, f.boundary, self._panels
            _forward(*system, rhs, begin, vectors, x, local, solved)
            _backward(*system, x, vectors, local, solved, begin, out)
        return out.reshape(b.shape)
