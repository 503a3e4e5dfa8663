"""The vector of unknowns of the steady problem and the fields it stands for.

In this order: the sine coefficients of psi - x (n - 1) and u (n), the cosine coefficients of c (n),
the length scale ds/dx, the tension zeta_0 and the two slack unknowns of `system`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.spectral import grid, resized


@dataclass(frozen=True)
class Fields:
    """The unknowns at the points of the grid: arrays, Duals or Symbols."""

    psi: Any
    psi_slope: Any
    u: Any
    c: Any
    scale: Any
    zeta0: Any
    axial: Any
    source: Any


FIELDS = tuple(field.name for field in fields(Fields))


def unknown_count(n: int) -> int:
    """Length of the vector of unknowns for n modes."""
    return 3 * n + 3


def mode_count(x: Array) -> int:
    """Number of modes n of a vector of unknowns.

    >>> mode_count(np.zeros(unknown_count(32)))
    32
    """
    return (x.size - 3) // 3


def fields_of(x: Array, n: int) -> Fields:
    """The unknowns at the points, as arrays."""
    return Fields(**fields_by_name(x, n))


def fields_by_name(x: Array, n: int, points: int | None = None) -> dict[str, Array]:
    """The same by their names, at the points of the grid of n modes or of another one."""
    angles, odd, even, without = _evaluation(n, points or n)
    psi, u, c, scalars = split(x, n)
    values = np.empty((4, without.shape[1]), x.dtype)
    for found, matrix, series in (
        (values[:2], angles, psi),
        (values[2], odd, u),
        (values[3], even, c),
    ):
        np.matmul(matrix, series, found.reshape(-1))
    values[:2] += without
    return dict(zip(FIELDS, (*values, *scalars[:, None]), strict=True))


@lru_cache(maxsize=32)
def _evaluation(n: int, points: int) -> tuple[Array, Array, Array, Array]:
    """The matrices from the unknowns to psi and its slope, u, c; what the first two add to."""
    maps = maps_of(n, points)
    matrices = [np.ascontiguousarray(maps[name][1]) for name in FIELDS[:4]]
    without = np.array([grid(points).x, np.ones(points)])
    return np.concatenate(matrices[:2]), matrices[2], matrices[3], without


def maps_of(n: int, points: int | None = None) -> dict[str, tuple[int, Array]]:
    """Derivatives of the fields, which are linear in the unknowns, to those from a first one on.

    At the points of the grid of n, or of a finer one.
    """
    g, scalars = grid(points or n), np.eye(4)
    maps = {
        "psi": (0, g.odd_values[:, : n - 1]),
        "psi_slope": (0, g.odd_slopes[:, : n - 1]),
        "u": (n - 1, g.odd_values[:, :n]),
        "c": (2 * n - 1, g.even_values[:, :n]),
    }
    return maps | {name: (3 * n - 1, scalars[k : k + 1]) for k, name in enumerate(FIELDS[4:])}


def split(x: Array, n: int) -> tuple[Array, Array, Array, Array]:
    """Coefficients of psi - x, u and c, and the four scalars, of vectors (..., 3 n + 3)."""
    return (
        x[..., : n - 1],
        x[..., n - 1 : 2 * n - 1],
        x[..., 2 * n - 1 : 3 * n - 1],
        x[..., 3 * n - 1 :],
    )


def resampled(x: Array, n: int, to: int) -> Array:
    """The vectors of unknowns (..., 3 n + 3) with `to` instead of n modes."""
    psi, u, c, scalars = split(x, n)
    parts = [resized(psi, to - 1), resized(u, to), resized(c, to), scalars]
    return np.concatenate(parts, axis=-1)
