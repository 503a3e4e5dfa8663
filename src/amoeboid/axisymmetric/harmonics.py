"""Associated Legendre functions on Gauss nodes: regular bases for perturbations exp(i m phi).

P_l^m(cos x) for scalars; its gradient (P', i m P/sin x) and its rotation (i m P/sin x, -P') for
tangent vectors. With the scaled arclength x in place of the polar angle they are complete and
regular at the poles on any smooth axisymmetric surface, and exact eigenfunctions on the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from amoeboid.arrays import Array


@dataclass(frozen=True, eq=False)
class HarmonicBasis:
    """Orthonormal P_l^m for l = max(m, first)..degree at the nodes, one column each.

    `over_sine` is m P/sin x, `slopes` dP/dx; `*_slopes` of the vector components as well.
    """

    x: Array
    weights: Array
    degrees: Array
    values: Array
    slopes: Array
    over_sine: Array
    over_sine_slopes: Array
    curvatures: Array

    @cached_property
    def tangents(self) -> tuple[Array, Array]:
        """(a, b) of the trial velocities (a, i b) along (t, e_phi), (nodes, count) each.

        Gradients of the harmonics, and for m > 0 rotations.
        """
        return self._tangents(self.slopes, self.over_sine)

    @cached_property
    def tangent_slopes(self) -> tuple[Array, Array]:
        """Their derivatives to x."""
        return self._tangents(self.curvatures, self.over_sine_slopes)

    def _tangents(self, gradient: Array, around: Array) -> tuple[Array, Array]:
        if self.degrees[0] == 0:  # the gradient of a constant is no velocity
            return gradient[:, 1:], around[:, 1:]
        return np.hstack([gradient, around]), np.hstack([around, gradient])


@lru_cache(maxsize=160)
def harmonics(m: int, degree: int, nodes: int) -> HarmonicBasis:
    """The basis of azimuthal number m up to `degree` on Gauss nodes in cos x."""
    mu, weights = np.polynomial.legendre.leggauss(nodes)
    x = np.arccos(mu)
    sine = np.sqrt((1 - mu) * (1 + mu))
    degrees = np.arange(m, degree + 1)
    table = {k: _legendre(k, degree, mu, sine) for k in range(max(m - 1, 0), m + 2)}
    values = table[m][:, m:]
    above = table[m + 1][:, m:]
    slopes = -0.5 * np.sqrt((degrees - m) * (degrees + m + 1.0)) * above
    if m == 0:
        slopes *= 2
    else:
        below = table[m - 1][:, m:]
        slopes = slopes + 0.5 * np.sqrt((degrees + m) * (degrees - m + 1.0)) * below
    over_sine = m * values / sine[:, None]
    cot = (mu / sine)[:, None]
    over_sine_slopes = m * slopes / sine[:, None] - cot * over_sine
    # Legendre's equation: P'' = -cot P' + (m^2/sin^2 - l (l + 1)) P
    curvatures = (
        -cot * slopes + (m / sine)[:, None] * over_sine - degrees * (degrees + 1.0) * values
    )
    return HarmonicBasis(
        x, weights, degrees, values, slopes, over_sine, over_sine_slopes, curvatures
    )


def _legendre(m: int, degree: int, mu: Array, sine: Array) -> Array:
    """P_l^m for l = 0..degree (zero for l < m), normalized to unit square integral over mu.

    Positive at mu = 1 side; three-term recurrence (NIST DLMF 14.10.3, normalized).
    """
    table = np.zeros((mu.size, degree + 1))
    if m > degree:
        return table
    first = np.full(mu.size, np.sqrt(0.5))
    for k in range(1, m + 1):
        first = first * sine * np.sqrt((2 * k + 1) / (2 * k))
    table[:, m] = first
    for n in range(m + 1, degree + 1):
        a = np.sqrt((4 * n * n - 1) / (n * n - m * m))
        b = np.sqrt(((n - 1) ** 2 - m * m) / (4 * (n - 1) ** 2 - 1)) if n > m + 1 else 0.0
        previous = table[:, n - 2] if n > m + 1 else 0.0
        table[:, n] = a * (mu * table[:, n - 1] - b * previous)
    return table
