"""The vector of unknowns of the steady problem and the fields it stands for.

In this order: the sine coefficients of psi - x (n - 1) and u (n), the cosine coefficients of c (n),
the length scale ds/dx, the tension zeta_0 and the two slack unknowns of `steady`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.spectral import grid, resized
from amoeboid.numerics.derivatives import Dual


@dataclass(frozen=True)
class Fields:
    """The unknowns at the points of the grid: arrays or Duals."""

    psi: Any
    psi_slope: Any
    u: Any
    c: Any
    scale: Any
    zeta0: Any
    axial: Any
    source: Any


@dataclass(frozen=True, eq=False)
class Layout:
    """Constant matrices from the vector of unknowns to fields at the points."""

    n: int
    psi: Array
    psi_slope: Array
    u: Array
    c: Array
    scalars: Array

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return unknown_count(self.n)


def unknown_count(n: int) -> int:
    """Length of the vector of unknowns for n modes."""
    return 3 * n + 3


def mode_count(x: Array) -> int:
    """Number of modes n of a vector of unknowns.

    >>> mode_count(np.zeros(unknown_count(32)))
    32
    """
    return (x.size - 3) // 3


@lru_cache(maxsize=32)
def layout(n: int) -> Layout:
    """The layout for n points; the same object each time."""
    g, size = grid(n), unknown_count(n)
    psi, psi_slope, u, c = (np.zeros((n, size)) for _ in range(4))
    psi[:, : n - 1] = g.odd_values[:, : n - 1]
    psi_slope[:, : n - 1] = g.odd_slopes[:, : n - 1]
    u[:, n - 1 : 2 * n - 1] = g.odd_values
    c[:, 2 * n - 1 : 3 * n - 1] = g.even_values
    return Layout(n, psi, psi_slope, u, c, np.eye(size)[-4:])


def fields_of(x: Array, n: int) -> Fields:
    """The unknowns at the points, as arrays."""
    a = layout(n)
    scalars = [x[k : k + 1] for k in range(3 * n - 1, 3 * n + 3)]
    return Fields(grid(n).x + a.psi @ x, 1.0 + a.psi_slope @ x, a.u @ x, a.c @ x, *scalars)


def differentiable_fields_of(x: Array, n: int) -> Fields:
    """The unknowns at the points, as Duals with derivatives to the vector of unknowns."""
    a, f = layout(n), fields_of(x, n)
    scalars = [
        Dual(value, a.scalars[k : k + 1])
        for k, value in enumerate((f.scale, f.zeta0, f.axial, f.source))
    ]
    return Fields(
        Dual(f.psi, a.psi),
        Dual(f.psi_slope, a.psi_slope),
        Dual(f.u, a.u),
        Dual(f.c, a.c),
        *scalars,
    )


def split(x: Array, n: int) -> tuple[Array, Array, Array, Array]:
    """Coefficients of psi - x, u and c, and the four scalars."""
    return x[: n - 1], x[n - 1 : 2 * n - 1], x[2 * n - 1 : 3 * n - 1], x[3 * n - 1 :]


def resampled(x: Array, n: int, to: int) -> Array:
    """The vector of unknowns with `to` instead of n modes."""
    psi, u, c, scalars = split(x, n)
    return np.concatenate([resized(psi, to - 1), resized(u, to), resized(c, to), scalars])
