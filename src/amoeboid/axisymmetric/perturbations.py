"""Perturbations exp(i m phi) of a steady state: the rates of shape and concentration, in weak form.

See `stability` for the equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.harmonics import HarmonicBasis
from amoeboid.axisymmetric.spectral import even_basis, odd_basis
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.surroundings import (
    bending_load,
    drag_loads,
    drag_stiffness,
    slopes_of_H,
)
from amoeboid.axisymmetric.unknowns import split
from amoeboid.forces import friction
from amoeboid.model.parameters import Parameters
from amoeboid.model.stress import principal_stresses
from amoeboid.numerics.newton import solve

ROTATION_SEEN = 1e-6
"""A homogeneous sphere looks the same after a rotation: no mode is removed for it.

The size of the mode of rotation, in natural units, from which on it counts.
"""


@dataclass(frozen=True)
class Base:
    """The steady state at the nodes of a basis; every entry has shape (nodes, 1)."""

    measure: Array
    r: Array
    z: Array
    sin_psi: Array
    cos_psi: Array
    kappa_1: Array
    kappa_2: Array
    U: Array
    W: Array
    stretch_1: Array
    stretch_2: Array
    shear: Array
    sigma_1: Array
    sigma_2: Array
    c: Array
    c_s: Array
    slope: Array
    tau_slope: Array
    cell_velocity: Array
    H_s: Array
    H_ss: Array


def base_fields(state: SteadySolution, basis: HarmonicBasis) -> Base:
    """The fields of a steady state that the linearization needs, at the nodes of the basis."""
    n, scale, p = state.n, state.length_scale, state.parameters
    a_psi, a_u, a_c, scalars = split(state.x, n)
    x = basis.x
    sines, cosines = odd_basis(x, n), even_basis(x, n)
    k = np.arange(1, n + 1)
    psi = x + sines[:, : n - 1] @ a_psi
    psi_slope = 1.0 + (cosines[:, 1:] * k[:-1]) @ a_psi
    even_slopes = -(sines * k)
    odd_slopes = np.cos(np.outer(x, k)) * k
    r, z = state.position(x)
    u, c = sines @ a_u, cosines @ a_c
    u_slope, c_slope = odd_slopes @ a_u, even_slopes[:, : n - 1] @ a_c[1:]
    speed, slope = p.v_p_derivatives(c, 1)
    kappa_1, kappa_2 = psi_slope / scale, np.sin(psi) / r
    stretch_1 = u_slope / scale - kappa_1 * speed
    stretch_2 = np.cos(psi) / r * u - kappa_2 * speed
    tau, tau_slope = p.tau_derivatives(c, 1)
    sigma_1, sigma_2 = principal_stresses(stretch_1, stretch_2, tau, scalars[1], p)
    measure = basis.weights * scale * r / np.sin(x)
    entries = (
        measure, r, z, np.sin(psi), np.cos(psi), kappa_1, kappa_2, u, -speed,
        stretch_1, stretch_2, -slope * c_slope / scale - kappa_1 * u,
        sigma_1, sigma_2, c, c_slope / scale, slope, tau_slope,
        np.full(x.size, -scalars[2] / friction.unit(p) if p.has_friction else 0.0),
        *slopes_of_H(state, x, psi, r),
    )  # fmt: skip
    return Base(*(e[:, None] for e in entries))


@dataclass(frozen=True)
class Trial:
    """Basis velocities (a, i b, w) and the strain rates they make, one column each.

    `stretch_1`, `stretch_2` are the extension rates, i `shear` twice the shear rate; `lean` is the
    n component of dv/ds, i `tilt` that of dv/(r dphi).
    """

    a: Array
    b: Array
    w: Array
    stretch_1: Array
    stretch_2: Array
    shear: Array
    lean: Array
    tilt: Array


def trial_velocities(base: Base, basis: HarmonicBasis, scale: float) -> Trial:
    """Gradients and rotations of the harmonics, and the harmonics along the normal."""
    m = int(basis.degrees[0])
    tangent = slice(1, None) if m == 0 else slice(None)
    P, slope, over = basis.values, basis.slopes[:, tangent], basis.over_sine[:, tangent]
    slope_s, over_s = basis.curvatures[:, tangent], basis.over_sine_slopes[:, tangent]
    none, still = np.zeros((P.shape[0], 0)), np.zeros_like(P)
    rotation = (none, none, none, none) if m == 0 else (over, slope, over_s, slope_s)
    a = np.hstack([slope, rotation[0], still])
    b = np.hstack([over, rotation[1], still])
    a_s = np.hstack([slope_s, rotation[2], still]) / scale
    b_s = np.hstack([over_s, rotation[3], still]) / scale
    w = np.hstack([np.zeros((P.shape[0], a.shape[1] - P.shape[1])), P])
    w_s = np.hstack([np.zeros((P.shape[0], a.shape[1] - P.shape[1])), basis.slopes]) / scale
    wave, cot = m / base.r, base.cos_psi / base.r
    return Trial(
        a=a,
        b=b,
        w=w,
        stretch_1=a_s + base.kappa_1 * w,
        stretch_2=cot * a - wave * b + base.kappa_2 * w,
        shear=wave * a - cot * b + b_s,
        lean=w_s - base.kappa_1 * a,
        tilt=wave * w - base.kappa_2 * b,
    )


@dataclass(frozen=True)
class Perturbed:
    """The harmonics that displacement h and c' are made of, one column each.

    `slopes` along the meridian, surface Laplacians `spreads`, and `wave` = m/r.
    """

    values: Array
    slopes: Array
    spreads: Array
    wave: Array


def perturbed_fields(base: Base, basis: HarmonicBasis, scale: float) -> Perturbed:
    """The harmonics at the nodes."""
    slopes, wave = basis.slopes / scale, basis.degrees[0] / base.r
    along = basis.curvatures / scale**2 + base.cos_psi / base.r * slopes
    return Perturbed(basis.values, slopes, along - wave**2 * basis.values, wave)


def rigid_motions(base: Base, m: int) -> list[tuple[Array, Array, Array]]:
    """(a, b, w) of the rigid velocities with azimuthal number m: e_z; e_x + i e_y, rotation."""
    sin, cos, r, z = base.sin_psi, base.cos_psi, base.r, base.z
    if m == 0:
        return [(-sin, 0 * r, cos)]
    if m == 1:
        return [(cos, 1 + 0 * r, sin), (z * cos + r * sin, z, z * sin - r * cos)]
    return []


def velocity_response(
    p: Parameters,
    base: Base,
    trial: Trial,
    fields: Perturbed,
    rigid: list[tuple[Array, Array, Array]],
) -> tuple[Array, Array, Array]:
    """(a, b, w) at the nodes that each perturbation drives.

    Without net rigid motion; with friction relative to the surroundings of the unperturbed cell.
    One column for every harmonic of h, then one for every harmonic of c'.
    """
    velocities = np.concatenate([trial.a, trial.b, trial.w])
    if p.has_friction:
        rigid = []  # none is free
    borders = [
        velocities.T @ np.concatenate([base.measure * v for v in motion]) for motion in rigid
    ]
    load = _load(p, base, trial, fields)
    right = [np.zeros((1, load.shape[1]))] * len(rigid)
    if not np.any(fields.wave):
        H = base.measure * (base.kappa_1 + base.kappa_2)
        borders.append(trial.w.T @ H)
        change = np.hstack([-base.U * fields.slopes, base.slope * fields.values])
        right.append(-H.T @ change)
    border = np.hstack([np.zeros((load.shape[0], 0)), *borders])
    k = border.shape[1]
    matrix = np.block([[_stiffness(p, base, trial), border], [border.T, np.zeros((k, k))]])
    v = solve(matrix, np.vstack([-load, *right]))[: load.shape[0]]
    a, b, w = np.split(velocities @ v, 3)
    return a, b, w


def _stiffness(p: Parameters, base: Base, trial: Trial) -> Array:
    """Dissipation of every pair of trial velocities."""
    rates = np.concatenate(
        [trial.stretch_1 + trial.stretch_2, trial.stretch_1, trial.stretch_2, trial.shear]
    )
    viscosities = (p.eta_b, 2 * p.eta_s, 2 * p.eta_s, p.eta_s)
    found = rates.T @ (np.concatenate([eta * base.measure for eta in viscosities]) * rates)
    if p.has_friction:
        found += drag_stiffness(p, base, trial)
    return np.asarray(found)


def _load(p: Parameters, base: Base, trial: Trial, fields: Perturbed) -> Array:
    """Virtual power of the perturbed stress, less that of the forces, with the velocity held.

    One column for every harmonic of h, then one for every harmonic of c'.
    """
    k1, k2, e1, e2 = base.kappa_1, base.kappa_2, base.stretch_1, base.stretch_2
    h, h_s, H = fields.values, fields.slopes, k1 + k2
    wave_h = fields.wave * h
    D1 = base.shear * h_s + k1 * e1 * h
    D2 = k2 * e2 * h
    isotropic = p.eta_b * (D1 + D2 - 2 * (k1 * e1 + k2 * e2) * h)
    # sigma^11 = (eta_b Theta + tau) g^11 + 2 eta_s (g^11)^2 D_11, and g^11' = -2 kappa_1 h
    spherical_1 = base.sigma_1 - 2 * p.eta_s * e1
    spherical_2 = base.sigma_2 - 2 * p.eta_s * e2
    S1 = isotropic + 2 * p.eta_s * D1 + (-2 * k1 * (spherical_1 + 4 * p.eta_s * e1)) * h
    S2 = isotropic + 2 * p.eta_s * D2 + (-2 * k2 * (spherical_2 + 4 * p.eta_s * e2)) * h
    powers = [
        (trial.stretch_1, S1 + ((H + k1) * base.sigma_1) * h),
        (trial.stretch_2, S2 + ((H + k2) * base.sigma_2) * h),
        (trial.lean, base.sigma_1 * h_s),
        (trial.a, p.delta_P * h_s),
        (trial.w, (-p.delta_P * H) * h),
    ]
    if np.any(fields.wave):
        powers += [
            (trial.shear, (p.eta_s * base.shear) * wave_h),
            (trial.tilt, base.sigma_2 * wave_h),
            (trial.b, p.delta_P * wave_h),
        ]
    tests = np.concatenate([test for test, _ in powers])
    by_shape = tests.T @ np.concatenate([base.measure * field for _, field in powers])
    by_concentration = np.zeros_like(by_shape)
    if np.any(base.tau_slope):
        dilation = trial.stretch_1 + trial.stretch_2
        by_concentration = dilation.T @ ((base.measure * base.tau_slope) * h)
    if p.kappa:
        by_shape -= bending_load(p, base, trial, fields)
    if not p.has_friction:
        return np.hstack([by_shape, by_concentration])
    drag_by_shape, drag_by_concentration = drag_loads(p, base, trial, fields)
    return np.hstack([by_shape - drag_by_shape, by_concentration - drag_by_concentration])


def rates_of(
    p: Parameters, base: Base, fields: Perturbed, response: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Weak rates of h and c' for each perturbation, tested with every harmonic."""
    a, b, w = response
    f, f_s, wave = fields.values, fields.slopes, fields.wave
    k1, k2, c, U, W = base.kappa_1, base.kappa_2, base.c, base.U, base.W
    H = k1 + k2
    h_rate = w + np.hstack([-U * f_s, base.slope * f])
    flux_1 = c * a + np.hstack(
        [(c * W) * f_s + (c * U * k2 - p.D * base.c_s * (k2 - k1)) * f, U * f - p.D * f_s]
    )
    source = (-c * H) * h_rate + np.hstack([(p.beta * H * (p.c0 - c)) * f, -p.beta * f])
    if np.any(wave):
        flux_2 = c * b + np.hstack([(c * W * wave) * f, (-p.D * wave) * f])
        source += wave * flux_2
    tested = (base.measure * f).T @ np.hstack([h_rate, source])
    count = h_rate.shape[1]
    return tested[:, :count], (base.measure * f_s).T @ flux_1 + tested[:, count:]


def removed(
    beta: float,
    base: Base,
    basis: HarmonicBasis,
    mass: Array,
    rigid: list[tuple[Array, Array, Array]],
) -> Array:
    """Constraint functionals and neutral modes as columns of harmonic coefficients."""
    weighted = base.measure * basis.values
    none = np.zeros(basis.degrees.size)
    columns = []
    if basis.degrees[0] == 0:
        H = (base.kappa_1 + base.kappa_2)[:, 0]
        columns.append(np.concatenate([H @ weighted, none]))
        if beta == 0:
            columns.append(np.concatenate([(H * base.c[:, 0]) @ weighted, none + weighted.sum(0)]))
    for a, _, w in rigid:
        h, c = weighted.T @ w, -weighted.T @ (a * base.c_s)
        mode = np.concatenate([np.linalg.solve(mass, h)[:, 0], np.linalg.solve(mass, c)[:, 0]])
        if np.linalg.norm(mode) > ROTATION_SEEN:
            columns.append(mode / np.linalg.norm(mode))
    return np.column_stack(columns) if columns else np.zeros((2 * none.size, 0))
