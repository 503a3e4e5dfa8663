"""Real spherical harmonics, the directions in which an initial concentration can vary."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import sph_harm_y

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
    l, m = degree, order  # noqa: E741
    x, y, z = np.moveaxis(np.asarray(directions, dtype=float), -1, 0)
    theta, phi = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
    if m == 0:
        values = sph_harm_y(l, 0, theta, phi).real
    else:
        wave = sph_harm_y(l, abs(m), theta, phi)
        values = np.sqrt(2.0) * (-1.0) ** m * (wave.real if m > 0 else wave.imag)
    somewhere = (x != 0) | (y != 0) | (z != 0)
    return np.asarray(
        np.where(somewhere | (l == 0), np.sqrt(4 * np.pi / (2 * l + 1)) * values, 0.0)
    )
