"""What an axisymmetric cell is measured by; docs/notation.md lists the definitions.

They are those of `amoeboid.observables`, as integrals along the meridian. All functions take the
shape and fields at the points of its grid: concentration c, tangential velocity u (positive
towards x = pi), normal velocity V and polymerization speed v_p.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.shape import Shape

# Points of the grid that is searched for an extremum, per coefficient of a series.
POINTS_PER_MODE = 16


def heights(s: Shape) -> Array:
    """Coordinate along the axis (n,), zero at the center of volume [length]."""
    return np.asarray(s.height)


def volume(s: Shape) -> float:
    """Enclosed volume [length^3]."""
    return float(np.pi * s.scale[0] * (s.grid.odd_weights @ (s.r**2 * s.sin_psi)))


def integral(s: Shape, field: Array) -> float:
    """Integral of an even field over the surface."""
    return float(s.surface_integral(field)[0])


def center_velocity(s: Shape, V: Array) -> float:
    """Velocity of the center of volume along the axis [length/time]."""
    return integral(s, V * heights(s)) / volume(s)


def retrograde_flow(s: Shape, u: Array, V: Array) -> Array:
    """u in the frame in which the center of volume rests (n,) [length/time]."""
    return np.asarray(u + center_velocity(s, V) * s.sin_psi)


def cortex_drag_speed(s: Shape, u: Array, V: Array, v_p: Array) -> float:
    """Speed of the center of volume if all drag is on the cortex, uniformly [length/time].

    The area mean of the cortex velocity vanishes then.
    """
    along_axis = -u * s.sin_psi + (V - v_p) * s.cos_psi
    return abs(center_velocity(s, V) - integral(s, along_axis) / float(s.area[0]))


def polarity(s: Shape, c: Array, R0: float) -> float:
    """|integral of c r dA| / (R0 integral of c dA), about the center of volume."""
    return abs(integral(s, c * heights(s))) / (R0 * integral(s, c))


def reduced_volume(s: Shape, R0: float) -> float:
    """Volume over that of the sphere of radius R0."""
    return volume(s) / (4.0 * np.pi / 3.0 * R0**3)


def cosine_extrema(coefficients: Array) -> tuple[float, float]:
    """Smallest and largest sum_k a_k cos(k x) on [0, pi], poles and all between included.

    The best of a fine grid, refined by Newton's method.
    """
    k = np.arange(coefficients.size)
    x = np.linspace(0.0, np.pi, POINTS_PER_MODE * coefficients.size + 1)
    values = np.cos(np.outer(x, k)) @ coefficients
    found = []
    for sign in (-1.0, 1.0):
        best = x[np.argmax(sign * values)]
        value = float(np.max(sign * values))
        for _ in range(3):
            slope = -np.sin(k * best) @ (k * coefficients)
            bend = -np.cos(k * best) @ (k * k * coefficients)
            best -= slope / bend if bend != 0 else 0.0
        found.append(sign * max(value, float(sign * (np.cos(k * best) @ coefficients))))
    return found[0], found[1]
