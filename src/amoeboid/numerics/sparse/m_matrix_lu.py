"""Multifrontal LU factorization, without pivoting, of M-matrices.

Fronts as in `fronts`, one unknown a node; kernels as in `tiles`. Where the off-diagonal entries are
<= 0 and the column sums positive, as for implicit transport, elimination in any order keeps both,
and does not need to exchange rows (R. S. Varga, Matrix Iterative Analysis, 1962; G. H. Golub, C. F.
Van Loan, Matrix Computations, 4.1). A front has two panels, one for the columns of L, whose
diagonal is 1, and one for the columns of the transposed U.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.numerics.compiled import compiled, nested
from amoeboid.numerics.sparse.banded import GeneralBand, SingularMatrix
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
    NONE,
    ROWS,
    TILE,
    add_dots,
    address,
    gauss,
    scatter,
    subtract,
)

# Maximum number of nodes of a piece that is not divided further.
MAX_UNDIVIDED = 16
# Residuals, as shares of |A| |x| + |b| (sums of magnitudes): one that is rounding, so that the
# guess is the solution, and the largest accepted without an exchange of rows.
ROUNDING = 1e-15
ACCEPTED = 1e-13

_gauss_6, _gauss_3, _gauss_1 = gauss(6), gauss(3), gauss(1)


class MMatrixLU:
    """Solver for (n, n) matrices of one sparsity, in compressed rows.

    The pattern must be symmetric, contain the diagonal, and list the columns of a row ascending.
    """

    def __init__(self, row_start: Index, columns: Index) -> None:
        self.n = len(row_start) - 1
        self._row_start, self._columns = row_start, columns

    @cached_property
    def _fronts(self) -> Fronts:
        return fronts(self._row_start, self._columns, 1, MAX_UNDIVIDED)

    @cached_property
    def _rows(self) -> Index:
        return np.repeat(np.arange(self.n), np.diff(self._row_start))

    @cached_property
    def _transposed(self) -> Index:
        return np.lexsort((self._rows, self._columns))

    @cached_property
    def _workspace(self) -> tuple[Array, Array, Array]:
        f = self._fronts
        return np.empty(f.panels), np.empty(f.panels), np.empty(f.updates)

    @cached_property
    def _local(self) -> tuple[Array, Array]:
        longest = self._fronts.longest
        return np.empty(longest), np.empty(ROWS * longest)

    @cached_property
    def _direct(self) -> GeneralBand:
        return GeneralBand(self._rows, self._columns, self.n)

    def solve(self, entries: Array, b: Array, guess: Array) -> Array:
        """Solution x (n,) of A x = b; `entries` on the pattern. Raises SingularMatrix.

        The rounding errors of the elimination are proportional to the distance from the guess.
        A matrix that is not an M-matrix is solved by banded LU with pivoting.
        """
        x, r = np.array(guess, dtype=float), np.empty(self.n)
        if self._left(entries, b, x, r) <= ROUNDING:
            return x
        if self._factorized(entries, *self._workspace[:2]):
            x = self._improved(self._workspace[:2], x, r)
            if self._left(entries, b, x, r) <= ACCEPTED:
                return x
        return self._directly(entries, b)

    def factor(self, entries: Array) -> MMatrixFactor:
        """The factorized matrix with these `entries`, for many right-hand sides."""
        panels = (np.empty(self._fronts.panels), np.empty(self._fronts.panels))
        return MMatrixFactor(self, entries, panels if self._factorized(entries, *panels) else None)

    def _factorized(self, entries: Array, lower: Array, upper: Array) -> bool:
        f, updates = self._fronts, self._workspace[2]
        return bool(_factorized(entries, self._transposed, f.table, f.down, f.across, f.entries,
                                f.children, lower, upper, updates))  # fmt: skip

    def _left(self, entries: Array, b: Array, x: Array, r: Array) -> float:
        """The residual r = b - A x, and its size as a share of |A| |x| + |b|."""
        left, scale = _residual(entries, self._row_start, self._columns, b, x, r)
        if not scale < np.inf:
            return np.inf
        return float(left / scale) if left > 0.0 else 0.0

    def _improved(self, panels: tuple[Array, Array], x: Array, r: Array) -> Array:
        """x with the residual r eliminated."""
        f, change = self._fronts, r[self._fronts.order]
        _substituted(f.table, f.boundary, *panels, change, *self._local)
        x[f.order] += change
        return x

    def _directly(self, entries: Array, b: Array) -> Array:
        if not (np.all(np.isfinite(entries)) and np.all(np.isfinite(b))):
            raise SingularMatrix("the matrix must be regular; a number is not finite")
        return self._direct.factor(entries).solve(b)


@dataclass(frozen=True, eq=False, repr=False)
class MMatrixFactor:
    """A factorized matrix; without `panels` elimination in any order would not be sound."""

    solver: MMatrixLU
    entries: Array
    panels: tuple[Array, Array] | None

    def solve(self, b: Array) -> Array:
        """Solution x (n,) of A x = b. Raises SingularMatrix."""
        x, r = np.zeros(len(b)), np.array(b, dtype=float)
        if self.panels is not None:
            x = self.solver._improved(self.panels, x, r)
            if self.solver._left(self.entries, b, x, r) <= ACCEPTED:
                return x
        return self.solver._directly(self.entries, b)


@compiled
def _residual(entries, row_start, columns, b, x, r):  # type: ignore[no-untyped-def]
    """r = b - A x; the sums of the magnitudes of r, and of all that it is a sum of."""
    left, scale = 0.0, 0.0
    for i in range(len(x)):
        total, size = b[i], abs(b[i])
        for k in range(row_start[i], row_start[i + 1]):
            term = entries[k] * x[columns[k]]
            total -= term
            size += abs(term)
        r[i] = total
        left += abs(total)
        scale += size
    return left, scale


@compiled
def _factorized(entries, transposed, table, down, across, places, children, lower, upper, updates):  # type: ignore[no-untyped-def]
    for i in range(len(lower)):
        lower[i] = 0.0
        upper[i] = 0.0
    for f in range(len(table) - 1):
        k, r, l0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL]
        u0, long = table[f, UPDATE], table[f, LEADING]
        for e in range(table[f, ENTRY], table[f + 1, ENTRY]):
            p, row = places[e, 0], places[e, 1]
            place = l0 + (row >> 3) * (ROWS * k) + (row & 7) + ROWS * places[e, 2]
            lower[place], upper[place] = entries[transposed[p]], entries[p]
        for i in range(u0, u0 + long * r):
            updates[i] = 0.0
        left, right, update = address(lower, l0), address(upper, l0), address(updates, u0)
        for c in range(table[f, CHILD], table[f + 1, CHILD]):
            _extend(table, children[c], down, across, updates, left, right, update, long)
        first = (k + ROWS - 1) >> 3
        tiles = first + (long >> 3)
        if not _eliminated(left, right, k, tiles):
            return False
        j, column, row = 0, update - 8 * ROWS * first, ROWS * first
        while j < r:
            wide = _width(r - j)
            subtract(column, TILE, long, left, right, row + j, k, k, first, tiles, wide)
            j, column = j + wide, column + 8 * wide * long
    return True


@nested
def _width(left):  # type: ignore[no-untyped-def]
    """The widest product for `left` columns."""
    if left >= 6:
        return 6
    return 3 if left >= 3 else 1


@nested
def _extend(table, child, down, across, updates, left, right, update, leading):  # type: ignore[no-untyped-def]
    """Add the update of a child to panels and update of its parent, at these addresses."""
    r, inside, begin = table[child, BOUNDARY], table[child, INSIDE], table[child, LIST]
    to_panel, to_update = address(down, begin), address(across, begin)
    for j in range(r):
        source = address(updates, table[child, UPDATE] + j * table[child, LEADING])
        row, column = down[begin + j], across[begin + j]
        scatter(right + 8 * row, to_update, source, 0, min(j, inside))
        if j < inside:
            scatter(left + 8 * column, to_panel, source, j, r)
        else:
            scatter(update + 8 * column * leading, to_update, source, inside, r)


@nested
def _eliminated(left, right, k, tiles):  # type: ignore[no-untyped-def]
    """Eliminate the k pivots of a front; whether all are positive and finite."""
    j = 0
    while j < k:
        wide, c, d, first = _width(k - j), left + 8 * ROWS * j, right + 8 * ROWS * j, j >> 3
        if j > 0:
            subtract(c, ROWS * k, TILE, left, right, j, k, j, first, tiles, wide)
            subtract(d, ROWS * k, TILE, right, left, j, k, j, first, tiles, wide)
        if wide == 6:
            sound = _gauss_6(left, right, j, k, tiles)
        elif wide == 3:
            sound = _gauss_3(left, right, j, k, tiles)
        else:
            sound = _gauss_1(left, right, j, k, tiles)
        if not sound:
            return False
        j += wide
    return True


@compiled
def _substituted(table, boundary, lower, upper, x, local, sums):  # type: ignore[no-untyped-def]
    """x, in order of elimination, becomes the solution."""
    known, total = address(local, 0), address(sums, 0)
    for f in range(len(table) - 1):
        k, r, l0, x0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL], table[f, FIRST]
        first, b0, panel = (k + ROWS - 1) >> 3, table[f, LIST], address(lower, l0)
        tiles = first + (table[f, LEADING] >> 3)
        for i in range(tiles * ROWS):
            local[i] = x[x0 + i] if i < k else 0.0
        for t in range(first):
            row = t * ROWS
            place, last = l0 + t * ROWS * k, min(row + ROWS, k)
            subtract(known, TILE, TILE, panel, total, NONE, k, row, t, t + 1, 1)
            for j in range(row, last):
                y = local[j]
                sums[ROWS * j] = y
                x[x0 + j] = y
                for i in range(j + 1, last):
                    local[i] -= lower[place + ROWS * j + i - row] * y
        subtract(known, TILE, TILE, panel, total, NONE, k, k, first, tiles, 1)
        for i in range(r):
            x[boundary[b0 + i]] += local[first * ROWS + i]
    for f in range(len(table) - 2, -1, -1):
        k, r, l0, x0 = table[f, PIVOTS], table[f, BOUNDARY], table[f, PANEL], table[f, FIRST]
        first, b0, panel = (k + ROWS - 1) >> 3, table[f, LIST], address(upper, l0)
        tiles = first + (table[f, LEADING] >> 3)
        for i in range(ROWS * k):
            sums[i] = 0.0
        for i in range(table[f, LEADING]):
            local[i] = x[boundary[b0 + i]] if i < r else 0.0
        add_dots(total, panel + 8 * first * ROWS * k, k, known, k, tiles - first)
        for t in range(first - 1, -1, -1):
            row = t * ROWS
            place, last = l0 + t * ROWS * k, min(row + ROWS, k)
            for i in range(ROWS):
                local[i] = 0.0
            for j in range(last - 1, row - 1, -1):
                y = x[x0 + j]
                for i in range(ROWS):
                    y -= sums[ROWS * j + i]
                for i in range(j + 1, last):
                    y -= upper[place + ROWS * j + i - row] * local[i - row]
                y *= lower[place + ROWS * j + j - row]
                local[j - row] = y
                x[x0 + j] = y
            add_dots(total, panel + 8 * t * ROWS * k, k, known, row, 1)
