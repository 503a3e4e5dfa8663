"""Force balance of the viscous cortex, strong form, on an axisymmetric surface.

All fields are arrays or Duals; `p` holds the parameters, possibly complex.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.shape import Shape
from amoeboid.forces import bending, friction
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import ParameterPoint
from amoeboid.model.stress import principal_stresses
from amoeboid.numerics.programs import Symbol
from amoeboid.validation import InvalidInput


@dataclass(frozen=True)
class Stress:
    """Principal surface stresses along the meridian and the parallel [force/length]."""

    meridian: Any
    parallel: Any


def stress(shape: Shape, u: Any, w: Any, c: Any, zeta0: Any, p: Any) -> Stress:
    """Viscous stress of v_c = u t + w n, plus tau(c) and the tension zeta0.

    Main text, passive surface stress; SI `passive` and `surfaceStressAlpha`.
    """
    stretch_1 = shape.odd_slope(u) + shape.kappa_1 * w
    stretch_2 = shape.cot * u + shape.kappa_2 * w
    tau = function_of(c, p.tau_derivatives)
    return Stress(*principal_stresses(stretch_1, stretch_2, tau, zeta0, p))


@dataclass(frozen=True)
class Motion:
    """Velocities in the frame of the cell [length/time], and c.

    `u` along the meridian, the same of membrane and cortex; `v_n` and `w` along the normal, that of
    the membrane and that of the cortex.
    """

    u: Any
    v_n: Any
    w: Any
    c: Any


def forces(shape: Shape, s: Stress, motion: Motion, axial: Any, p: Any) -> tuple[Any, Any]:
    """Tangential and normal force per area: div_s(sigma) + delta_P n + bending + drag + axial e_z.

    With friction `axial` is the drag -gamma U on the motion of the frame, U the velocity of the
    cell and gamma a typical friction (`friction.unit`), which acts along the surface and along the
    normal in the shares of both. Without friction the constant axial force is no physics: a closed
    surface balances it only if it is zero, so as an unknown it takes up the one equation that axial
    equilibrium makes redundant.
    """
    tangential = shape.even_slope(s.meridian) + shape.cot * (s.meridian - s.parallel)
    normal = p.delta_P - (shape.kappa_1 * s.meridian + shape.kappa_2 * s.parallel)
    if p.kappa:
        normal = normal + bending.density(shape, p)
    if not p.has_friction:
        return tangential - shape.sin_psi * axial, normal + shape.cos_psi * axial
    along, across = friction.drag(motion.u, motion.v_n, motion.w, motion.c, p)
    carried = axial * friction.density(motion.c, p)
    return (
        tangential + along - shape.sin_psi * carried * p.share_along,
        normal + across + shape.cos_psi * carried * p.share_across,
    )


def speed(shape: Shape, c: Any, p: Any) -> Any:
    """Polymerization speed of an array or a Dual c [length/time]; main text `vp`.

    v_p(c), times 1 + p.cue cos(theta) if p has a cue along the axis; see `with_cue`.
    """
    v_p = function_of(c, p.v_p_derivatives)
    strength = getattr(p, "cue", 0.0)
    return v_p * (shape.cos_theta * strength + 1.0) if strength else v_p


def with_cue(p: ParameterPoint, cue: Any) -> ParameterPoint:
    """The parameters with the strength of a cue along the axis, or of none.

    Raises InvalidInput for a cue that is not along the axis.
    """
    strength = axial_strength(cue)
    return ParameterPoint(vars(p) | {"cue": strength}) if strength else p


def axial_strength(cue: Any) -> float:
    """Strength of a cue towards the pole x = 0, where z is largest; 0 for None.

    Raises InvalidInput for a cue that is not along the axis.
    """
    if cue is None:
        return 0.0
    along = isinstance(cue, Cue) and cue.direction[0] == 0 == cue.direction[1]
    if not along or cue.pokes:
        raise InvalidInput(
            "the cue of an axisymmetric cell must point along its axis, direction (0, 0, 1), "
            f"without pokes, got {cue!r}; use a 3D run"
        )
    return float(np.copysign(cue.strength, cue.direction[2] * cue.strength))


def refuse_cue(cue: Any, what: str) -> None:
    """Raise InvalidInput where there is a cue: `what` is only known of a cell without one."""
    if axial_strength(cue) != 0.0:
        raise InvalidInput(
            f"{what} needs a cell without a cue, got {cue!r}; compute the time evolution under "
            "the cue, or run the cell in 3D"
        )


def function_of(c: Any, derivatives: Callable[[Array, int], tuple[Array, ...]]) -> Any:
    """A function of an array, Dual or Symbol, given (f(c), f'(c)) by `derivatives(c, 1)`."""
    if isinstance(c, Symbol):
        return c.relation(derivatives)
    if hasattr(c, "derivatives"):
        return c.map(*derivatives(c.values, 1))
    return derivatives(c, 0)[0]


def transport(shape: Shape, c: Any, u: Any, p: Any) -> Any:
    """Rate of c on a surface at rest [1/(length^2 time)]: main text `cdot_advective`."""
    flux = shape.even_slope(c) * p.D - c * u
    return shape.divergence(flux) + (p.c0 - c) * p.beta
