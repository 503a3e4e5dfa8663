"""Perturbations exp(i m phi) of a steady state: the rates of shape and concentration, in weak form.

See `stability` for the equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.harmonics import HarmonicBasis
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.surroundings import (
    bending_load,
    drag_loads,
    drag_stiffness,
    slopes_of_H,
)
from amoeboid.axisymmetric.unknowns import split
from amoeboid.forces import friction
from amoeboid.model.stress import principal_stresses
from amoeboid.numerics.newton import solve

ROTATION_SEEN = 1e-6
"""A homogeneous sphere looks the same after a rotation: no mode is removed for it.

The size of the mode of rotation, in natural units, from which on it counts.
"""


@dataclass(frozen=True)
class Base:
    """The steady state at the nodes of a basis; every entry has shape (nodes, 1).

    Or several states, each entry (states, nodes, 1): everything here broadcasts.
    """

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
    x, waves = basis.x, _waves(basis, 2 * n)
    sines, cosines, k = waves.sines, waves.cosines, waves.k
    psi = x + sines[:, : n - 1] @ a_psi
    bent = k[: n - 1] * a_psi
    psi_slope = 1.0 + cosines[:, : n - 1] @ bent
    runs, rises, middle = state.meridian
    r, z = scale * (sines @ runs), scale * (cosines @ rises - middle)
    u, c = sines[:, :n] @ a_u, a_c[0] + cosines[:, : n - 1] @ a_c[1:]
    u_slope = cosines[:, :n] @ (k[:n] * a_u)
    c_slope = -sines[:, : n - 1] @ (k[: n - 1] * a_c[1:])
    speed, slope = p.v_p_derivatives(c, 1)
    sin_psi, cos_psi = np.sin(psi), np.cos(psi)
    cot = cos_psi / r
    kappa_1, kappa_2 = psi_slope / scale, sin_psi / r
    stretch_1 = u_slope / scale - kappa_1 * speed
    stretch_2 = cot * u - kappa_2 * speed
    tau, tau_slope = p.tau_derivatives(c, 1)
    sigma_1, sigma_2 = principal_stresses(stretch_1, stretch_2, tau, scalars[1], p)
    measure = basis.weights * scale * r / np.sin(x)
    bends = (  # first and second derivative of kappa_1
        -sines[:, : n - 1] @ (k[: n - 1] * bent) / scale**2,
        -cosines[:, : n - 1] @ (k[: n - 1] ** 2 * bent) / scale**3,
    )
    entries = (
        measure, r, z, sin_psi, cos_psi, kappa_1, kappa_2, u, -speed,
        stretch_1, stretch_2, -slope * c_slope / scale - kappa_1 * u,
        sigma_1, sigma_2, c, c_slope / scale, slope, tau_slope,
        np.full(x.size, -scalars[2] / friction.unit(p) if p.has_friction else 0.0),
        *slopes_of_H(kappa_1, *bends, kappa_2, cot),
    )  # fmt: skip
    return Base(*(e[:, None] for e in entries))


def together(bases: Sequence[Base]) -> Base:
    """Several states at the nodes of the same basis as one."""
    return Base(*map(np.array, zip(*(vars(base).values() for base in bases), strict=True)))


@dataclass(frozen=True)
class _Waves:
    """sin(k x) and cos(k x) at the nodes, k = 1..count, one column each."""

    k: Array
    sines: Array
    cosines: Array


@lru_cache(maxsize=64)
def _waves(basis: HarmonicBasis, count: int) -> _Waves:
    k = np.arange(1, count + 1)
    phases = np.outer(basis.x, k)
    return _Waves(k, np.sin(phases), np.cos(phases))


@dataclass(frozen=True)
class Trial:
    """Basis velocities (a, i b, w) and the strain rates they make, one column each.

    `stretch_1`, `stretch_2` are the extension rates, i `shear` twice the shear rate; `lean` is the
    n component of dv/ds, i `tilt` that of dv/(r dphi). Velocities are the same about every state.
    """

    a: Array
    b: Array
    w: Array
    stretch_1: Array
    stretch_2: Array
    shear: Array
    lean: Array
    tilt: Array


def trial_velocities(base: Base, basis: HarmonicBasis, scale: Any) -> Trial:
    """Gradients and rotations of the harmonics, and the harmonics along the normal."""
    a, b, w = basis.velocities
    a_s, b_s, w_s = (slope / scale for slope in basis.velocity_slopes)
    wave, cot = int(basis.degrees[0]) / base.r, base.cos_psi / base.r
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


def perturbed_fields(base: Base, basis: HarmonicBasis, scale: Any) -> Perturbed:
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
    p: Any,
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
    borders = [velocities.T @ _below([base.measure * v for v in motion]) for motion in rigid]
    load = _load(p, base, trial, fields)
    free, count = load.shape[-2:]
    constrained = not np.any(fields.wave)
    size = free + len(rigid) + constrained
    matrix = np.zeros((*load.shape[:-2], size, size))
    right = np.zeros((*load.shape[:-2], size, count))
    right[..., :free, :] = -load
    if constrained:
        H = base.measure * (base.kappa_1 + base.kappa_2)
        borders.append(trial.w.T @ H)
        change = _beside([-base.U * fields.slopes, base.slope * fields.values])
        right[..., -1:, :] = -_turned(H) @ change
    matrix[..., :free, :free] = _stiffness(p, base, trial)
    for k, border in enumerate(borders, free):
        matrix[..., :free, k : k + 1] = border
        matrix[..., k : k + 1, :free] = _turned(border)
    found = velocities @ solve(matrix, right)[..., :free, :]
    a, b, w = np.split(found, 3, axis=-2)
    return a, b, w


def _turned(matrix: Array) -> Array:
    """The transposed matrix, or matrices."""
    return matrix.swapaxes(-1, -2)


def _below(parts: Sequence[Array]) -> Array:
    """One below the other; those that are the same about every state are repeated."""
    most = max(parts, key=lambda part: part.ndim)
    count = sum(part.shape[-2] for part in parts)
    found = np.empty((*most.shape[:-2], count, most.shape[-1]))
    row = 0
    for part in parts:
        found[..., row : row + part.shape[-2], :] = part
        row += part.shape[-2]
    return found


def _beside(parts: Sequence[Array]) -> Array:
    """One beside the other, in the same way."""
    most = max(parts, key=lambda part: part.ndim)
    count = sum(part.shape[-1] for part in parts)
    found = np.empty((*most.shape[:-1], count))
    column = 0
    for part in parts:
        found[..., column : column + part.shape[-1]] = part
        column += part.shape[-1]
    return found


def _stiffness(p: Any, base: Base, trial: Trial) -> Array:
    """Dissipation of every pair of trial velocities."""
    rates = np.concatenate(
        [trial.stretch_1 + trial.stretch_2, trial.stretch_1, trial.stretch_2, trial.shear], axis=-2
    )
    viscosities = (p.eta_b, 2 * p.eta_s, 2 * p.eta_s, p.eta_s)
    found = _turned(rates) @ (_below([eta * base.measure for eta in viscosities]) * rates)
    if p.has_friction:
        found = found + drag_stiffness(p, base, trial)
    return np.asarray(found)


def _load(p: Any, base: Base, trial: Trial, fields: Perturbed) -> Array:
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
    tests = _below([test for test, _ in powers])
    by_shape = _turned(tests) @ _below([base.measure * field for _, field in powers])
    by_concentration = np.zeros_like(by_shape)
    if np.any(base.tau_slope):
        dilation = trial.stretch_1 + trial.stretch_2
        by_concentration = _turned(dilation) @ ((base.measure * base.tau_slope) * h)
    if np.any(p.kappa):
        by_shape = by_shape - bending_load(p, base, trial, fields)
    if p.has_friction:
        drag_by_shape, drag_by_concentration = drag_loads(p, base, trial, fields)
        by_shape = by_shape - drag_by_shape
        by_concentration = by_concentration - drag_by_concentration
    return np.concatenate([by_shape, by_concentration], axis=-1)


def rates_of(
    p: Any, base: Base, fields: Perturbed, response: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Weak rates of h and c' for each perturbation, tested with every harmonic."""
    a, b, w = response
    f, f_s, wave = fields.values, fields.slopes, fields.wave
    k1, k2, c, U, W = base.kappa_1, base.kappa_2, base.c, base.U, base.W
    H = k1 + k2
    h_rate = w + _beside([-U * f_s, base.slope * f])
    along = (c * W) * f_s + (c * U * k2 - p.D * base.c_s * (k2 - k1)) * f
    flux_1 = c * a + _beside([along, U * f - p.D * f_s])
    source = (-c * H) * h_rate + _beside([(p.beta * H * (p.c0 - c)) * f, -p.beta * f])
    if np.any(wave):
        flux_2 = c * b + _beside([(c * W * wave) * f, (-p.D * wave) * f])
        source += wave * flux_2
    tested = _turned(base.measure * f) @ np.concatenate([h_rate, source], axis=-1)
    count = h_rate.shape[-1]
    return tested[..., :count], _turned(base.measure * f_s) @ flux_1 + tested[..., count:]


def removed(
    conserved: bool,
    base: Base,
    basis: HarmonicBasis,
    mass: Array,
    rigid: list[tuple[Array, Array, Array]],
) -> tuple[Array, Array]:
    """Constraint functionals and neutral modes as columns of harmonic coefficients.

    (..., 2 harmonics, columns), and which of them count, (..., columns). `conserved`: whether the
    number of filaments is.
    """
    weighted = base.measure * basis.values
    columns = []
    if basis.degrees[0] == 0:
        H = base.kappa_1 + base.kappa_2
        area, filaments = _turned(weighted) @ H, _turned(weighted) @ (H * base.c)
        columns.append(np.concatenate([area, np.zeros_like(area)], axis=-2))
        if conserved:
            total = weighted.sum(-2)[..., None]
            columns.append(np.concatenate([filaments, total], axis=-2))
    counts = [np.ones(base.r.shape[:-2], dtype=bool) for _ in columns]
    for a, _, w in rigid:
        moved = np.concatenate([w, -a * base.c_s], axis=-1)
        modes = solve(mass, _turned(weighted) @ moved)
        mode = np.concatenate([modes[..., :1], modes[..., 1:]], axis=-2)
        size = np.sqrt(np.sum(mode * mode, axis=-2, keepdims=True))
        columns.append(mode / np.where(size > ROTATION_SEEN, size, 1.0))
        counts.append(size[..., 0, 0] > ROTATION_SEEN)
    if not columns:
        return np.zeros((*mass.shape[:-2], 2 * mass.shape[-1], 0)), np.ones(0, dtype=bool)
    return np.concatenate(columns, axis=-1), np.stack(counts, axis=-1)
