"""Friction and bending in the linear stability of a steady state; see `stability`.

The surface moves along its normal by h, which leans the normal by -h_s along the meridian and by
-i (m/r) h around. Virtual powers are those of a force per area times the area, with the velocity of
the cortex held. Velocities and forces around the axis are i times the values here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.forces import friction


def slopes_of_H(
    kappa_1: Array, kappa_1_s: Array, kappa_1_ss: Array, kappa_2: Array, cot: Array
) -> tuple[Array, Array]:
    """First and second derivative of H = kappa_1 + kappa_2 along the meridian; cot = cos(psi)/r."""
    kappa_2_s = cot * (kappa_1 - kappa_2)
    kappa_2_ss = cot * (kappa_1_s - kappa_2_s) - (kappa_1 * kappa_2 + cot**2) * (kappa_1 - kappa_2)
    return kappa_1_s + kappa_2_s, kappa_1_ss + kappa_2_ss


def drag_stiffness(p: Any, base: Any, trial: Any) -> Array:
    """Power that friction takes up for every pair of trial velocities of the cortex."""
    m = base.measure * friction.density(base.c, p)
    along, across = m * (p.gamma_t + p.gamma_c), m * (p.gamma_n + p.gamma_c)
    tangent = trial.a.T @ (along * trial.a) + trial.b.T @ (along * trial.b)
    return np.asarray(tangent + trial.w.T @ (across * trial.w))


def drag_loads(p: Any, base: Any, trial: Any, fields: Any) -> tuple[Array, Array]:
    """Virtual powers of the change of the drag by every harmonic of h, and of c'."""
    m, slope = friction.density(base.c, p), p.gamma_share / (p.c0 or p.c_r)
    h, h_s, H = fields.values, fields.slopes, base.kappa_1 + base.kappa_2
    # the velocity relative to the surroundings
    tangent = base.U - base.sin_psi * base.cell_velocity
    v_n = base.cos_psi * base.cell_velocity
    along, across = friction.drag(tangent, v_n, base.W + v_n, base.c, p)
    # v_p and the drag along the normal follow the normal
    anisotropy = m * (p.gamma_n - p.gamma_t)
    leaning = base.measure * (anisotropy * v_n - m * p.gamma_t * base.W)
    area = base.measure * H
    by_shape = (
        trial.a.T @ (area * along * h + leaning * h_s)
        + trial.b.T @ (leaning * fields.wave * h)
        + trial.w.T @ (area * across * h + base.measure * anisotropy * tangent * h_s)
    )
    thicker = base.measure * slope / m
    faster = base.measure * m * p.gamma_n * base.slope
    by_concentration = trial.a.T @ (thicker * along * h) + trial.w.T @ (
        (thicker * across - faster) * h
    )
    return by_shape, by_concentration


def bending_load(p: Any, base: Any, trial: Any, fields: Any) -> Array:
    """Virtual power of the change of kappa [lap_s H + H (H^2/2 - 2 K)] n by every harmonic of h."""
    k1, k2, cot = base.kappa_1, base.kappa_2, base.cos_psi / base.r
    h, h_s, spread = fields.values, fields.slopes, fields.spreads
    H, K, H_s = k1 + k2, k1 * k2, base.H_s
    force = base.H_ss + cot * H_s + H * (k1 - k2) ** 2 / 2
    H_change = -spread - (k1**2 + k2**2) * h
    h_22 = cot * h_s - fields.wave**2 * h
    K_change = -(H * K * h + k2 * (spread - h_22) + k1 * h_22)
    # that of the Laplacian on the surface itself
    carried = (H - 2 * k1) * h_s * H_s - h * H_s**2 - 2 * h * (k1 * base.H_ss + k2 * cot * H_s)
    change = carried + (H**2 / 2 - 2 * K) * H_change + H * (H * H_change - 2 * K_change)
    w_spread = np.zeros((*spread.shape[:-1], trial.w.shape[-1]))  # 0 in the first columns, as w
    w_spread[..., -spread.shape[-1] :] = spread
    return np.asarray(
        p.kappa
        * (
            w_spread.swapaxes(-1, -2) @ (base.measure * H_change)
            + trial.w.T @ (base.measure * (change + force * H * h))
            - trial.a.T @ (base.measure * force * h_s)
            - trial.b.T @ (base.measure * force * fields.wave * h)
        )
    )
