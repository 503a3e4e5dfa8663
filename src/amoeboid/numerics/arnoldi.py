"""The outlying eigenvalues of a linear map given by its action: Arnoldi's iteration on residuals.

The space is extended by the residual of an approximate eigenvector. If the images are exact, all
residuals are parallel, and it is Arnoldi's iteration. Images that are known roughly disturb that,
but residuals still lead to the eigenvectors (C.-R. Lee, G. W. Stewart, *Analysis of the residual
Arnoldi method*, University of Maryland TR-4890, 2007). Only the images that an eigenvalue depends
on then need to be improved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.numerics.rows import Rows, norms

Complex = NDArray[np.complex128]

# What is left of a residual beside rounding errors, as a share of the images, ends the iteration.
EXHAUSTED = 1e-14
# Maximum number of improvements of images between two applications of the map.
MAX_IMPROVED = 80


class Images(Protocol):
    """Images of vectors under a linear map, known up to an error that can be made smaller."""

    @property
    def array(self) -> Array:
        """The images (m, n) of the m vectors that were added."""

    def add(self, y: Array) -> None:
        """One more vector y (n,)."""

    def errors(self, shares: Complex) -> Array:
        """Norms (k,) of the errors of the images of k sums with `shares` (m, k) of the vectors."""

    def improve(self, shares: Complex) -> bool:
        """Make the error of the image of a sum (m,) smaller; False if it is as small as wanted."""


@dataclass(frozen=True, eq=False)
class Ritz:
    """Approximate eigenvalues after k applications, the norms of their residuals, their condition
    numbers, and the errors of the images of their eigenvectors, each (k,).

    A residual, or an error of the map, changes an eigenvalue by up to its norm times the condition
    number, which is 1 for a normal map. The condition numbers are those of the map projected onto
    the space spanned so far, estimates for the map itself.
    """

    values: Complex
    residuals: Array
    conditions: Array
    errors: Array
    shares: Complex
    _basis: Array
    _outside: Array

    def vector(self, k: int) -> Complex:
        """The approximate eigenvector (n,), of length 1, of eigenvalue k."""
        return np.asarray(self.shares[:, k] @ self._basis)

    def residual(self, k: int) -> Complex:
        """The residual (n,) of eigenvalue k and that vector, orthogonal to the space."""
        return np.asarray(self.shares[:, k] @ self._outside)


def largest_residual(found: Ritz) -> tuple[int, bool]:
    """The eigenvalue with the largest residual, as an argument of `ritz_values`."""
    return int(np.argmax(found.residuals)), False


def ritz_values(
    images: Images,
    start: Array,
    choose: Callable[[Ritz], tuple[int, bool]] = largest_residual,
) -> Iterator[Ritz]:
    """Yield approximate eigenvalues of a linear map after every application.

    `images`: none yet. `start` (n,) must have a component in every mode that is to be found.
    `choose`: the eigenvalue whose residual extends the space, and whether its image must be
    improved before. The iteration ends when the space spanned by `start` is exhausted.
    """
    basis = Rows()
    y = start / np.linalg.norm(start)
    while True:
        basis.append(y)
        images.add(y)
        found = _found(basis.array, images)
        for _ in range(MAX_IMPROVED):
            k, improve = choose(found)
            if not (improve and images.improve(found.shares[:, k])):
                break
            found = _found(basis.array, images)
        yield found
        residual = found.residual(choose(found)[0])
        # of the two parts of a complex one, the larger
        y = max(residual.real, residual.imag, key=np.linalg.norm)
        if not np.linalg.norm(y) > EXHAUSTED * np.linalg.norm(images.array[-1]):
            return
        for _ in range(2):  # against cancellation
            y = y / np.linalg.norm(y)
            y = y - (basis.array @ y) @ basis.array
        y /= np.linalg.norm(y)


def _found(basis: Array, images: Images) -> Ritz:
    projected = images.array @ basis.T
    outside = images.array - projected @ basis
    values, shares = np.linalg.eig(projected.T.astype(np.complex128))
    residuals = norms(outside, shares)
    return Ritz(
        values, residuals, _conditions(shares), images.errors(shares), shares, basis, outside
    )


def _conditions(vectors: Complex) -> Array:
    """Condition numbers of eigenvalues from unit eigenvectors, infinite if two of them agree."""
    try:
        with np.errstate(over="ignore"):
            return np.asarray(np.linalg.norm(np.linalg.inv(vectors), axis=1))
    except np.linalg.LinAlgError:
        return np.full(len(vectors), np.inf)
