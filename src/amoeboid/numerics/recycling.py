"""Linear equations with one map and many right-hand sides, which reuse earlier search directions.

Generalized conjugate residuals (S. C. Eisenstat, H. C. Elman, M. H. Schultz, SIAM J. Numer. Anal.
20, 345, 1983). Directions and their images are kept from one right-hand side to the next, so that
later right-hand sides need few new applications of the map.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from amoeboid.arrays import Array

# Maximum number of directions kept, and of new ones for one right-hand side.
MAX_KEPT, MAX_NEW = 240, 80
# A new image is linearly independent if more than this share of it is orthogonal to the kept
# images.
MIN_INDEPENDENT = 1e-12
# Where less than this share of it is left, rounding errors are removed once more.
CANCELLED = 0.1


class NoConvergence(ArithmeticError):
    """The equations could not be solved to the tolerance."""


class Recycling:
    """Solver of `image`(x) = b for a linear map, x and b (n,)."""

    def __init__(self, image: Callable[[Array], Array], n: int) -> None:
        self._image = image
        # memory is taken from the system row by row, as it is written to
        self._directions, self._images = np.empty((MAX_KEPT, n)), np.empty((MAX_KEPT, n))
        self._kept, self._oldest = 0, 0

    def solve(self, b: Array, tolerance: float) -> Array:
        """x with |image(x) - b| <= tolerance |b|. Raises NoConvergence.

        >>> solver = Recycling(lambda x: np.array([2.0, 4.0]) * x, 2)
        >>> solver.solve(np.ones(2), 1e-12)
        array([0.5 , 0.25])
        """
        allowed = tolerance * np.linalg.norm(b)
        shares = self._images[: self._kept] @ b
        x = shares @ self._directions[: self._kept]
        residual = b - shares @ self._images[: self._kept]
        for _ in range(MAX_NEW):
            if not np.linalg.norm(residual) > allowed:
                break
            direction, image = self._new(residual)
            share = image @ residual
            x += share * direction
            residual -= share * image
        if not np.linalg.norm(residual) <= allowed:
            raise NoConvergence("the linear solver did not reach its tolerance")
        return x

    def _new(self, residual: Array) -> tuple[Array, Array]:
        """One more direction, towards `residual`, and its image of length 1; both are kept."""
        direction, image = np.array(residual), np.array(self._image(residual))
        size = length = np.linalg.norm(image)
        shares = np.zeros(self._kept)
        before = np.inf
        while length < CANCELLED * before:
            more = self._images[: self._kept] @ image
            image -= more @ self._images[: self._kept]
            shares += more
            before, length = length, np.linalg.norm(image)
        direction -= shares @ self._directions[: self._kept]
        if not length > MIN_INDEPENDENT * size:
            raise NoConvergence("the linear equations have no solution in the range of the map")
        direction, image = direction / length, image / length
        place = self._place()
        self._directions[place], self._images[place] = direction, image
        return direction, image

    def _place(self) -> int:
        """A free index, or that of the oldest direction."""
        if self._kept == MAX_KEPT:
            place = self._oldest
            self._oldest = (self._oldest + 1) % MAX_KEPT
            return place
        self._kept += 1
        return self._kept - 1
