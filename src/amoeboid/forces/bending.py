"""Bending of the membrane: the energy kappa/2 times the integral of H^2 (Helfrich), H = kappa_1 +
kappa_2.

Force per area along the normal, with K = kappa_1 kappa_2:

    f = kappa [ lap_s H + H (H^2/2 - 2 K) ] = kappa [ lap_s H + H (kappa_1 - kappa_2)^2/2 ]

It vanishes on every sphere.
"""

from __future__ import annotations

from typing import Any


def density(shape: Any, p: Any) -> Any:
    """Force per area along the normal of an axisymmetric surface [M/(L T^2)]."""
    H = shape.kappa_1 + shape.kappa_2
    difference = shape.kappa_1 - shape.kappa_2
    spread = shape.divergence(shape.even_slope(H))
    return (spread + H * difference * difference * 0.5) * p.kappa
