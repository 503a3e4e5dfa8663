"""Flow and shape that a polarized concentration drives, on the sphere to third order.

theta is the polar angle from the rear (the pole of high concentration, for a > 0).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.polymerization import Array
from amoeboid.theory.linear import driving_slope, flow_response
from amoeboid.theory.points import AnyPoints, Points, finite_result, points


@dataclass(frozen=True, kw_only=True)
class Harmonics:
    """Amplitudes of the first three harmonics of c: a P_1 + b P_2 + d P_3 [N/L^2]."""

    a: ArrayLike
    b: ArrayLike = 0.0
    d: ArrayLike = 0.0


@dataclass(frozen=True, kw_only=True)
class SphereVelocities:
    """Velocities at angles theta, components (e_r, e_theta) on the last axis [L/T].

    v_p, v_c, v: perturbations of polymerization, cortex and full velocity in the co-moving frame;
    v = v_p + v_c is tangential. migration: speed of the cell along +z (negative: towards the
    front, the pole theta = pi).
    """

    v_p: Array
    v_c: Array
    v: Array
    migration: Array


@finite_result
def driving_speeds(p: Points, c: Harmonics) -> Array:
    """Modes l = 1, 2, 3 of v_p + K c to third order in a [L/T], shape (3, ...)."""
    _, _, f2, f3 = p.v_p_derivatives(p.c0, 3)
    g1 = driving_slope(p)
    a, b, d = (np.asarray(x, dtype=float) for x in (c.a, c.b, c.d))
    first = g1 * a + 2 * f2 * a * b / 5 + f3 * a**3 / 10
    second = g1 * b + f2 * a**2 / 3
    third = g1 * d + 3 * f2 * a * b / 5 + f3 * a**3 / 15
    return np.stack(np.broadcast_arrays(first, second, third))


@finite_result
def flow_potential(p: Points, c: Harmonics, theta: ArrayLike) -> Array:
    """psi with v = grad_s psi [L^2/T]; SI `eq_flow_potential_perturbation` (whose R is R0 and which
    drops the P_3 part). Parameters broadcast against theta.
    """
    x = np.cos(theta)
    legendre = (x, (3 * x**2 - 1) / 2, (5 * x**3 - 3 * x) / 2)
    w = driving_speeds(p, c)
    return -p.R0 * sum(flow_response(p, l) * w[l - 1] * legendre[l - 1] for l in (1, 2, 3))


@finite_result
def flow_profile(p: Points, c: Harmonics, theta: ArrayLike) -> Array:
    """Retrograde flow u(theta) along e_theta [L/T]; SI `eq_full_velocity_comoving`, to third order.

    Negative for a > 0: towards the pole of high concentration. Parameters broadcast against theta.
    """
    x = np.cos(theta)
    slopes = (np.ones_like(x), 3 * x, (15 * x**2 - 3) / 2)
    w = driving_speeds(p, c)
    flow = sum(flow_response(p, l) * w[l - 1] * slopes[l - 1] for l in (1, 2, 3))
    return np.sin(theta) * flow


def max_retrograde_speed(p: AnyPoints, c: Harmonics, samples: int = 361) -> Array:
    """Largest |u| over the sphere [L/T], to 1e-5 of itself (the samples resolve the maximum)."""
    at = points(p)
    spread = {name: np.asarray(getattr(at, name))[..., None] for name in _numbers(at)}
    column = points(at, **spread)
    tall = Harmonics(a=_column(c.a), b=_column(c.b), d=_column(c.d))
    return np.abs(flow_profile(column, tall, np.linspace(0, np.pi, samples))).max(axis=-1)


@finite_result
def deformation(p: Points, c: Harmonics) -> Array:
    """Steady rho_2 in r = R0 (1 + rho_2 P_2) at finite delta_P [1]; SI `eq_rho_2` generalized.

    The printed form is the leading order in 1/delta_P; this one holds at any delta_P, to second
    order in a.
    """
    (f0,) = p.v_p_derivatives(p.c0, 0)
    S = p.eta_s + p.eta_b
    source = 4 * p.eta_s * S * driving_speeds(p, c)[1]
    stiffness = p.delta_P * p.R0**2 * (5 * p.eta_s + 3 * p.eta_b) + 4 * p.eta_s * S * f0
    return source / stiffness


@finite_result
def deformation_at_high_pressure(p: Points, c: Harmonics) -> Array:
    """rho_2 to leading order in 1/delta_P, as SI `eq_rho_2` and `eq_rho_2_inverse` print it [1]."""
    S = p.eta_s + p.eta_b
    source = 4 * p.eta_s * S * driving_speeds(p, c)[1]
    return source / (p.delta_P * p.R0**2 * (5 * p.eta_s + 3 * p.eta_b))


def sphere_velocities(p: AnyPoints, a: float, theta: ArrayLike) -> SphereVelocities:
    """The velocity perturbations of figure 2B for c = c0 + a cos(theta), to first order.

    Main text `deltavp`, SI `infinitan`. p is a single point; theta has any shape.
    """
    f1 = points(p).v_p_derivatives(p.c0, 1)[1]
    sine, cosine = np.sin(theta), np.cos(theta)
    zero = np.zeros_like(sine)
    v_p = np.stack([f1 * a * cosine, zero], axis=-1)
    v = np.stack([zero, flow_profile(p, Harmonics(a=a), theta)], axis=-1)
    # In the frame of the cell the cortex drifts along +z by f_1 a cos/sin, the cell the other way.
    return SphereVelocities(v_p=v_p, v_c=v - v_p, v=v, migration=np.asarray(f1 * a))


def _numbers(p: Points) -> tuple[str, ...]:
    return tuple(name for name in p.__dataclass_fields__ if name != "law")


def _column(values: ArrayLike) -> Array:
    return np.asarray(values, dtype=float)[..., None]
