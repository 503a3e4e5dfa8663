"""Anderson acceleration of a fixed-point iteration z = G(z), of any depth.

The next z is the combination of the latest values of G whose changes G(z) - z combine to the least
(D. G. Anderson, J. ACM 12, 547, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 1715, 2011).
For a linear map it is GMRES on (1 - G) z = 0, so that G need not contract: a few directions in
which it expands do no harm.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array

# Combinations that change less than this share of the largest tell nothing beside rounding.
MIN_SHARE = 1e-7


class Acceleration:
    """Chooses the next z (n,) from the latest `depth` + 1 pairs of z and G(z).

    Of a vector only the first `measured` numbers, scaled to about 1, count for the changes; the
    others are combined as these are.

    >>> next_of, z = Acceleration(depth=2, measured=2), np.zeros(2)
    >>> for _ in range(4):
    ...     z = next_of(z, np.array([2.0, 0.5]) * z + 1.0)
    >>> z.round(9)
    array([-1.,  2.])
    """

    def __init__(self, depth: int, measured: int) -> None:
        self._depth, self._measured = depth, measured
        self._values: list[Array] = []
        self._changes: list[Array] = []

    def __call__(self, z: Array, g: Array) -> Array:
        """The next z, from z and g = G(z)."""
        change = (g - z)[: self._measured]
        self._values = [*self._values[-self._depth :], g]
        self._changes = [*self._changes[-self._depth :], change]
        if len(self._values) == 1:
            return g
        bends = np.stack([change - other for other in self._changes[:-1]])
        sizes = np.linalg.norm(bends, axis=1)
        known = sizes > 0.0
        bends = bends[known] / sizes[known, None]
        shares, *_ = np.linalg.lstsq(bends @ bends.T, bends @ change, rcond=MIN_SHARE**2)
        found = np.array(g)
        others = [value for value, use in zip(self._values[:-1], known, strict=True) if use]
        for share, size, value in zip(shares, sizes[known], others, strict=True):
            found -= share / size * (g - value)
        return found
