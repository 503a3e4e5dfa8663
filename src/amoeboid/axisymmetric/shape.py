"""The shape of an axisymmetric closed surface from its tangent angle in scaled arclength.

With s the arclength from the rear pole, x = s/length_scale in (0, pi) and psi the tangent angle,
r' = cos(psi), z' = -sin(psi), the outward normal is (sin(psi), cos(psi)) in the (r, z) plane and
kappa_1 = psi', kappa_2 = sin(psi)/r. psi - x is a sine series; the curve closes if the mean of
cos(psi) vanishes. Source: Seifert, Berndl & Lipowsky, Phys. Rev. A 44, 1182 (1991).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.axisymmetric.spectral import Grid
from amoeboid.numerics.derivatives import cos, sin, sqrt


@dataclass(frozen=True)
class Shape:
    """Geometry at the points of a grid; every entry is an array (n,) or a Dual.

    `scale` is ds/dx [length]; `gap` the dimensionless misfit r(pi)/(pi scale) of an open curve.
    """

    grid: Grid
    scale: Any
    sin_psi: Any
    cos_psi: Any
    psi_slope: Any
    r: Any
    kappa_1: Any
    kappa_2: Any
    cot: Any
    gap: Any

    @property
    def curvature_sum(self) -> Any:
        """H = kappa_1 + kappa_2 [1/length]."""
        return self.kappa_1 + self.kappa_2

    def even_slope(self, field: Any) -> Any:
        """d/ds of an even field."""
        return (self.grid.even_derivative @ field) / self.scale

    def odd_slope(self, field: Any) -> Any:
        """d/ds of an odd field."""
        return (self.grid.odd_derivative @ field) / self.scale

    def divergence(self, field: Any) -> Any:
        """Surface divergence of an odd tangential field along the meridian."""
        return self.odd_slope(field) + self.cot * field

    def surface_integral(self, field: Any) -> Any:
        """Integral of an even field over the surface, shape (1,)."""
        weights = (2 * np.pi) * self.grid.odd_weights[None, :]
        return (weights @ (field * self.r)) * self.scale

    @property
    def height(self) -> Any:
        """Coordinate z along the axis, zero at the center of volume [length]."""
        g = self.grid
        k = np.arange(1, g.n + 1)
        z = self.scale * (np.cos(np.outer(g.x, k)) @ ((g.to_odd @ self.sin_psi) / k))
        slices = g.odd_weights * self.r * self.r * self.sin_psi
        total = np.ones((1, g.n))
        return z - (total @ (slices * z)) / (total @ slices)

    @property
    def cos_theta(self) -> Any:
        """Cosine of the angle between the axis and the direction from the center of volume."""
        z = self.height
        return z / sqrt(self.r * self.r + z * z)

    @property
    def area(self) -> Any:
        """Surface area, shape (1,)."""
        return (2 * np.pi) * (self.grid.odd_weights[None, :] @ self.r) * self.scale


def shape(grid: Grid, psi: Any, psi_slope: Any, scale: Any) -> Shape:
    """Geometry from psi and d(psi)/dx at the grid points and scale = ds/dx, shape (1,)."""
    sin_psi, cos_psi = sin(psi), cos(psi)
    r = (grid.integral @ cos_psi) * scale
    return Shape(
        grid=grid,
        scale=scale,
        sin_psi=sin_psi,
        cos_psi=cos_psi,
        psi_slope=psi_slope,
        r=r,
        kappa_1=psi_slope / scale,
        kappa_2=sin_psi / r,
        cot=cos_psi / r,
        gap=np.full((1, grid.n), 1.0 / grid.n) @ cos_psi,
    )
