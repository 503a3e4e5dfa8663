"""A direct solver for sparse matrices whose numbering already gives a narrow band.

`GeneralBand` holds the structure, made once; `factor` takes the entries and returns an object with
`solve`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from amoeboid.arrays import Array, Index


class SingularMatrix(ArithmeticError):
    """The matrix could not be factorized; the message says what was required of it."""


class Factor(Protocol):
    """A factorized matrix."""

    def solve(self, b: Array) -> Array:
        """Solution x of A x = b; b (n,) or (n, k)."""


class _LapackFactor:
    def __init__(self, solve: Callable[[Array], tuple[Array, int]]) -> None:
        self._solve = solve

    def solve(self, b: Array) -> Array:
        """Solution x of A x = b; b (n,) or (n, k)."""
        x, info = self._solve(b)
        if info != 0:
            raise SingularMatrix(f"LAPACK rejected the right-hand side (info = {info})")
        return x


class GeneralBand:
    """LU factorization with partial pivoting of matrices of one sparsity."""

    def __init__(self, rows: Index, columns: Index, n: int) -> None:
        self.below = int(np.max(rows - columns))
        self.above = int(np.max(columns - rows))
        self._height = 2 * self.below + self.above + 1
        self._places = (self.below + self.above + rows - columns) + columns * self._height
        self.n = n

    def factor(self, entries: Array) -> Factor:
        """Factorize; `entries` on the pattern given at construction. Raises SingularMatrix."""
        from scipy.linalg.lapack import dgbtrf, dgbtrs  # a fallback, which few runs need

        band = np.zeros((self.n, self._height))
        band.ravel()[self._places] = entries.ravel()
        lu, pivots, info = dgbtrf(band.T, self.below, self.above, overwrite_ab=1)
        if info != 0:
            raise SingularMatrix(f"the matrix must be regular; pivot {info} vanishes")
        return _LapackFactor(lambda b: dgbtrs(lu, self.below, self.above, b, pivots))
