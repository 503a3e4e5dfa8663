"""Perturbations exp(i m phi) of steady states: the rates of shape and concentration, in weak form.

See `stability` for the equations. Fields of several states at the nodes of a basis have the shape
(states, nodes, 1), what is made of harmonics one column for each of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.harmonics import HarmonicBasis
from amoeboid.axisymmetric.steady import SteadySolution, meridian_of
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
    """Steady states at the nodes of a basis; every entry has shape (states, nodes, 1).

    `scale` is ds/dx (states, 1, 1).
    """

    scale: Array
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

    @cached_property
    def H(self) -> Array:
        """kappa_1 + kappa_2."""
        return self.kappa_1 + self.kappa_2

    @cached_property
    def cot(self) -> Array:
        """cos(psi)/r."""
        return self.cos_psi / self.r


def base_fields(states: Sequence[SteadySolution], p: Any, basis: HarmonicBasis) -> Base:
    """The fields of steady states that the linearization needs, at the nodes of the basis.

    The states have the same number of modes; `p` holds their parameters, numbers where all agree,
    else arrays (states, 1, 1).
    """
    n, x = states[0].n, basis.x[:, None]
    unknowns = np.array([state.x for state in states])
    a_psi, a_u, a_c, scalars = (part[..., None] for part in split(unknowns, n))
    scale, zeta0, axial = (scalars[:, k, None] for k in range(3))
    waves = _waves(basis, 2 * n)
    sines, cosines, k = waves.sines, waves.cosines, waves.k[:, None]
    psi = x + sines[:, : n - 1] @ a_psi
    bent = k[: n - 1] * a_psi
    psi_slope = 1.0 + cosines[:, : n - 1] @ bent
    runs, rises, middle = meridian_of(unknowns, n)
    r = scale * (sines @ runs[..., None])
    z = scale * (cosines @ rises[..., None] - middle[:, None, None])
    u, c = sines[:, :n] @ a_u, a_c[:, :1] + cosines[:, : n - 1] @ a_c[:, 1:]
    u_s = cosines[:, :n] @ (k[:n] * a_u) / scale
    c_s = -sines[:, : n - 1] @ (k[: n - 1] * a_c[:, 1:]) / scale
    laws = [
        (*state.parameters.v_p_derivatives(at, 1), *state.parameters.tau_derivatives(at, 1))
        for state, at in zip(states, c, strict=True)
    ]
    speed, slope, tau, tau_slope = (np.array(values) for values in zip(*laws, strict=True))
    sin_psi, cos_psi = np.sin(psi), np.cos(psi)
    cot = cos_psi / r
    kappa_1, kappa_2 = psi_slope / scale, sin_psi / r
    stretch_1 = u_s - kappa_1 * speed
    stretch_2 = cot * u - kappa_2 * speed
    sigma_1, sigma_2 = principal_stresses(stretch_1, stretch_2, tau, zeta0, p)
    bends = (  # first and second derivative of kappa_1
        -sines[:, : n - 1] @ (k[: n - 1] * bent) / scale**2,
        -cosines[:, : n - 1] @ (k[: n - 1] ** 2 * bent) / scale**3,
    )
    return Base(
        scale, basis.weights[:, None] * scale * r / np.sin(x), r, z, sin_psi, cos_psi,
        kappa_1, kappa_2, u, -speed, stretch_1, stretch_2, -slope * c_s - kappa_1 * u,
        sigma_1, sigma_2, c, c_s, slope, tau_slope,
        0.0 * u - (axial / friction.unit(p) if p.has_friction else 0.0),
        *slopes_of_H(kappa_1, *bends, kappa_2, cot),
    )  # fmt: skip


def together(bases: Sequence[Base]) -> Base:
    """The states of several, at the nodes of the same basis, one after the other."""
    return Base(*map(np.concatenate, zip(*(vars(base).values() for base in bases), strict=True)))


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
class Tangents:
    """Velocities (a, i b) along the surface and the strain rates they make, one column each.

    `stretches` are the extension rates along the meridian, and below them those around the axis;
    i `shear` is twice the shear rate. `a` and `b` are the same about every state.
    """

    a: Array
    b: Array
    stretches: Array
    shear: Array


def tangents(base: Base, basis: HarmonicBasis) -> Tangents:
    """Gradients of the harmonics, and for m > 0 their rotations."""
    a, b = basis.tangents
    a_x, b_x = basis.tangent_slopes
    wave = int(basis.degrees[0]) / base.r
    nodes = a.shape[0]
    stretches = np.empty((base.r.shape[0], 2 * nodes, a.shape[1]))
    np.divide(a_x, base.scale, out=stretches[:, :nodes])
    np.subtract(base.cot * a, wave * b, out=stretches[:, nodes:])
    return Tangents(a, b, stretches, wave * a - base.cot * b + b_x / base.scale)


@dataclass(frozen=True)
class Normals:
    """The harmonics that velocities along the normal, h and c' are made of, one column each.

    `slopes` along the meridian, surface Laplacians `spreads`, and `wave` = m/r.
    """

    values: Array
    slopes: Array
    spreads: Array
    wave: Array

    @cached_property
    def around(self) -> Array:
        """The slopes around the axis, over i."""
        return self.wave * self.values


def normals(base: Base, basis: HarmonicBasis) -> Normals:
    """The harmonics at the nodes."""
    slopes, wave = basis.slopes / base.scale, basis.degrees[0] / base.r
    along = basis.curvatures / base.scale**2 + base.cot * slopes
    return Normals(basis.values, slopes, along - wave**2 * basis.values, wave)


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
    along: Tangents,
    across: Normals,
    rigid: list[tuple[Array, Array, Array]],
) -> tuple[Array, Array, Array]:
    """(a, b, w) at the nodes that each perturbation drives.

    Without net rigid motion; with friction relative to the surroundings of the unperturbed cell.
    One column for every harmonic of h, then one for every harmonic of c' if c' drives anything.
    """
    if p.has_friction:
        rigid = []  # none is free
    f, measure = across.values, base.measure
    tangential, count = along.a.shape[1], f.shape[1]
    free = tangential + count
    constrained = not np.any(across.wave)
    size = free + len(rigid) + constrained
    driving = 2 if constrained or p.has_friction or p.has_isotropic_stress else 1
    matrix = np.zeros((base.r.shape[0], size, size))
    right = np.zeros((base.r.shape[0], size, driving * count))
    _fill_stiffness(matrix[:, :free, :free], p, base, along, across)
    _fill_load(right[:, :free], p, base, along, across)
    borders = [
        (_turned(along.a) @ (measure * a) + _turned(along.b) @ (measure * b), f.T @ (measure * w))
        for a, b, w in rigid
    ]
    if constrained:  # the area is kept
        H = measure * base.H
        borders.append((np.zeros((*H.shape[:-2], tangential, 1)), f.T @ H))
        right[:, -1:, :count] = _turned(H * base.U) @ across.slopes
        right[:, -1:, count:] = -_turned(H * base.slope) @ f
    for k, border in enumerate(borders, free):
        matrix[:, :free, k : k + 1] = np.concatenate(border, axis=-2)
        matrix[:, k, :free] = matrix[:, :free, k]
    found = solve(matrix, right)
    tangential_part, normal_part = found[:, :tangential], found[:, tangential:free]
    return along.a @ tangential_part, along.b @ tangential_part, f @ normal_part


def _turned(matrix: Array) -> Array:
    """The transposed matrix, or matrices."""
    return matrix.swapaxes(-1, -2)


def _beside(parts: Sequence[Array]) -> Array:
    """One beside the other; those that are the same about every state are repeated."""
    most = max(parts, key=lambda part: part.ndim)
    count = sum(part.shape[-1] for part in parts)
    found = np.empty((*most.shape[:-1], count))
    column = 0
    for part in parts:
        found[..., column : column + part.shape[-1]] = part
        column += part.shape[-1]
    return found


def _fill_stiffness(found: Array, p: Any, base: Base, along: Tangents, across: Normals) -> None:
    """Dissipation of every pair of velocities: first those along the surface.

    The harmonics along the normal stretch the surface by kappa_1 and kappa_2, without shear.
    """
    m, k1, k2, f = base.measure, base.kappa_1, base.kappa_2, across.values
    count, nodes = along.a.shape[1], f.shape[0]
    first, second = along.stretches[:, :nodes], along.stretches[:, nodes:]
    # eta_b (e1 + e2)^2 + 2 eta_s (e1^2 + e2^2), and eta_s times the square of the shear
    rates = [(p.eta_b + p.eta_s, first + second), (p.eta_s, first - second)]
    if np.any(across.wave):
        rates.append((p.eta_s, along.shear))
    rooted = np.concatenate([np.sqrt(eta * m) * rate for eta, rate in rates], axis=-2)
    found[:, :count, :count] = _turned(rooted) @ rooted
    isotropic = p.eta_b * base.H
    weights = np.concatenate(
        [m * (isotropic + 2 * p.eta_s * k1), m * (isotropic + 2 * p.eta_s * k2)], axis=-2
    )
    found[:, :count, count:] = _turned(along.stretches) @ (weights * np.concatenate([f, f]))
    squares = weights[:, :nodes] * k1 + weights[:, nodes:] * k2
    found[:, count:, count:] = f.T @ (squares * f)
    if p.has_friction:
        tangential, normal = drag_stiffness(p, base, along, across)
        found[:, :count, :count] += tangential
        found[:, count:, count:] += normal
    found[:, count:, :count] = _turned(found[:, :count, count:])


def _fill_load(found: Array, p: Any, base: Base, along: Tangents, across: Normals) -> None:
    """Virtual power of the forces, less that of the perturbed stress, with the velocity held.

    One column for every harmonic of h, then one for every harmonic of c' if there are as many.
    """
    m, k1, k2, e1, e2 = base.measure, base.kappa_1, base.kappa_2, base.stretch_1, base.stretch_2
    h, h_s, around, turned = across.values, across.slopes, across.around, np.any(across.wave)
    tangential, count = along.a.shape[1], h.shape[1]
    # With sigma^11 = (eta_b Theta + tau) g^11 + 2 eta_s (g^11)^2 D_11, g^11' = -2 kappa_1 h,
    # D_11' = shear h_s + kappa_1 e1 h and the perturbed measure: what is tested with the stretches
    isotropic = p.eta_b * (k1 * e1 + k2 * e2)
    by_shape = (
        k2 * base.sigma_1 - isotropic - 2 * p.eta_s * k1 * e1,
        k1 * base.sigma_2 - isotropic - 2 * p.eta_s * k2 * e2,
    )
    by_slope = (p.eta_b + 2 * p.eta_s) * base.shear, p.eta_b * base.shear
    stretched = np.concatenate(
        [(m * of_h) * h + (m * of_s) * h_s for of_h, of_s in zip(by_shape, by_slope, strict=True)],
        axis=-2,
    )
    pushed_1 = m * (p.delta_P - k1 * base.sigma_1) * h_s
    in_plane = _turned(along.stretches) @ stretched + along.a.T @ pushed_1
    lifted = m * (k1 * by_shape[0] + k2 * by_shape[1] - p.delta_P * base.H) * h
    lifted += m * (k1 * by_slope[0] + k2 * by_slope[1]) * h_s
    if turned:
        pushed_2 = m * (p.delta_P - k2 * base.sigma_2) * around
        in_plane += along.b.T @ pushed_2 + _turned(along.shear) @ (
            m * p.eta_s * base.shear * around
        )
        lifted += m * base.sigma_2 * across.wave * around
    out = h.T @ lifted + _turned(h_s) @ (m * base.sigma_1 * h_s)
    found[:, :tangential, :count], found[:, tangential:, :count] = -in_plane, -out
    if p.has_isotropic_stress:
        contracted = (m * base.tau_slope) * h
        dilation = along.stretches[:, : h.shape[0]] + along.stretches[:, h.shape[0] :]
        found[:, :tangential, count:] = -_turned(dilation) @ contracted
        found[:, tangential:, count:] = -h.T @ (base.H * contracted)
    if np.any(p.kappa):
        tangential_part, normal_part = bending_load(p, base, along, across)
        found[:, :tangential, :count] += tangential_part
        found[:, tangential:, :count] += normal_part
    if p.has_friction:
        tangential_part, normal_part = drag_loads(p, base, along, across)
        found[:, :tangential] += tangential_part
        found[:, tangential:] += normal_part


def rates_of(
    p: Any, base: Base, fields: Normals, response: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Weak rates of h and c' for each perturbation, tested with every harmonic."""
    a, b, w = response
    f, f_s, wave = fields.values, fields.slopes, fields.wave
    k1, k2, c, U, W, H = base.kappa_1, base.kappa_2, base.c, base.U, base.W, base.H
    driven = w.shape[-1]
    h_rate = _beside([-U * f_s, base.slope * f])
    h_rate[..., :driven] += w
    along = (c * W) * f_s + (c * U * k2 - p.D * base.c_s * (k2 - k1)) * f
    flux_1 = _beside([along, U * f - p.D * f_s])
    flux_1[..., :driven] += c * a
    source = (-c * H) * h_rate
    source += _beside([(p.beta * H * (p.c0 - c)) * f, -p.beta * f])
    if np.any(wave):
        source += _beside([(c * W * wave**2) * f, (-p.D * wave**2) * f])
        source[..., :driven] += (c * wave) * b
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
        area, filaments = _turned(weighted) @ base.H, _turned(weighted) @ (base.H * base.c)
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
