"""Sparse supernodal Cholesky factorization by CHOLMOD, from the optional package cvxopt.

Y. Chen, T. A. Davis, W. W. Hager, S. Rajamanickam, ACM Trans. Math. Softw. 35, 22 (2008). The
order of elimination is CHOLMOD's own approximate minimum degree. cvxopt is imported where it is
used and nowhere else.
"""

from __future__ import annotations

import weakref
from importlib import import_module
from typing import Any

import numpy as np

from amoeboid.numerics.banded import Array, Index, SingularMatrix

SUPERNODAL = 2  # cvxopt's number for "always"


def installed() -> bool:
    """Whether cvxopt can be imported."""
    try:
        import_module("cvxopt.cholmod")
    except ImportError:
        return False
    return True


class SparseCholesky:
    """Cholesky factorization of symmetric positive definite matrices of one sparsity.

    The analysis of the pattern is kept, and with it the memory of factors no longer in use.
    Raises ImportError without cvxopt.
    """

    def __init__(self, rows: Index, columns: Index, n: int) -> None:
        self._cvxopt = import_module("cvxopt")
        self._cholmod = import_module("cvxopt.cholmod")
        below = np.flatnonzero(rows >= columns)
        # column by column, as cvxopt keeps it
        self._places = below[np.lexsort((rows[below], columns[below]))]
        self._lower = self._cvxopt.spmatrix(
            0.0, rows[self._places].tolist(), columns[self._places].tolist(), (n, n)
        )
        self._values = self._cvxopt.matrix(0.0, (len(self._places), 1))
        self._view = np.asarray(self._values)[:, 0]
        self._unused: list[Any] = []
        self.n = n

    def factor(self, entries: Array) -> CholmodFactor:
        """Factorize; `entries` on the pattern given at construction. Raises SingularMatrix."""
        np.take(entries.ravel(), self._places, out=self._view)
        if not np.all(np.isfinite(self._view)):
            raise SingularMatrix("the matrix must be positive definite; an entry is not finite")
        self._lower.V = self._values
        self._cholmod.options["supernodal"] = SUPERNODAL
        numbers = self._unused.pop() if self._unused else self._cholmod.symbolic(self._lower)
        try:
            self._cholmod.numeric(self._lower, numbers)
        except ArithmeticError:
            raise SingularMatrix("the matrix must be positive definite; it is not") from None
        factor = CholmodFactor(numbers)
        weakref.finalize(factor, self._unused.append, numbers)
        return factor


class CholmodFactor:
    """A matrix factorized by CHOLMOD."""

    def __init__(self, numbers: Any) -> None:
        self._cvxopt = import_module("cvxopt")
        self._cholmod = import_module("cvxopt.cholmod")
        self._numbers = numbers

    def solve(self, b: Array) -> Array:
        """Solution x of A x = b; b (n,) or (n, k)."""
        rhs = self._cvxopt.matrix(np.ascontiguousarray(b, dtype=float))
        if rhs.size[1] == 1:
            self._cholmod.solve(self._numbers, rhs)
            return np.array(rhs).reshape(b.shape)
        # only from a sparse matrix does CHOLMOD take several columns at once
        x = self._cholmod.spsolve(self._numbers, self._cvxopt.sparse(rhs))
        return np.array(self._cvxopt.matrix(x))
