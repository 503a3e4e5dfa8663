"""Force balance of the viscous cortex, strong form, on an axisymmetric surface.

All fields are arrays or Duals; `p` holds the parameters, possibly complex.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from amoeboid.axisymmetric.shape import Shape


@dataclass(frozen=True)
class Stress:
    """Principal surface stresses along the meridian and the parallel [force/length]."""

    meridian: Any
    parallel: Any


def stress(shape: Shape, u: Any, w: Any, c: Any, zeta0: Any, p: Any) -> Stress:
    """Viscous stress of v_c = u t + w n, less alpha c, plus the tension zeta0.

    Main text, passive surface stress; SI `passive` and `surfaceStressAlpha`.
    """
    stretch_1 = shape.odd_slope(u) + shape.kappa_1 * w
    stretch_2 = shape.cot * u + shape.kappa_2 * w
    isotropic = (stretch_1 + stretch_2) * p.eta_b - c * p.alpha + zeta0
    return Stress(isotropic + stretch_1 * (2 * p.eta_s), isotropic + stretch_2 * (2 * p.eta_s))


def forces(shape: Shape, s: Stress, axial: Any, p: Any) -> tuple[Any, Any]:
    """Tangential and normal force per area: div_s(sigma) + delta_P n + axial e_z.

    The constant axial body force is no physics: a closed surface balances it only if it is zero,
    so as an unknown it takes up the one equation that axial equilibrium makes redundant.
    """
    tangential = shape.even_slope(s.meridian) + shape.cot * (s.meridian - s.parallel)
    normal = p.delta_P - (shape.kappa_1 * s.meridian + shape.kappa_2 * s.parallel)
    return tangential - shape.sin_psi * axial, normal + shape.cos_psi * axial


def speed(c: Any, p: Any) -> Any:
    """Polymerization speed v_p(c) of an array or a Dual [length/time]; main text `vp`."""
    if hasattr(c, "derivatives"):
        value, slope = p.law.derivatives(c.values, p.v_p0, p.c_r, 1)
        return c.map(value, slope)
    return p.law.value(c, p.v_p0, p.c_r)


def transport(shape: Shape, c: Any, u: Any, p: Any) -> Any:
    """Rate of c on a surface at rest [1/(length^2 time)]: main text `cdot_advective`."""
    flux = shape.even_slope(c) * p.D - c * u
    return shape.divergence(flux) + (p.c0 - c) * p.beta
