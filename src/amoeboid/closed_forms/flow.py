"""Flow and shape that a polarized concentration drives, to third order.

theta is the polar angle from the rear (the pole of high concentration, for a > 0). On a sphere
(rho_2 = rho_3 = 0) these are the formulas of the paper's supplement, SI
`eq_v_cortex_coeffs_second_order` and `eq_def_flow_potential`. Results
have the shape that all arguments broadcast to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.linear import (
    driving_derivatives,
    driving_slope,
    flow_response,
    refuse_surroundings,
    shape_response,
    stress_slope,
)
from amoeboid.closed_forms.points import AnyPoints, Points, finite_result, points
from amoeboid.validation import InvalidInput


@dataclass(frozen=True, kw_only=True)
class Harmonics:
    """The first harmonics of c, a P_1 + b P_2 + d P_3 [N/L^2], and of the shape [1].

    The shape is r = R0 (1 + rho_2 P_2 + rho_3 P_3).
    """

    a: ArrayLike
    b: ArrayLike = 0.0
    d: ArrayLike = 0.0
    rho_2: ArrayLike = 0.0
    rho_3: ArrayLike = 0.0


@dataclass(frozen=True, kw_only=True)
class SphereVelocities:
    """Velocities at angles theta, components (e_r, e_theta) on the last axis [L/T].

    v_p, v_c, v: perturbations of polymerization, cortex and full velocity in the co-moving frame;
    v = v_p + v_c is tangential. migration: speed along +z (negative: towards the front, the pole
    theta = pi) of a cell whose membrane moves with v_p relative to its surroundings, as the paper
    supposes. With alpha or a stress v_c is not uniform, and v + migration e_z not normal.
    """

    v_p: Array
    v_c: Array
    v: Array
    migration: Array


@finite_result
def driving_speeds(p: Points, c: Harmonics) -> Array:
    """Modes l = 1, 2, 3 of w(c) to third order in a [L/T], shape (3, ...)."""
    _, w1, w2, w3 = driving_derivatives(p, 3)
    a, b, d = (np.asarray(x, dtype=float) for x in (c.a, c.b, c.d))
    first = w1 * a + 2 * w2 * a * b / 5 + w3 * a**3 / 10
    second = w1 * b + w2 * a**2 / 3
    third = w1 * d + 3 * w2 * a * b / 5 + w3 * a**3 / 15
    return np.stack(np.broadcast_arrays(first, second, third))


@finite_result
def flow_modes(p: Points, c: Harmonics) -> Array:
    """Modes u_l of the flow u = sin(theta) (u_1 P_1' + u_2 P_2' + u_3 P_3') [L/T], shape (3, ...).

    u is positive towards the front, to third order in a, on the resting shape of c. The part on a
    sphere is G_l times the driving speed of the mode. Raises InvalidInput with friction or bending.
    """
    refuse_surroundings(p, "the flow to third order")
    f0, f1 = p.v_p_derivatives(p.c0, 1)
    w1, K1 = driving_slope(p), stress_slope(p)
    G2, G3 = flow_response(p, 2), flow_response(p, 3)
    a, rho_2, rho_3 = (np.asarray(x, dtype=float) for x in (c.a, c.rho_2, c.rho_3))
    drive = driving_speeds(p, c)
    first = drive[0] + (9 * f1 / 5 + K1) * a * rho_2
    second = G2 * drive[1] + (1 - G2) * f0 * rho_2
    shape = (1 - G3) * f0 * rho_3 + (f1 + (1 - 6 * G3) * w1) / 5 * a * rho_2
    return np.stack(np.broadcast_arrays(first, second, G3 * drive[2] + shape))


@finite_result
def flow_potential(p: Points, c: Harmonics, theta: ArrayLike) -> Array:
    """psi with v = grad_s psi [L^2/T]; SI `eq_flow_potential_perturbation` (whose R is R0 and which
    drops the P_3 part). Parameters broadcast against theta.
    """
    x = np.cos(theta)
    legendre = (x, (3 * x**2 - 1) / 2, (5 * x**3 - 3 * x) / 2)
    first, second, third = flow_modes(p, c)
    # the length of the meridian, 1 + rho_2 P_2, times the flow of the first mode
    stretch = driving_slope(p) * np.asarray(c.a) * np.asarray(c.rho_2) / 5
    modes = (first - stretch, second, third + stretch)
    return -p.R0 * sum(u * P for u, P in zip(modes, legendre, strict=True))


@finite_result
def flow_profile(p: Points, c: Harmonics, theta: ArrayLike) -> Array:
    """Retrograde flow u(theta) along e_theta [L/T]; SI `eq_full_velocity_comoving`, to third order.

    Negative for a > 0: towards the pole of high concentration. Parameters broadcast against theta.
    """
    q0, q1, q2 = _flow_polynomial(p, c)
    x = np.cos(theta)
    return np.sin(theta) * (q0 + q1 * x + q2 * x**2)


@finite_result
def max_retrograde_speed(p: Points, c: Harmonics) -> Array:
    """Largest |u| over the sphere [L/T]: the best of 31 angles, refined by Newton's method."""
    q0, q1, q2 = _flow_polynomial(p, c)

    def speed(theta: Array) -> Array:
        x = np.cos(theta)
        return np.abs(np.sin(theta) * (q0 + q1 * x + q2 * x**2))

    angles = np.linspace(0, np.pi, 33)[1:-1]
    values = speed(angles.reshape(-1, *[1] * q0.ndim))
    best, at = values.max(axis=0), angles[values.argmax(axis=0)]
    step = angles[1] - angles[0]
    for _ in range(4):
        x, s = np.cos(at), np.sin(at)
        q, slope = q0 + q1 * x + q2 * x**2, q1 + 2 * q2 * x
        first = x * q - s**2 * slope
        second = -s * (q + 3 * x * slope - 2 * s**2 * q2)
        move = np.where(second == 0, 0.0, -first / np.where(second == 0, 1.0, second))
        at = at + np.clip(move, -step, step)
    return np.maximum(best, speed(at))


@finite_result
def rho_2(p: Points, c: Harmonics) -> Array:
    """Steady rho_2 in r = R0 (1 + rho_2 P_2) at delta_P of p [1]; SI `eq_rho_2` generalized.

    The printed form is the leading order in 1/delta_P; this one holds at any delta_P, to second
    order in a. Uses a and b of c alone. Raises InvalidInput where delta_P and v_p(c0) are both 0.
    """
    return shape_response(p, 2) * driving_speeds(p, c)[1]


@finite_result
def rho_2_at_high_pressure(p: Points, c: Harmonics) -> Array:
    """rho_2 to leading order in 1/delta_P, as SI `eq_rho_2` and `eq_rho_2_inverse` print it [1].

    Raises InvalidInput where delta_P = 0.
    """
    if np.any(p.delta_P == 0):
        raise InvalidInput("delta_P must be > 0 for its expansion in 1/delta_P, got 0")
    S = p.eta_s + p.eta_b
    source = 4 * p.eta_s * S * driving_speeds(p, c)[1]
    return source / (p.delta_P * p.R0**2 * (5 * p.eta_s + 3 * p.eta_b))


def sphere_velocities(p: AnyPoints, a: float, theta: ArrayLike) -> SphereVelocities:
    """The velocity perturbations of figure 2B for c = c0 + a cos(theta), to first order.

    Main text `deltavp`, SI `infinitan`. p is a single point; theta has any shape. Raises
    InvalidInput with friction, with which the cortex does not move as a whole.
    """
    refuse_surroundings(p, "figure 2B")
    f1, g1 = points(p).v_p_derivatives(p.c0, 1)[1], driving_slope(p)
    sine, cosine = np.sin(theta), np.cos(theta)
    zero = np.zeros_like(sine)
    v_p = np.stack([f1 * a * cosine, zero], axis=-1)
    v = np.stack([zero, g1 * a * sine], axis=-1)
    return SphereVelocities(v_p=v_p, v_c=v - v_p, v=v, migration=np.asarray(f1 * a))


def _flow_polynomial(p: Points, c: Harmonics) -> tuple[Array, Array, Array]:
    """Coefficients of u/sin(theta) in powers of x = cos(theta): sum of u_l P_l'(x)."""
    first, second, third = flow_modes(p, c)
    q0, q1, q2 = np.broadcast_arrays(first - 1.5 * third, 3 * second, 7.5 * third)
    return q0, q1, q2
