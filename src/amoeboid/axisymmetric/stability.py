"""Linear stability of a steady state to perturbations exp(i m phi) of shape and concentration.

The surface moves along its normal by h, the concentration changes by c', the cortex velocity by
(a, i b, w) along (t, e_phi, n). All equations are linearized in convected coordinates: with
X' = h n, X'_1 = h_s n + kappa_1 h t, X'_2 = i (m/r) h n + kappa_2 h e_phi, the strain rate is
D_ij = (X_i . v_j + X_j . v_i)/2 and the force balance in weak form is
integral of sqrt(g) sigma^ij X_j . y_i = integral of sqrt(g) (delta_P n + f) . y for all velocities
y, with the forces f of friction and bending (`surroundings`).
Translations and rotations are neutral; the spectrum is that of what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.harmonics import HarmonicBasis
from amoeboid.axisymmetric.linearization import (
    Linearization,
    complement,
    linearization,
    linearizations,
)
from amoeboid.axisymmetric.steady import SteadySolution, homogeneous
from amoeboid.model.parameters import Parameters

AZIMUTHAL_NUMBERS = (0, 1, 2, 3)

NEUTRAL = 1e-7
"""Growth rates below this fraction of turnover, diffusion and treadmilling count as neutral."""

SPACING, REACH, ALIKE, CLEAR = 8, 0.15, 0.5, 0.02
"""How far apart the states of a branch are that are looked at first; how much v_p0 and the fastest
rates of two may differ, relatively, and how far from zero, over `slow_rate`, these must be for no
rate to pass through zero between them."""

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


def spectrum(state: SteadySolution, m: int, degree: int | None = None) -> Spectrum:
    """Growth rates of perturbations exp(i m phi) about a converged steady state.

    Raises InvalidInput if the state is not converged.
    """
    about = linearization(state, degree)
    matrix, removed, basis = about.reduced_matrix(m)
    kept = complement(removed)
    rates, modes = np.linalg.eig(kept.T @ matrix @ kept)
    order = np.argsort(-rates.real, kind="stable")
    return Spectrum(m, about.units[0] * rates[order], kept @ modes[:, order], basis)


def growth_rates(state: SteadySolution, m: int, degree: int | None = None) -> Array:
    """The rates of `spectrum` alone, fastest first; cheaper."""
    return linearization(state, degree).growth_rates(m)[0]


def growth_rates_of(
    states: Sequence[SteadySolution], numbers: Sequence[int] = AZIMUTHAL_NUMBERS
) -> list[dict[int, Array]]:
    """The rates of each of several states for each azimuthal number; much cheaper than singly."""
    found: list[dict[int, Array]] = [{} for _ in states]
    for which, about in linearizations(states):
        for m in numbers:
            for k, rates in zip(which, about.growth_rates(m), strict=True):
                found[k][m] = rates
    return found


def unstable_modes(state: SteadySolution, degree: int | None = None) -> dict[int, int]:
    """Number of growing modes for m = 0, 1, 2, 3 (for m > 0 per sense of rotation)."""
    about = linearization(state, degree)
    return {m: _counts(about, m)[0] for m in AZIMUTHAL_NUMBERS}


def is_stable(state: SteadySolution) -> bool:
    """Whether every perturbation with m = 0, 1, 2, 3 decays."""
    return are_stable([state])[0]


def are_stable(states: Sequence[SteadySolution]) -> list[bool]:
    """The same of several states."""
    return [bool(np.all(rates <= 0.0)) for rates in fastest_rates(states)]


def fastest_rates(states: Sequence[SteadySolution]) -> Array:
    """The largest real part of a rate for m = 0, 1, 2, 3 (states, 4), over `slow_rate`.

    0 where it counts as neutral.
    """
    found = np.zeros((len(states), len(AZIMUTHAL_NUMBERS)))
    for which, about in linearizations(states):
        for column, m in enumerate(AZIMUTHAL_NUMBERS):
            for k, rates, unit, slow in zip(
                which, about.growth_rates(m), about.units, about.slow_rates, strict=True
            ):
                fastest = float(rates[0].real) / unit
                if abs(fastest) > neutral_rate(rates / unit, slow):
                    found[k, column] = fastest / slow
    return found


def are_stable_along(states: Sequence[SteadySolution]) -> list[bool]:
    """Whether states are stable that follow one another on a branch in v_p0, no fold between them.

    Rates are continuous along a branch. So the states between two others are not looked at where
    v_p0 of those two differs by no more than REACH times the larger one, and where, for every m,
    their fastest rates are away from zero, on the same side, and differ by no more than ALIKE times
    the smaller one. Until that holds, the state in the middle is looked at.
    """
    known: dict[int, Array] = {}
    wanted = [*range(0, len(states), SPACING), len(states) - 1] if states else []
    speeds = [state.parameters.v_p0 for state in states]
    while wanted:
        wanted = sorted(set(wanted))
        known |= zip(wanted, fastest_rates([states[k] for k in wanted]), strict=True)
        apart = [
            (a, b)
            for a, b in pairwise(sorted(known))
            if not (_close(speeds[a], speeds[b]) and _alike(known[a], known[b]))
        ]
        wanted = [(a + b) // 2 for a, b in apart if b > a + 1]
    places = np.array(sorted(known))
    before = places[np.searchsorted(places, np.arange(len(states)), side="right") - 1]
    return [bool(np.all(known[int(k)] <= 0.0)) for k in before]


def _close(a: float, b: float) -> bool:
    return abs(a - b) <= REACH * max(abs(a), abs(b))


def _alike(a: Array, b: Array) -> bool:
    """Whether no rate can have passed through zero between two states next to each other."""
    smaller = np.minimum(np.abs(a), np.abs(b))
    return bool(np.all((smaller > CLEAR) & (np.abs(a - b) <= ALIKE * smaller)))


def _counts(about: Linearization, m: int) -> list[int]:
    rates = zip(about.growth_rates(m), about.units, about.slow_rates, strict=True)
    return [count_unstable(found / unit, slow) for found, unit, slow in rates]


def count_unstable(rates: Array, slow: float) -> int:
    """How many growth rates are positive beyond `neutral_rate`."""
    return int(np.sum(rates.real > neutral_rate(rates, slow)))


def neutral_rate(rates: Array, slow: float) -> float:
    """The size up to which a rate is taken for zero [1/time], with `slow` that of `slow_rate`.

    A fraction of the rates of polarization, which do not grow with delta_P as those of the shape
    do, plus the rounding of the eigenvalues.
    """
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


def reduced_matrix(
    state: SteadySolution, m: int, degree: int
) -> tuple[Array, Array, HarmonicBasis]:
    """(A, removed, basis): A is the rate of (h, c'); `removed` spans what the spectrum leaves out.

    Both in the natural units of the cell.

    That is the constraint of fixed area and, at beta = 0, of the filament number (m = 0), and the
    neutral translation (m = 0, 1) and rotation (m = 1).
    """
    return linearization(state, degree).reduced_matrix(m)
