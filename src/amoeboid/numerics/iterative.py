"""Iterative solution of sparse systems with a strong diagonal, from a good guess.

BiCGStab (H. A. van der Vorst, SIAM J. Sci. Stat. Comput. 13, 631, 1992) with an incomplete LU
factorization as preconditioner. Most of the fill that it leaves out goes to the diagonal of the
same column (modified incomplete factorization, I. Gustafsson, BIT 18, 142, 1978): what is smooth
converges faster, and pivots stay positive where the columns of the matrix have positive sums.
Where the iteration does not reach rounding, banded LU takes over.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from amoeboid.numerics.banded import Array, GeneralBand, Index
from amoeboid.numerics.compiled import compiled

# Unknowns below which banded LU is faster.
FASTER_FROM = 1000
# Residual, as a share of |A| |x| + |b| (sums of magnitudes), that counts as rounding.
ROUNDING = 1e-15
MOST_ITERATIONS = 100
MOST_RESTARTS = 4
# Share of the left-out fill that goes to the diagonal: all of it suits diffusion, but not flow.
COMPENSATION = 0.95


class DominatedByDiagonal:
    """Solver for (n, n) matrices of one sparsity, in compressed rows.

    The pattern must be symmetric, contain the diagonal, and list the columns of a row ascending.
    """

    def __init__(self, row_start: Index, columns: Index) -> None:
        self.n = len(row_start) - 1
        self._row_start, self._columns = row_start, columns
        self._rows = np.repeat(np.arange(self.n), np.diff(row_start))
        self._diagonal = np.flatnonzero(self._rows == columns)
        self._transposed = np.searchsorted(
            self._rows * self.n + columns, columns * self.n + self._rows
        )

    @cached_property
    def _direct(self) -> GeneralBand:
        return GeneralBand(self._rows, self._columns, self.n)

    def solve(self, entries: Array, b: Array, guess: Array) -> Array:
        """Solution x (n,) of A x = b; `entries` on the pattern. Raises SingularMatrix."""
        x = self.iterated(entries, b, guess) if self.n >= FASTER_FROM else None
        return self._direct.factor(entries).solve(b) if x is None else x

    def iterated(self, entries: Array, b: Array, guess: Array) -> Array | None:
        """Solution by iteration alone; None where it does not settle."""
        x = np.array(guess, dtype=float)
        pattern = self._row_start, self._columns, self._diagonal
        factors, regular = _incomplete_factors(entries[self._transposed], *pattern)
        return x if regular and _bicgstab(entries, factors, *pattern, b, x) else None


# The transposed matrix is factorized, row by row: its rows are the columns that keep their sums.
@compiled
def _incomplete_factors(entries, row_start, columns, diagonal):  # type: ignore[no-untyped-def]
    n = len(diagonal)
    lu = entries.copy()
    place = np.full(n, -1)
    for i in range(n):
        for k in range(row_start[i], row_start[i + 1]):
            place[columns[k]] = k
        dropped = 0.0
        for k in range(row_start[i], diagonal[i]):
            j = columns[k]
            lu[k] /= lu[diagonal[j]]
            for m in range(diagonal[j] + 1, row_start[j + 1]):
                fill = lu[k] * lu[m]
                if place[columns[m]] >= 0:
                    lu[place[columns[m]]] -= fill
                else:
                    dropped += fill
        lu[diagonal[i]] -= COMPENSATION * dropped
        if not lu[diagonal[i]] > 0.0:
            return lu, False
        for k in range(row_start[i], row_start[i + 1]):
            place[columns[k]] = -1
    return lu, True


@compiled
def _precondition(lu, row_start, columns, diagonal, r, y):  # type: ignore[no-untyped-def]
    n = len(r)
    y[:] = r
    for i in range(n):
        y[i] /= lu[diagonal[i]]
        for k in range(diagonal[i] + 1, row_start[i + 1]):
            y[columns[k]] -= lu[k] * y[i]
    for i in range(n - 1, -1, -1):
        for k in range(row_start[i], diagonal[i]):
            y[columns[k]] -= lu[k] * y[i]


@compiled
def _product(entries, row_start, columns, x, out):  # type: ignore[no-untyped-def]
    for i in range(len(x)):
        total = 0.0
        for k in range(row_start[i], row_start[i + 1]):
            total += entries[k] * x[columns[k]]
        out[i] = total


@compiled
def _bicgstab(entries, lu, row_start, columns, diagonal, b, x):  # type: ignore[no-untyped-def]
    n = len(b)
    v, t, y = np.empty(n), np.empty(n), np.empty(n)
    magnitudes = np.abs(entries)
    for _ in range(MOST_RESTARTS):
        _product(entries, row_start, columns, x, t)
        _product(magnitudes, row_start, columns, np.abs(x), v)
        r = b - t
        goal = ROUNDING * (np.sum(v) + np.sum(np.abs(b)))
        if not goal < np.inf:
            return False
        if np.sum(np.abs(r)) <= goal:
            return True
        shadow, p = r.copy(), r.copy()
        rho = np.dot(shadow, r)
        for _ in range(MOST_ITERATIONS):
            _precondition(lu, row_start, columns, diagonal, p, y)
            _product(entries, row_start, columns, y, v)
            sigma = np.dot(shadow, v)
            if sigma == 0.0:
                break
            alpha = rho / sigma
            for i in range(n):
                x[i] += alpha * y[i]
                r[i] -= alpha * v[i]
            _precondition(lu, row_start, columns, diagonal, r, y)
            _product(entries, row_start, columns, y, t)
            square = np.dot(t, t)
            omega = np.dot(t, r) / square if square > 0.0 else 0.0
            for i in range(n):
                x[i] += omega * y[i]
                r[i] -= omega * t[i]
            new = np.dot(shadow, r)
            if np.sum(np.abs(r)) <= 0.1 * goal or rho == 0.0 or omega == 0.0:
                break
            beta = (new / rho) * (alpha / omega)
            rho = new
            for i in range(n):
                p[i] = r[i] + beta * (p[i] - omega * v[i])
    return False
