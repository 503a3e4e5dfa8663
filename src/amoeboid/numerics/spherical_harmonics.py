"""Real spherical harmonics, the directions in which an initial concentration can vary."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from amoeboid.arrays import Array


def real_harmonic(degree: int, order: int, directions: ArrayLike) -> Array:
    """C_lm [1] of degree l and order m, |m| <= l, at `directions` (V, 3); polar axis z.

    m = 0: P_l(cos theta); m > 0 goes like cos(m phi), m < 0 like sin(|m| phi), without
    Condon-Shortley phase. Schmidt's seminormalization: the squares of one degree sum to 1, the
    mean square of each over the sphere is 1/(2l + 1), and (C_1,1, C_1,-1, C_1,0) = (x, y, z).
    The zero vector has no direction; the value there is that of l = 0, else 0.

    >>> real_harmonic(2, 0, [[0.0, 0.0, 3.0], [1.0, 0.0, 0.0]])
    array([ 1. , -0.5])
    """
    distance, z, wave = _angles(directions)
    return _harmonic(degree, order, distance, z, wave)


def real_harmonics(degree: int, directions: ArrayLike) -> Array:
    """All `real_harmonic` of degrees 0 to `degree`, (degree + 1)^2 rows: l = 0; 1, m = -1; ..."""
    angles = _angles(directions)
    return np.stack(
        [_harmonic(l, m, *angles) for l in range(degree + 1) for m in range(-l, l + 1)]  # noqa: E741
    )


def _angles(directions: ArrayLike) -> tuple[Array, Array, NDArray[np.complex128]]:
    """Whether `directions` have a length (0 if not), cos(theta), and sin(theta) exp(i phi)."""
    vectors = np.asarray(directions, dtype=float)
    largest = np.abs(vectors).max(axis=-1, keepdims=True)  # its square may be too small a number
    vectors = vectors / np.where(largest > 0, largest, 1.0)
    distance = np.linalg.norm(vectors, axis=-1)
    x, y, z = np.moveaxis(vectors, -1, 0) / np.where(distance > 0, distance, 1.0)
    return distance, z, x + 1j * y


def _harmonic(l: int, m: int, distance: Array, z: Array, wave: NDArray[np.complex128]) -> Array:  # noqa: E741
    turned = wave ** abs(m)  # sin(theta)^|m| exp(i |m| phi)
    values = _polynomial(l, abs(m), z) * (turned.imag if m < 0 else turned.real)
    return np.asarray(np.where((distance > 0) | (l == 0), values, 0.0))


def _polynomial(l: int, m: int, z: Array) -> Array:  # noqa: E741
    """C_lm over sin(theta)^m cos(m phi) at z = cos(theta): three terms upwards from l = m."""
    k = np.arange(1, m + 1)
    before, values = np.zeros_like(z), np.full_like(z, np.sqrt(np.prod((2 * k - 1) / (2 * k))))
    if m > 0:
        values *= np.sqrt(2.0)
    for n in range(m + 1, l + 1):
        below = np.sqrt((n - 1) ** 2 - m**2) * before
        before, values = values, ((2 * n - 1) * z * values - below) / np.sqrt(n**2 - m**2)
    return values
