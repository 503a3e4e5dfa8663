"""The vector of unknowns of the steady problem and the fields it stands for.

In this order: the sine coefficients of psi - x (n - 1) and u (n), the cosine coefficients of c (n),
the length scale ds/dx, the tension zeta_0 and the two slack unknowns of `steady`.
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
    to, without = _evaluation(n, points or n)
    if x.dtype.kind == "c":  # two columns cost less than a complex matrix
        pairs = to @ np.ascontiguousarray(x).view(float).reshape(-1, 2)
        values = pairs.view(complex)[:, 0] + without
    else:
        values = to @ x + without
    return dict(zip(FIELDS, (*values.reshape(4, -1), *x[3 * n - 1 :, None]), strict=True))


@lru_cache(maxsize=32)
def _evaluation(n: int, points: int) -> tuple[Array, Array]:
    """The matrix from the unknowns to psi, psi_slope, u, c at the points, and what it adds to."""
    maps = maps_of(n, points)
    to, without = np.zeros((4 * points, unknown_count(n))), np.zeros((4, points))
    for k, name in enumerate(FIELDS[:4]):
        first, matrix = maps[name]
        to[k * points : (k + 1) * points, first : first + matrix.shape[1]] = matrix
    without[0], without[1] = grid(points).x, 1.0
    return to, without.ravel()


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
