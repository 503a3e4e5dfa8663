"""Linear equations with one map and many right-hand sides, which reuse earlier search directions.

Generalized conjugate residuals (S. C. Eisenstat, H. C. Elman, M. H. Schultz, SIAM J. Numer. Anal.
20, 345, 1983). Directions and their images are kept from one right-hand side to the next, so that
later right-hand sides need few new applications of the map.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.numerics.rows import Rows, norms

# Maximum number of directions kept, and of new ones for one right-hand side.
MAX_KEPT, MAX_NEW = 240, 80
# A new image is linearly independent if more than this share of it is orthogonal to the kept
# images. Where less than the second share is, rounding errors are removed once more.
MIN_INDEPENDENT, CANCELLED = 1e-12, 0.1


class NoConvergence(ArithmeticError):
    """The equations could not be solved to the tolerance."""


class Recycling:
    """Solver of `image`(x) = b for a linear map, x and b (n,)."""

    def __init__(self, image: Callable[[Array], Array], n: int) -> None:
        self._image = image
        # the system gives memory row by row, when it is written to
        self._directions, self._images = np.empty((MAX_KEPT, n)), np.empty((MAX_KEPT, n))
        self._kept, self._oldest = 0, 0
        # the length of the longest direction, of those with an image of length 1
        self.longest = 0.0

    def solve(self, b: Array, tolerance: float) -> Array:
        """x with |image(x) - b| <= tolerance |b|. Raises NoConvergence.

        >>> solver = Recycling(lambda x: np.array([2.0, 4.0]) * x, 2)
        >>> solver.solve(np.ones(2), 1e-12)
        array([0.5 , 0.25])
        """
        allowed = tolerance * np.linalg.norm(b)
        x, residual = self.known(b)
        for _ in range(MAX_NEW):
            if not np.linalg.norm(residual) > allowed:
                break
            direction, image = self.new(residual)
            share = image @ residual
            x += share * direction
            residual -= share * image
        if not np.linalg.norm(residual) <= allowed:
            raise NoConvergence("the linear solver did not reach its tolerance")
        return x

    def known(self, b: Array) -> tuple[Array, Array]:
        """The best sum x of the kept directions, and its residual b - image(x)."""
        shares = self._images[: self._kept] @ b
        return shares @ self._directions[: self._kept], b - shares @ self._images[: self._kept]

    def new(self, residual: Array) -> tuple[Array, Array]:
        """One more direction, towards `residual`, and its image of length 1; both are kept."""
        direction, image = np.array(residual), np.array(self._image(residual))
        size = length = float(np.linalg.norm(image))
        shares, before = np.zeros(self._kept), np.inf
        while length < CANCELLED * before:
            more = self._images[: self._kept] @ image
            image -= more @ self._images[: self._kept]
            shares += more
            before, length = length, float(np.linalg.norm(image))
        direction -= shares @ self._directions[: self._kept]
        if not length > MIN_INDEPENDENT * size:
            raise NoConvergence("the linear equations have no solution in the range of the map")
        direction, image = direction / length, image / length
        place = self._place()
        self._directions[place], self._images[place] = direction, image
        self.longest = max(self.longest, float(np.linalg.norm(direction)))
        return direction, image

    def _place(self) -> int:
        """A free index, or that of the oldest direction."""
        if self._kept == MAX_KEPT:
            place = self._oldest
            self._oldest = (self._oldest + 1) % MAX_KEPT
            return place
        self._kept += 1
        return self._kept - 1


class SolvedImages:
    """Images x of vectors y, the solutions of `equations` for right-hand sides `right`(y).

    First to the tolerance `rough`; an improved one to `tolerance`, as a share of its right-hand
    side. Every new direction improves all of them. `shown`: linear, what of a solution is the
    image. See `arnoldi.Images`.
    """

    def __init__(
        self,
        equations: Recycling,
        right: Callable[[Array], Array],
        shown: Callable[[Array], Array],
        rough: float,
        tolerance: float,
    ) -> None:
        self._equations, self._right, self._shown = equations, right, shown
        self._rough, self._tolerance = rough, tolerance
        self._images, self._residuals = Rows(), Rows()
        self._sizes: list[float] = []

    @property
    def array(self) -> Array:
        """The images (m, n)."""
        return self._images.array

    def add(self, y: Array) -> None:
        """One more vector y (n,), solved for. Raises NoConvergence."""
        b = self._right(y)
        x, residual = self._equations.known(b)
        self._images.append(self._shown(x))
        self._residuals.append(residual)
        self._sizes.append(float(np.linalg.norm(b)))
        allowed = self._rough * self._sizes[-1]
        for _ in range(MAX_NEW):
            if not np.linalg.norm(self._residuals.array[-1]) > allowed:
                break
            self._towards(self._residuals.array[-1])
        if not np.linalg.norm(self._residuals.array[-1]) <= allowed:
            raise NoConvergence("the linear solver did not reach its tolerance")

    def errors(self, shares: NDArray[np.complex128]) -> Array:
        """Norms (k,) of the errors of sums with `shares` (m, k), from those of their equations.

        These are enlarged as the longest direction is.
        """
        return self._equations.longest * norms(self._residuals.array, shares)

    def improve(self, shares: NDArray[np.complex128]) -> bool:
        """One more direction for a sum with `shares` (m,); False if that is solved for."""
        residual = shares @ self._residuals.array
        size = np.linalg.norm(shares * self._sizes)
        if not np.linalg.norm(residual) > self._tolerance * size:
            return False
        self._towards(max(residual.real, residual.imag, key=np.linalg.norm))
        return True

    def _towards(self, residual: Array) -> None:
        direction, image = self._equations.new(residual)
        amounts = self._residuals.array @ image
        self._residuals.array[:] -= amounts[:, None] * image
        self._images.array[:] += amounts[:, None] * self._shown(direction)
