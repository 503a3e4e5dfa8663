"""Linear stability of a steady state to perturbations exp(i m phi) of shape and concentration.

The surface moves along its normal by h, the concentration changes by c', the cortex velocity by
(a, i b, w) along (t, e_phi, n). All equations are linearized in convected coordinates: with
X' = h n, X'_1 = h_s n + kappa_1 h t, X'_2 = i (m/r) h n + kappa_2 h e_phi, the strain rate is
D_ij = (X_i . v_j + X_j . v_i)/2 and the force balance in weak form is
integral of sqrt(g) sigma^ij X_j . y_i = integral of sqrt(g) (delta_P n + f) . y for all velocities
y, with the forces f of friction and bending (`surroundings`).
Translations and rotations are neutral; the spectrum is that of what is left.

h and c' enter one matrix and one complement, so both are computed in the natural units of the cell:
lengths in R0, concentrations in c0, rates in its fastest rate (`natural_units`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.force_balance import refuse_cue
from amoeboid.axisymmetric.harmonics import HarmonicBasis, harmonics
from amoeboid.axisymmetric.perturbations import (
    Base,
    base_fields,
    perturbed_fields,
    rates_of,
    removed,
    rigid_motions,
    trial_velocities,
    velocity_response,
)
from amoeboid.axisymmetric.steady import SteadySolution, homogeneous
from amoeboid.axisymmetric.unknowns import split
from amoeboid.closed_forms.linear import finite_pressure_rates
from amoeboid.model.natural_units import natural_units
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.newton import solve
from amoeboid.validation import InvalidInput

AZIMUTHAL_NUMBERS = (0, 1, 2, 3)
MAX_GROWING = 100
"""The highest degree up to which growing modes of the sphere are counted."""

NEUTRAL = 1e-7
"""Growth rates below this fraction of turnover, diffusion and treadmilling count as neutral."""

ROUNDING = 8 * float(np.finfo(float).eps)
"""Error of an eigenvalue in units of the fastest rate, which grows with delta_P."""


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
        trial = trial_velocities(base, basis, state.length_scale)
        perturbed = perturbed_fields(base, basis, state.length_scale)
        rigid = rigid_motions(base, m)
        response = velocity_response(state.parameters, base, trial, perturbed, rigid)
        h_rate, c_rate = rates_of(state.parameters, base, perturbed, response)
        mass = basis.values.T @ (base.measure * basis.values)
        matrix = np.vstack(np.split(solve(mass, np.hstack([h_rate, c_rate])), 2, axis=1))
        left_out = removed(state.parameters.beta, base, basis, mass, rigid)
        return matrix, left_out, basis


def linearization(state: SteadySolution, degree: int | None = None) -> Linearization:
    """The linear problem about a state, on harmonics up to `degree` or `degree_for` of the state.

    Raises InvalidInput if the state is not converged, or under a cue.
    """
    if not state.converged:
        raise InvalidInput("stability needs a converged steady state; this one has not converged")
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
