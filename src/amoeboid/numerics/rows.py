"""Vectors as the rows of one array, which grows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array


class Rows:
    """Vectors (n,), one after the other.

    >>> rows = Rows()
    >>> rows.append(np.ones(2))
    >>> rows.array
    array([[1., 1.]])
    """

    def __init__(self) -> None:
        self._all, self._count = np.empty((0, 0)), 0

    def append(self, row: Array) -> None:
        """One more vector (n,)."""
        if self._count == len(self._all):
            longer = np.empty((max(8, 2 * self._count), len(row)))
            if self._count:
                longer[: self._count] = self._all
            self._all = longer
        self._all[self._count] = row
        self._count += 1

    @property
    def array(self) -> Array:
        """All of them (m, n): no copy, valid until the next vector."""
        return self._all[: self._count]


def norms(rows: Array, shares: NDArray[np.complex128]) -> Array:
    """Norms (k,) of sums of `rows` (m, n) with `shares` (m, k)."""
    squares = np.einsum("ik,ik->k", shares.conj(), (rows @ rows.T) @ shares).real
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))
