"""The linear problem about steady states, several of them at once; see `stability` for equations.

At these sizes most of the time goes into calls of NumPy, not into arithmetic. States with the same
number of harmonics therefore go through every call together. Each has the same bits alone.

h and c' enter one matrix and one complement, so both are computed in the natural units of the cell:
lengths in R0, concentrations in c0, rates in its fastest rate (`natural_units`).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.force_balance import refuse_cue
from amoeboid.axisymmetric.harmonics import HarmonicBasis, harmonics
from amoeboid.axisymmetric.perturbations import (
    Base,
    base_fields,
    normals,
    rates_of,
    removed,
    rigid_motions,
    tangents,
    together,
    velocity_response,
)
from amoeboid.axisymmetric.steady import SteadySolution, unknowns_in_units
from amoeboid.axisymmetric.unknowns import split
from amoeboid.closed_forms.linear import finite_pressure_matrix
from amoeboid.closed_forms.points import points
from amoeboid.model.natural_units import natural_units, point_in_units
from amoeboid.model.parameters import DIMENSIONS, ParameterPoint, Parameters
from amoeboid.numerics.newton import solve
from amoeboid.validation import InvalidInput

MAX_GROWING = 100
"""The highest degree up to which growing modes of the sphere are counted."""

MAX_TOGETHER = 32
"""States that go through one call together: more gain nothing and need more memory."""


MULTIPLE = 2
"""Degrees are multiples of this, so that more states of a branch share one."""


@dataclass(frozen=True, eq=False)
class Linearization:
    """The linear problem about states on the same harmonics.

    `states` are measured in the natural units of their cells, `units` (states,) are the rates of
    these [1/time].
    """

    states: tuple[SteadySolution, ...]
    degree: int
    units: Array

    @cached_property
    def base(self) -> Base:
        """The fields of the states; the nodes are the same for every m."""
        alike = [list(some) for _, some in groupby(self.states, key=lambda state: state.n)]
        return together([base_fields(some, _joint(some), self.basis(0)) for some in alike])

    @cached_property
    def parameters(self) -> ParameterPoint:
        """Those of the states: numbers where all agree, else arrays (states, 1, 1)."""
        return _joint(self.states)

    @cached_property
    def slow_rates(self) -> list[float]:
        """`slow_rate` of the states, in their units."""
        return [slow_rate(state.parameters) for state in self.states]

    def basis(self, m: int) -> HarmonicBasis:
        """The harmonics of azimuthal number m."""
        return harmonics(m, self.degree, (3 * self.degree) // 2 + 4)

    def growth_rates(self, m: int) -> list[Array]:
        """Growth rates of perturbations exp(i m phi) of each state, fastest first [1/time]."""
        matrices, left_out, counts = self._matrices(m)
        found: list[Array] = [np.zeros(0)] * len(self.states)
        alike_by_pattern: dict[tuple[bool, ...], list[int]] = {}
        for k, pattern in enumerate(counts.tolist()):
            alike_by_pattern.setdefault(tuple(pattern), []).append(k)
        for pattern, alike in alike_by_pattern.items():
            reduced = matrices[alike]
            if any(pattern):
                kept = complement(left_out[alike][..., np.array(pattern)])
                reduced = kept.swapaxes(-1, -2) @ reduced @ kept
            of_these = np.linalg.eigvals(reduced)
            for k, rates in zip(alike, of_these, strict=True):
                rates = rates if np.any(rates.imag) else rates.real
                found[k] = self.units[k] * rates[np.argsort(-rates.real, kind="stable")]
        return found

    def reduced_matrix(self, m: int, k: int = 0) -> tuple[Array, Array, HarmonicBasis]:
        """`stability.reduced_matrix` of state k."""
        matrices, left_out, counts = self._matrices(m)
        return matrices[k], left_out[k][:, counts[k]], self.basis(m)

    def _matrices(self, m: int) -> tuple[Array, Array, Array]:
        """The rate of (h, c') of each state, and what `removed` says."""
        basis, base, p = self.basis(m), self.base, self.parameters
        along, across, rigid = tangents(base, basis), normals(base, basis), rigid_motions(base, m)
        response = velocity_response(p, base, along, across, rigid)
        rates = rates_of(p, base, across, response)
        mass = basis.values.T @ (base.measure * basis.values)
        halves = np.split(solve(mass, np.concatenate(rates, axis=-1)), 2, axis=-1)
        conserved = self.states[0].parameters.beta == 0
        left_out, counts = removed(conserved, base, basis, mass, rigid)
        counts = np.broadcast_to(counts, (len(self.states), counts.shape[-1]))
        return np.concatenate(halves, axis=-2), left_out, counts


def slow_rate(p: Any) -> float:
    """The rates of turnover, diffusion and treadmilling together [1/time]."""
    return float(p.beta + p.D / p.R0**2 + abs(float(p.v_p(p.c0))) / p.R0)


class _Together(ParameterPoint):
    """Parameters of several cells that all have friction, or an isotropic stress, or have none."""

    def __init__(self, values: Mapping[str, Any], friction: bool, isotropic_stress: bool) -> None:
        super().__init__(values)
        self._has = friction, isotropic_stress

    @property
    def has_friction(self) -> bool:
        """See Material.has_friction."""
        return self._has[0]

    @property
    def has_isotropic_stress(self) -> bool:
        """See Material.has_isotropic_stress."""
        return self._has[1]


def _joint(states: Sequence[SteadySolution]) -> _Together:
    cells = [state.parameters for state in states]
    values = {name: _column([getattr(p, name) for p in cells]) for name in DIMENSIONS}
    return _Together(values, cells[0].has_friction, cells[0].has_isotropic_stress)


def _column(values: Sequence[float]) -> Any:
    if all(value == values[0] for value in values):
        return values[0]
    return np.array(values)[:, None, None]


def complement(removed: Array) -> Array:
    """Orthonormal columns that span all that is orthogonal to the columns of `removed`."""
    return np.linalg.qr(removed, mode="complete")[0][..., removed.shape[-1] :]


def linearization(state: SteadySolution, degree: int | None = None) -> Linearization:
    """The linear problem about a state, on harmonics up to `degree` or `degree_for` of the state.

    Raises InvalidInput if the state is not converged, or under a cue.
    """
    [(_, found)] = linearizations([state], degree)
    return found


def linearizations(
    states: Sequence[SteadySolution], degree: int | None = None
) -> list[tuple[list[int], Linearization]]:
    """The linear problems about states, and which of the states each is about.

    Raises InvalidInput if a state is not converged, or under a cue.
    """
    for state in states:
        if not state.converged:
            raise InvalidInput(
                "stability needs a converged steady state; this one has not converged"
            )
        refuse_cue(state.cue, "the spectrum of a steady state")
    degrees = [degree] * len(states) if degree else degrees_for(states)
    units = [natural_units(state.parameters) for state in states]
    natural = [
        replace(
            state,
            parameters=point_in_units(state.parameters, own),  # type: ignore[arg-type]
            x=unknowns_in_units(state.x, state.n, own),
        )
        for state, own in zip(states, units, strict=True)
    ]
    alike: dict[Hashable, list[int]] = {}
    for k, state in enumerate(natural):
        alike.setdefault((degrees[k], *_terms(state.parameters)), []).append(k)
    return [
        (
            chunk,
            Linearization(
                tuple(natural[k] for k in chunk),
                degrees[chunk[0]],
                np.array([units[k].of("1/T") for k in chunk]),
            ),
        )
        for group in alike.values()
        for chunk in (group[i : i + MAX_TOGETHER] for i in range(0, len(group), MAX_TOGETHER))
    ]


def _terms(p: Any) -> tuple[Hashable, ...]:
    """What decides which terms the linear problem of a cell has."""
    none = p.beta == 0, p.kappa == 0
    return *none, p.has_friction, p.has_isotropic_stress, p.gamma_share, p.c0


def degree_for(state: SteadySolution) -> int:
    """Degree of harmonics that resolves what the state's own series does, and what grows.

    That is as far as the modes of the sphere tell, and up to MAX_GROWING.
    """
    return degrees_for([state])[0]


def degrees_for(states: Sequence[SteadySolution]) -> list[int]:
    """`degree_for` of several states."""
    growing = highest_growing_of([state.parameters for state in states])
    return [max(_resolving(s), high + 4) for s, high in zip(states, growing, strict=True)]


def _resolving(state: SteadySolution) -> int:
    psi, u, c, _ = split(state.x, state.n)
    last = 0
    for first, series in ((0, c), (0, u), (1, psi)):
        sizes = np.abs(series)
        large = np.nonzero(sizes > 1e-7 * max(sizes.max(), float(first)))[0]
        last = max(last, int(large[-1]) + first if large.size else 0)
    enough = MULTIPLE * -(-(last + 4) // MULTIPLE)
    return min(max(12, enough), max(state.n, 12))


def highest_growing(p: Parameters) -> int:
    """The highest mode l >= 2 of the homogeneous sphere that grows, up to MAX_GROWING, or 0."""
    return highest_growing_of([p])[0]


def highest_growing_of(cells: Sequence[Parameters]) -> list[int]:
    """The same of several cells."""
    l = np.arange(2, MAX_GROWING + 1)  # noqa: E741
    alike: dict[Hashable, list[int]] = {}
    for k, p in enumerate(cells):
        alike.setdefault((p.law, p.stress), []).append(k)
    found = [0] * len(cells)
    for group in alike.values():
        values: dict[str, Any] = {
            name: np.array([[getattr(cells[k], name)] for k in group]) for name in DIMENSIONS
        }
        with np.errstate(all="ignore"):  # what is not finite is rejected
            of_modes = finite_pressure_matrix(replace(points(cells[group[0]]), **values), l)
        a, b, c, d = np.moveaxis(of_modes.reshape(*of_modes.shape[:-2], 4), -1, 0)
        # one of two eigenvalues has a positive real part
        grows = (a + d > 0) | (a * d < b * c)
        for k, growing in zip(group, grows, strict=True):
            found[k] = int(l[growing][-1]) if growing.any() else 0
    return found
