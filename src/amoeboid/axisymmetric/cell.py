"""An axisymmetric cell as observables see it: one meridian, the axis of symmetry along z.

Integrals are those of the spectral method; extrema lie anywhere on the meridian, poles included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.shape import Shape
from amoeboid.model.parameters import Parameters

# Points of the grid that is searched for an extremum, per coefficient of a series.
POINTS_PER_MODE = 16
NEWTON_STEPS = 3


@dataclass(frozen=True, eq=False)
class AxisymmetricCell:
    """See `observables.Cell`; its points are those of the grid of `shape`, the meridian at y = 0.

    `c` concentration, `u` tangential velocity towards x = pi, `V` normal velocity, `speed` that of
    polymerization along the normal, all at the points (n,).
    """

    parameters: Parameters
    shape: Shape
    c: Array
    u: Array
    V: Array
    speed: Array
    zeta0: float

    @cached_property
    def x(self) -> Array:
        """Points (n, 3) relative to the center of volume [L]."""
        s = self.shape
        return np.column_stack([s.r, np.zeros_like(s.r), heights(s)])

    @cached_property
    def tangents(self) -> Array:
        """Unit tangents of the meridian (n, 3), towards x = pi."""
        s = self.shape
        return np.column_stack([s.cos_psi, np.zeros_like(s.r), -s.sin_psi])

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (n, 3)."""
        s = self.shape
        return np.column_stack([s.sin_psi, np.zeros_like(s.r), s.cos_psi])

    @property
    def v(self) -> Array:
        """Full velocity (n, 3) [L/T]."""
        return self.u[:, None] * self.tangents + self.V[:, None] * self.normals

    @property
    def v_p(self) -> Array:
        """Polymerization velocity (n, 3) [L/T]."""
        return self.speed[:, None] * self.normals

    @property
    def v_c(self) -> Array:
        """Velocity of the cortex (n, 3) [L/T]."""
        return self.v - self.v_p

    @property
    def area(self) -> float:
        """Area of the surface [L^2]."""
        return float(self.shape.area[0])

    @property
    def radius(self) -> float:
        """Radius of the sphere of that area [L]."""
        return float(np.sqrt(self.area / (4.0 * np.pi)))

    @property
    def volume(self) -> float:
        """Enclosed volume [L^3]."""
        return volume(self.shape)

    def integral(self, field: Array) -> Any:
        """Integral over the surface of revolution of a field (n,) or of vectors (n, 3).

        Of vectors, turned about the axis with the meridian, the part along the axis is left.
        """
        if np.ndim(field) == 1:
            return float(self.shape.surface_integral(field)[0])
        return np.array([0.0, 0.0, float(self.shape.surface_integral(field[:, 2])[0])])

    def maximum(self, field: Array) -> float:
        """Maximum on the meridian of a field (n,), as a cosine series."""
        # of the differences, so that a uniform field stays what it is to the last bit
        k, coefficients = np.arange(len(field)), self.shape.grid.to_even @ (field - field[0])

        def series(x: Array, derivatives: bool) -> list[Array]:
            return _even(k, coefficients, _waves(x, k.size), derivatives)

        return float(field[0]) + _maximum(series, k.size)

    def minimum(self, field: Array) -> float:
        """Minimum on the meridian of a field (n,), as a cosine series."""
        return -self.maximum(-field)

    def max_length(self, field: Array) -> float:
        """Maximum length on the meridian of vectors (n, 3), whose tangential part is odd."""
        g = self.shape.grid
        parts = (
            (_odd, np.arange(1, g.n + 1), g.to_odd @ np.einsum("pi,pi->p", field, self.tangents)),
            (_even, np.arange(g.n), g.to_even @ np.einsum("pi,pi->p", field, self.normals)),
            (_odd, np.arange(1, g.n + 1), g.to_odd @ field[:, 1]),
        )

        present = [part for part in parts if np.any(part[2])]

        def squares(x: Array, derivatives: bool) -> list[Array]:
            waves = _waves(x, g.n)
            found = [np.zeros_like(x) for _ in range(3 if derivatives else 1)]
            for series, k, a in present:
                f, *rest = series(k, a, waves, derivatives)
                found[0] += f * f
                if derivatives:
                    f_x, f_xx = rest
                    found[1] += 2.0 * f * f_x
                    found[2] += 2.0 * (f_x * f_x + f * f_xx)
            return found

        return float(np.sqrt(_maximum(squares, g.n)))


def heights(s: Shape) -> Array:
    """Coordinate along the axis (n,), zero at the center of volume [L]."""
    return np.asarray(s.height)


def volume(s: Shape) -> float:
    """Enclosed volume [L^3]."""
    return float(np.pi * s.scale[0] * (s.grid.odd_weights @ (s.r**2 * s.sin_psi)))


@lru_cache(maxsize=8)
def _fine(modes: int) -> tuple[Array, Array, Array]:
    """The grid that is searched for an extremum, and sin and cos(k x) there, k = 0..modes."""
    x = np.linspace(0.0, np.pi, POINTS_PER_MODE * modes + 1)
    phases = np.outer(x, np.arange(modes + 1))
    return x, np.sin(phases), np.cos(phases)


def _waves(x: Array, modes: int) -> tuple[Array, Array]:
    """sin and cos(k x), k = 0..modes; those of `_fine` are at hand."""
    fine, sines, cosines = _fine(modes)
    if x is fine:
        return sines, cosines
    phases = np.outer(x, np.arange(modes + 1))
    return np.sin(phases), np.cos(phases)


def _even(
    k: Array, coefficients: Array, waves: tuple[Array, Array], derivatives: bool
) -> list[Array]:
    """A cosine series, with its slope and the slope of that if wanted."""
    sines, cosines = (wave[:, k[0] : k[-1] + 1] for wave in waves)
    if not derivatives:
        return [cosines @ coefficients]
    return [cosines @ coefficients, -sines @ (k * coefficients), -cosines @ (k * k * coefficients)]


def _odd(
    k: Array, coefficients: Array, waves: tuple[Array, Array], derivatives: bool
) -> list[Array]:
    """A sine series, with its slope and the slope of that if wanted."""
    sines, cosines = (wave[:, k[0] : k[-1] + 1] for wave in waves)
    if not derivatives:
        return [sines @ coefficients]
    return [sines @ coefficients, cosines @ (k * coefficients), -sines @ (k * k * coefficients)]


def _maximum(series: Callable[[Array, bool], list[Array]], modes: int) -> float:
    """Maximum on [0, pi], the best of a fine grid refined by Newton's method."""
    x = _fine(modes)[0]
    [values] = series(x, False)
    highest = int(np.argmax(values))
    best, value = x[highest : highest + 1], float(values[highest])
    for _ in range(NEWTON_STEPS):
        refined, slope, bend = (float(part[0]) for part in series(best, True))
        value = max(value, refined)
        if not bend < 0.0:
            break
        best = np.clip(best - slope / bend, max(x[highest] - x[1], 0.0), x[highest] + x[1])
    return max(value, float(series(best, False)[0][0]))
