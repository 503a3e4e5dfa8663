"""Linear stability of a steady state to perturbations exp(i m phi) of shape and concentration.

The surface moves along its normal by h, the concentration changes by c', the cortex velocity by
(a, i b, w) along (t, e_phi, n). All equations are linearized in convected coordinates: with
X' = h n, X'_1 = h_s n + kappa_1 h t, X'_2 = i (m/r) h n + kappa_2 h e_phi, the strain rate is
D_ij = (X_i . v_j + X_j . v_i)/2 and the force balance in weak form is
integral of sqrt(g) sigma^ij X_j . y_i = integral of sqrt(g) (delta_P n + f) . y for all velocities
y, with the forces f of friction and bending.
Translations and rotations are neutral; the spectrum is that of what is left.

h and c' enter one matrix and one complement, so both are computed in the natural units of the cell:
lengths in R0, concentrations in c0, rates in its fastest rate (`natural_units`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.force_balance import refuse_cue
from amoeboid.axisymmetric.harmonics import HarmonicBasis, harmonics
from amoeboid.axisymmetric.spectral import even_basis, odd_basis
from amoeboid.axisymmetric.steady import SteadySolution, homogeneous
from amoeboid.axisymmetric.unknowns import split
from amoeboid.closed_forms.linear import finite_pressure_rates
from amoeboid.forces import friction
from amoeboid.model.natural_units import natural_units
from amoeboid.model.parameters import Parameters
from amoeboid.model.stress import principal_stresses
from amoeboid.numerics.newton import solve
from amoeboid.validation import InvalidInput

AZIMUTHAL_NUMBERS = (0, 1, 2, 3)
MAX_GROWING = 100
"""The highest degree up to which growing modes of the sphere are counted."""

NEUTRAL = 1e-7
"""Growth rates below this fraction of turnover, diffusion and treadmilling count as neutral."""

ROUNDING = 8 * float(np.finfo(float).eps)
"""Error of an eigenvalue in units of the fastest rate, which grows with delta_P."""


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
    H_s: Array
    H_ss: Array
    cell_velocity: Array


@dataclass(frozen=True)
class Spectrum:
    """Growth rates [1/time] for one azimuthal number, fastest first, rigid motions left out.

    `modes` holds one column each: harmonic coefficients of h/R0, then of c'/c0 (`natural_units`).
    """

    m: int
    rates: Array
    modes: Array
    basis: HarmonicBasis


def degree_for(state: SteadySolution) -> int:
    """Degree of harmonics that resolves what the state's own series does, and what grows.

    That is as far as the modes of the sphere tell, and up to MAX_GROWING.
    """
    psi, u, c, _ = split(state.x, state.n)
    last = 0
    for series in (c, u, np.concatenate([[1.0], psi])):
        large = np.nonzero(np.abs(series) > 1e-7 * np.abs(series).max())[0]
        last = max(last, int(large[-1]) if large.size else 0)
    resolved = min(max(12, last + 4), max(state.n, 12))
    return max(resolved, highest_growing(state.parameters) + 4)


def highest_growing(p: Parameters) -> int:
    """The highest mode l >= 2 of the homogeneous sphere that grows, up to MAX_GROWING, or 0."""
    l = np.arange(2, MAX_GROWING + 1)  # noqa: E741
    with np.errstate(all="ignore"):  # what is not finite is rejected
        growing = l[finite_pressure_rates(p, l)[:, 0].real > 0]
    return int(growing[-1]) if growing.size else 0


def spectrum(state: SteadySolution, m: int, degree: int | None = None) -> Spectrum:
    """Growth rates of perturbations exp(i m phi) about a converged steady state.

    Raises InvalidInput if the state is not converged.
    """
    about = linearization(state, degree)
    matrix, removed, basis = about.reduced_matrix(m)
    complement = _complement(removed)
    rates, modes = np.linalg.eig(complement.T @ matrix @ complement)
    order = np.argsort(-rates.real, kind="stable")
    return Spectrum(m, about.unit * rates[order], complement @ modes[:, order], basis)


def growth_rates(state: SteadySolution, m: int, degree: int | None = None) -> Array:
    """The rates of `spectrum` alone, fastest first; cheaper."""
    return linearization(state, degree).growth_rates(m)


def _complement(removed: Array) -> Array:
    """Orthonormal columns that span all that is orthogonal to the columns of `removed`."""
    return np.linalg.qr(removed, mode="complete")[0][:, removed.shape[1] :]


def unstable_modes(state: SteadySolution, degree: int | None = None) -> dict[int, int]:
    """Number of growing modes for m = 0, 1, 2, 3 (for m > 0 per sense of rotation)."""
    about = linearization(state, degree)
    return {m: about.unstable(m) for m in AZIMUTHAL_NUMBERS}


def is_stable(state: SteadySolution) -> bool:
    """Whether every perturbation with m = 0, 1, 2, 3 decays; stops at the first that grows."""
    about = linearization(state)
    return not any(about.unstable(m) for m in AZIMUTHAL_NUMBERS)


def count_unstable(rates: Array, p: Parameters) -> int:
    """How many growth rates are positive beyond `neutral_rate`."""
    return int(np.sum(rates.real > neutral_rate(rates, p)))


def neutral_rate(rates: Array, p: Parameters) -> float:
    """The size up to which a rate is taken for zero [1/time].

    A fraction of the rates of polarization, which do not grow with delta_P as those of the shape
    do, plus the rounding of the eigenvalues.
    """
    slow = p.beta + p.D / p.R0**2 + abs(float(p.v_p(p.c0))) / p.R0
    return NEUTRAL * slow + ROUNDING * float(np.abs(rates).max())


def sphere_block(p: Parameters, l: int) -> Array:  # noqa: E741
    """Rates of (rho_l, c_l/c0) on the homogeneous sphere, from the linearization of this module.

    In units of the fastest rate of the cell (`natural_units`). Shape (2, 2) for l >= 2 and (1, 1),
    c alone, for l = 0 and 1, whose h is no deformation.
    """
    matrix, _, basis = reduced_matrix(homogeneous(p, 4), 0, max(l, 2))
    count = basis.degrees.size
    kept = [l, count + l] if l >= 2 else [count + l]
    return matrix[np.ix_(kept, kept)]


@dataclass(frozen=True, eq=False)
class Linearization:
    """The linear problem about a steady state, and what all azimuthal numbers have in common.

    `state` is measured in the natural units of the cell, `unit` is their rate [1/time].
    """

    state: SteadySolution
    degree: int
    unit: float

    @cached_property
    def base(self) -> Base:
        """The fields of the state; the nodes are the same for every m."""
        return base_fields(self.state, self.basis(0))

    def basis(self, m: int) -> HarmonicBasis:
        """The harmonics of azimuthal number m."""
        return harmonics(m, self.degree, (3 * self.degree) // 2 + 4)

    def growth_rates(self, m: int) -> Array:
        """Growth rates of perturbations exp(i m phi), fastest first [1/time]."""
        matrix, removed, _ = self.reduced_matrix(m)
        complement = _complement(removed)
        rates = np.linalg.eigvals(complement.T @ matrix @ complement)
        return self.unit * rates[np.argsort(-rates.real, kind="stable")]

    def unstable(self, m: int) -> int:
        """Number of growing modes of azimuthal number m."""
        return count_unstable(self.growth_rates(m) / self.unit, self.state.parameters)

    def reduced_matrix(self, m: int) -> tuple[Array, Array, HarmonicBasis]:
        """See the function of this name."""
        state, basis, base = self.state, self.basis(m), self.base
        trial = _trial_velocities(base, basis, state.length_scale)
        perturbed = _perturbed_fields(base, basis, state.length_scale)
        rigid = _rigid_motions(base, m)
        response = _velocity_response(state.parameters, base, trial, perturbed, rigid)
        h_rate, c_rate = _rates(state.parameters, base, perturbed, response)
        mass = basis.values.T @ (base.measure * basis.values)
        matrix = np.vstack(np.split(solve(mass, np.hstack([h_rate, c_rate])), 2, axis=1))
        removed = _removed(state.parameters.beta, base, basis, mass, rigid)
        return matrix, removed, basis


def linearization(state: SteadySolution, degree: int | None = None) -> Linearization:
    """The linear problem about a state, on harmonics up to `degree` or `degree_for` of the state.

    Raises InvalidInput if the state is not converged, or under a cue.
    """
    if not state.converged:
        raise InvalidInput("stability needs a converged steady state; this one is not")
    refuse_cue(state.cue, "the spectrum of a steady state")
    units = natural_units(state.parameters)
    return Linearization(state.in_units(units), degree or degree_for(state), units.of("1/T"))


def reduced_matrix(
    state: SteadySolution, m: int, degree: int
) -> tuple[Array, Array, HarmonicBasis]:
    """(A, removed, basis): A is the rate of (h, c'); `removed` spans what the spectrum leaves out.

    Both in the natural units of the cell.

    That is the constraint of fixed area and, at beta = 0, of the filament number (m = 0), and the
    neutral translation (m = 0, 1) and rotation (m = 1).
    """
    return linearization(state, degree).reduced_matrix(m)


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
        sigma_1, sigma_2, c, c_slope / scale, slope, tau_slope, *_slopes_of_H(state, x, psi, r),
        np.full(x.size, -scalars[2] / friction.unit(p) if p.has_friction else 0.0),
    )  # fmt: skip
    return Base(*(e[:, None] for e in entries))


def _slopes_of_H(state: SteadySolution, x: Array, psi: Array, r: Array) -> tuple[Array, Array]:
    """First and second derivative of H = kappa_1 + kappa_2 along the meridian."""
    n, scale = state.n, state.length_scale
    a_psi = split(state.x, n)[0]
    k = np.arange(1, n)
    sines, cosines = np.sin(np.outer(x, k)), np.cos(np.outer(x, k))
    kappa_1, kappa_2 = (1.0 + (cosines * k) @ a_psi) / scale, np.sin(psi) / r
    kappa_1_s, kappa_1_ss = -(sines * k**2) @ a_psi / scale**2, -(cosines * k**3) @ a_psi / scale**3
    cot = np.cos(psi) / r
    kappa_2_s = cot * (kappa_1 - kappa_2)
    kappa_2_ss = cot * (kappa_1_s - kappa_2_s) - (kappa_1 * kappa_2 + cot**2) * (kappa_1 - kappa_2)
    return kappa_1_s + kappa_2_s, kappa_1_ss + kappa_2_ss


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
    w_spread: Array


def _trial_velocities(base: Base, basis: HarmonicBasis, scale: float) -> Trial:
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
        w_spread=np.hstack([w[:, : -P.shape[1]] * 0.0, _laplacian(base, basis, scale)]),
    )


def _laplacian(base: Base, basis: HarmonicBasis, scale: float) -> Array:
    """Surface Laplacian of every harmonic."""
    cot, wave = base.cos_psi / base.r, basis.degrees[0] / base.r
    along = basis.curvatures / scale**2 + cot * basis.slopes / scale
    return np.asarray(along - wave**2 * basis.values)


@dataclass(frozen=True)
class Perturbed:
    """Displacement h, its slope and Laplacian, c' and its slope, one column an unknown; and m/r."""

    h: Array
    h_s: Array
    h_spread: Array
    c: Array
    c_s: Array
    wave: Array


def _perturbed_fields(base: Base, basis: HarmonicBasis, scale: float) -> Perturbed:
    none = np.zeros_like(basis.values)
    slopes = basis.slopes / scale
    return Perturbed(
        h=np.hstack([basis.values, none]),
        h_s=np.hstack([slopes, none]),
        h_spread=np.hstack([_laplacian(base, basis, scale), none]),
        c=np.hstack([none, basis.values]),
        c_s=np.hstack([none, slopes]),
        wave=basis.degrees[0] / base.r,
    )


def _rigid_motions(base: Base, m: int) -> list[tuple[Array, Array, Array]]:
    """(a, b, w) of the rigid velocities with azimuthal number m: e_z; e_x + i e_y, rotation."""
    sin, cos, r, z = base.sin_psi, base.cos_psi, base.r, base.z
    if m == 0:
        return [(-sin, 0 * r, cos)]
    if m == 1:
        return [(cos, 1 + 0 * r, sin), (z * cos + r * sin, z, z * sin - r * cos)]
    return []


def _velocity_response(
    p: Parameters,
    base: Base,
    trial: Trial,
    fields: Perturbed,
    rigid: list[tuple[Array, Array, Array]],
) -> tuple[Array, Array, Array]:
    """(a, b, w) at the nodes that each perturbation drives.

    Without net rigid motion; with friction relative to the surroundings.
    """

    def integral(test: Array, field: Array) -> Array:
        return test.T @ (base.measure * field)

    dilation = trial.stretch_1 + trial.stretch_2
    stiffness = (
        p.eta_b * integral(dilation, dilation)
        + 2 * p.eta_s * integral(trial.stretch_1, trial.stretch_1)
        + 2 * p.eta_s * integral(trial.stretch_2, trial.stretch_2)
        + p.eta_s * integral(trial.shear, trial.shear)
    )
    load = _load(p, base, trial, fields, integral)
    if p.has_friction:
        m = friction.density(base.c, p)
        along, across = m * (p.gamma_t + p.gamma_c), m * (p.gamma_n + p.gamma_c)
        stiffness += integral(trial.a, along * trial.a) + integral(trial.b, along * trial.b)
        stiffness += integral(trial.w, across * trial.w)
        load -= _drag_load(p, base, trial, fields, integral)
        rigid = []  # nothing is free
    if p.kappa:
        load -= _bending_load(p, base, trial, fields, integral)
    borders = [
        integral(trial.a, a) + integral(trial.b, b) + integral(trial.w, w) for a, b, w in rigid
    ]
    right = [np.zeros((1, load.shape[1]))] * len(rigid)
    if not np.any(fields.wave):
        H = base.kappa_1 + base.kappa_2
        borders.append(integral(trial.w, H))
        right.append(-integral(H, base.slope * fields.c - base.U * fields.h_s))
    border = np.hstack([np.zeros((stiffness.shape[0], 0)), *borders])
    k = border.shape[1]
    matrix = np.block([[stiffness, border], [border.T, np.zeros((k, k))]])
    v = solve(matrix, np.vstack([-load, *right]))[: stiffness.shape[0]]
    return trial.a @ v, trial.b @ v, trial.w @ v


def _drag_load(p: Parameters, base: Base, trial: Trial, fields: Perturbed, integral: Any) -> Array:
    """Virtual power of the perturbed drag with the velocity of the cortex held."""
    m, slope = friction.density(base.c, p), p.gamma_share / (p.c0 or p.c_r)
    tangent = base.U - base.sin_psi * base.cell_velocity
    v_n = base.cos_psi * base.cell_velocity
    cortex_n = base.W + v_n
    along, across = friction.drag(tangent, v_n, cortex_n, base.c, p)
    H, v_p, v_p_change = base.kappa_1 + base.kappa_2, -base.W, base.slope * fields.c
    # the normal leans by -h_s and -wave h; v_p and the drag along the normal follow it
    leaning = m * (p.gamma_t * v_p + (p.gamma_n - p.gamma_t) * v_n)
    thicker = slope * fields.c / m
    normal = across * thicker - m * p.gamma_n * v_p_change
    normal = normal + m * (p.gamma_n - p.gamma_t) * tangent * fields.h_s
    return (
        integral(trial.a, along * (H * fields.h + thicker) + leaning * fields.h_s)
        + integral(trial.b, leaning * fields.wave * fields.h)
        + integral(trial.w, across * H * fields.h + normal)
    )


def _bending_load(
    p: Parameters, base: Base, trial: Trial, fields: Perturbed, integral: Any
) -> Array:
    """Virtual power of the perturbed force of bending, kappa [lap_s H + H (H^2/2 - 2 K)] n."""
    k1, k2, cot, h, h_s = base.kappa_1, base.kappa_2, base.cos_psi / base.r, fields.h, fields.h_s
    H, K, H_s = k1 + k2, k1 * k2, base.H_s
    bent = H * (k1 - k2) ** 2 / 2
    force = base.H_ss + cot * H_s + bent
    H_change = -fields.h_spread - (k1**2 + k2**2) * h
    h_22 = cot * h_s - fields.wave**2 * h
    K_change = -(H * K * h + k2 * (fields.h_spread - h_22) + k1 * h_22)
    carried = (H - 2 * k1) * h_s * H_s - h * H_s**2
    carried = carried - 2 * h * (k1 * base.H_ss + k2 * cot * H_s)
    change = carried + (H**2 / 2 - 2 * K) * H_change + H * (H * H_change - 2 * K_change)
    return p.kappa * (
        integral(trial.w_spread, H_change)
        + integral(trial.w, change + force * H * h)
        - integral(trial.a, force * h_s)
        - integral(trial.b, force * fields.wave * h)
    )


def _load(p: Parameters, base: Base, trial: Trial, fields: Perturbed, integral: Any) -> Array:
    """Virtual power of the perturbed stress and pressure with the velocity held."""
    k1, k2, e1, e2 = base.kappa_1, base.kappa_2, base.stretch_1, base.stretch_2
    h, wave_h, H = fields.h, fields.wave * fields.h, k1 + k2
    D1 = base.shear * fields.h_s + k1 * e1 * h
    D2 = k2 * e2 * h
    dilation = D1 + D2 - 2 * (k1 * e1 + k2 * e2) * h
    isotropic = p.eta_b * dilation + base.tau_slope * fields.c
    # sigma^11 = (eta_b Theta + tau) g^11 + 2 eta_s (g^11)^2 D_11, and g^11' = -2 kappa_1 h
    spherical_1 = base.sigma_1 - 2 * p.eta_s * e1
    spherical_2 = base.sigma_2 - 2 * p.eta_s * e2
    S1 = isotropic - 2 * k1 * spherical_1 * h + 2 * p.eta_s * (D1 - 4 * k1 * e1 * h)
    S2 = isotropic - 2 * k2 * spherical_2 * h + 2 * p.eta_s * (D2 - 4 * k2 * e2 * h)
    pressure = p.delta_P
    return (
        integral(trial.stretch_1, S1 + (H + k1) * base.sigma_1 * h)
        + integral(trial.stretch_2, S2 + (H + k2) * base.sigma_2 * h)
        + integral(trial.shear, p.eta_s * base.shear * wave_h)
        + integral(trial.lean, base.sigma_1 * fields.h_s)
        + integral(trial.tilt, base.sigma_2 * wave_h)
        + pressure * integral(trial.a, fields.h_s)
        + pressure * integral(trial.b, wave_h)
        - pressure * integral(trial.w, H * h)
    )


def _rates(
    p: Parameters, base: Base, fields: Perturbed, response: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Weak rates of h and c', tested with every harmonic."""
    a, b, w = response
    half = fields.h.shape[1] // 2
    test, test_s = fields.h[:, :half], fields.h_s[:, :half]
    k1, k2, c, h = base.kappa_1, base.kappa_2, base.c, fields.h
    H = k1 + k2
    h_rate = w - base.U * fields.h_s + base.slope * fields.c
    flux_1 = (
        base.U * fields.c
        + c * (a + base.W * fields.h_s - k1 * base.U * h)
        + H * c * base.U * h
        - p.D * (fields.c_s + (k2 - k1) * base.c_s * h)
    )
    flux_2 = c * (b + base.W * fields.wave * h) - p.D * fields.wave * fields.c
    source = p.beta * (H * (p.c0 - c) * h - fields.c) - c * H * h_rate
    c_rate = test_s.T @ (base.measure * flux_1) + test.T @ (
        base.measure * (fields.wave * flux_2 + source)
    )
    return test.T @ (base.measure * h_rate), c_rate


def _removed(
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
