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


def drag_stiffness(p: Any, base: Any, along: Any, across: Any) -> tuple[Array, Array]:
    """Power that friction takes up for every pair of velocities along the surface, and across."""
    m, f = base.measure * friction.density(base.c, p), across.values
    drag = m * (p.gamma_t + p.gamma_c)
    tangential = along.a.T @ (drag * along.a) + along.b.T @ (drag * along.b)
    return tangential, f.T @ (m * (p.gamma_n + p.gamma_c) * f)


def drag_loads(p: Any, base: Any, along: Any, across: Any) -> tuple[Array, Array]:
    """Virtual powers of the change of the drag along the surface, and across.

    One column for every harmonic of h, then one for every harmonic of c'.
    """
    m, slope = friction.density(base.c, p), p.gamma_share / (p.c0 or p.c_r)
    h, h_s = across.values, across.slopes
    # the velocity relative to the surroundings
    tangent = base.U - base.sin_psi * base.cell_velocity
    v_n = base.cos_psi * base.cell_velocity
    drag, lift = friction.drag(tangent, v_n, base.W + v_n, base.c, p)
    # v_p and the drag along the normal follow the normal
    anisotropy = m * (p.gamma_n - p.gamma_t)
    leaning = base.measure * (anisotropy * v_n - m * p.gamma_t * base.W)
    area = base.measure * base.H
    thicker = base.measure * slope / m
    faster = base.measure * m * p.gamma_n * base.slope
    tangential = (
        along.a.T @ (area * drag * h + leaning * h_s) + along.b.T @ (leaning * across.around),
        along.a.T @ (thicker * drag * h),
    )
    normal = (
        h.T @ (area * lift * h + base.measure * anisotropy * tangent * h_s),
        h.T @ ((thicker * lift - faster) * h),
    )
    return np.concatenate(tangential, axis=-1), np.concatenate(normal, axis=-1)


def bending_load(p: Any, base: Any, along: Any, across: Any) -> tuple[Array, Array]:
    """Virtual power of the change of kappa [lap_s H + H (H^2/2 - 2 K)] n by every harmonic of h.

    Of velocities along the surface, and across.
    """
    k1, k2, cot = base.kappa_1, base.kappa_2, base.cot
    h, h_s, spread = across.values, across.slopes, across.spreads
    H, K, H_s, measure = base.H, k1 * k2, base.H_s, p.kappa * base.measure
    force = base.H_ss + cot * H_s + H * (k1 - k2) ** 2 / 2
    H_change = -spread - (k1**2 + k2**2) * h
    h_22 = cot * h_s - across.wave**2 * h
    K_change = -(H * K * h + k2 * (spread - h_22) + k1 * h_22)
    # that of the Laplacian on the surface itself
    carried = (H - 2 * k1) * h_s * H_s - h * H_s**2 - 2 * h * (k1 * base.H_ss + k2 * cot * H_s)
    change = carried + (H**2 / 2 - 2 * K) * H_change + H * (H * H_change - 2 * K_change)
    leaning = measure * force
    tangential = along.a.T @ (leaning * h_s) + along.b.T @ (leaning * across.around)
    normal = spread.swapaxes(-1, -2) @ (measure * H_change)
    return -tangential, normal + h.T @ (measure * (change + force * H * h))
