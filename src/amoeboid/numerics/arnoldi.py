"""Arnoldi's iteration: the outlying eigenvalues of a linear map given by its action."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array


@dataclass(frozen=True, eq=False)
class Ritz:
    """Approximate eigenvalues after k applications, the norms of their residuals, and their
    condition numbers, each (k,).

    A residual, or an error of the map, changes an eigenvalue by up to its norm times the condition
    number, which is 1 for a normal map. The condition numbers are those of the map projected onto
    the space spanned so far, estimates for the map itself.
    """

    values: NDArray[np.complex128]
    residuals: Array
    conditions: Array
    _vectors: NDArray[np.complex128]
    _basis: list[Array]

    def vector(self, k: int) -> NDArray[np.complex128]:
        """The approximate eigenvector (n,), of length 1, of eigenvalue k."""
        parts = self._vectors[:, k]
        return np.asarray(sum(part * x for part, x in zip(parts, self._basis, strict=False)))


def ritz_values(image: Callable[[Array], Array], start: Array) -> Iterator[Ritz]:
    """Yield approximate eigenvalues of the linear map `image`(x) after every application.

    `start` (n,) must have a component in every mode that is to be found. The iteration ends when
    the space spanned by `start` is exhausted.

    >>> for found in ritz_values(lambda x: np.array([2.0, 1.0]) * x, np.ones(2)):
    ...     pass
    >>> np.sort(found.values.real).round(12)
    array([1., 2.])
    """
    basis = [start / np.linalg.norm(start)]
    H = np.zeros((1, 0))
    while True:
        x = image(basis[-1])
        size = np.linalg.norm(x)
        column = np.zeros(len(basis) + 1)
        # twice, against cancellation
        for _ in range(2):
            for k, vector in enumerate(basis):
                part = vector @ x
                column[k] += part
                x = x - part * vector
        column[-1] = np.linalg.norm(x)
        H = np.column_stack([np.vstack([H, np.zeros(H.shape[1])]), column])
        values, vectors = np.linalg.eig(H[:-1].astype(np.complex128))
        residuals = np.abs(column[-1] * vectors[-1])
        yield Ritz(values, residuals, _conditions(vectors), vectors, basis)
        if column[-1] <= 1e-14 * size:
            return
        basis.append(x / column[-1])


def _conditions(vectors: NDArray[np.complex128]) -> Array:
    """Condition numbers of eigenvalues from unit eigenvectors, infinite if two of them agree."""
    try:
        with np.errstate(over="ignore"):
            return np.asarray(np.linalg.norm(np.linalg.inv(vectors), axis=1))
    except np.linalg.LinAlgError:
        return np.full(len(vectors), np.inf)
