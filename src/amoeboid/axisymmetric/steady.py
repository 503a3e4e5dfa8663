"""Steady states of the axisymmetric cell, by Newton's method on the equations of `system`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.cell import AxisymmetricCell
from amoeboid.axisymmetric.force_balance import axial_strength, speed
from amoeboid.axisymmetric.shape import Shape, shape
from amoeboid.axisymmetric.spectral import even_basis, grid, odd_basis, resized
from amoeboid.axisymmetric.system import FINER, MODES, SteadySystem
from amoeboid.axisymmetric.unknowns import fields_of, split, unknown_count
from amoeboid.model.cues import Cue
from amoeboid.model.natural_units import in_units
from amoeboid.model.parameters import Parameters
from amoeboid.model.units import Units
from amoeboid.numerics.newton import newton
from amoeboid.observables import Measured


@dataclass(frozen=True)
class SteadySolution(Measured):
    """A steady state, or an attempt at one: it is a solution only if `converged`.

    Every observable is an attribute: `max_retrograde_speed`, `polarity`.

    `x` is the vector of unknowns of n modes (`unknowns`); `residuals` the scaled root mean
    squares that Newton's method went through; `message` says why it is not converged; `cue` is the
    one along the axis that it is a state under, towards the pole x = 0 for (0, 0, 1).
    """

    parameters: Parameters
    n: int
    x: Array
    converged: bool
    residuals: tuple[float, ...]
    message: str = ""
    cue: Cue | None = None

    def in_units(self, units: Units) -> SteadySolution:
        """The same state measured in other units; the residuals are dimensionless."""
        x = unknowns_in_units(self.x, self.n, units)
        return replace(self, parameters=in_units(self.parameters, units), x=x)

    @cached_property
    def shape(self) -> Shape:
        """Geometry at the grid points."""
        f = fields_of(self.x, self.n)
        return shape(grid(self.n), f.psi, f.psi_slope, f.scale)

    @property
    def length_scale(self) -> float:
        """ds/dx, the length of the meridian over pi [length]."""
        return float(self.x[-4])

    @property
    def zeta0(self) -> float:
        """Membrane tension zeta_0 [force/length]."""
        return float(self.x[-3])

    @property
    def defects(self) -> tuple[float, float]:
        """Axial force and filament source: zero but for the error of the discretization."""
        return float(self.x[-2]), float(self.x[-1])

    def concentration(self, x: Array) -> Array:
        """c at scaled arclengths x in [0, pi] [1/length^2]."""
        return even_basis(np.asarray(x, dtype=float), self.n) @ split(self.x, self.n)[2]

    def flow(self, x: Array) -> Array:
        """Retrograde flow u at scaled arclengths x, positive towards x = pi [length/time]."""
        return odd_basis(np.asarray(x, dtype=float), self.n) @ split(self.x, self.n)[1]

    @cached_property
    def cell(self) -> AxisymmetricCell:
        """The state as observables see it, in the frame in which the shape rests."""
        f = fields_of(self.x, self.n)
        point = SteadySystem(self.parameters, self.n, cue=self.cue).point(np.zeros(0))
        speeds = speed(self.shape, f.c, point)
        return AxisymmetricCell(
            self.parameters, self.shape, f.c, f.u, np.zeros(self.n), speeds, self.zeta0
        )

    @cached_property
    def meridian(self) -> tuple[Array, Array, float]:
        """Sine coefficients of r, cosine coefficients of z, both over ds/dx, and their mean.

        From k = 1 on; the mean is that of z at the two poles, over ds/dx.
        """
        runs, rises, middle = meridian_of(self.x, self.n)
        return runs, rises, float(middle)

    def position(self, x: Array) -> tuple[Array, Array]:
        """(r, z) of the meridian at scaled arclengths x; its ends lie at opposite z [length]."""
        runs, rises, middle = self.meridian
        phases = np.outer(x, np.arange(1, runs.size + 1))
        return self.length_scale * (np.sin(phases) @ runs), self.length_scale * (
            np.cos(phases) @ rises - middle
        )

    def outline(self, count: int = 400) -> tuple[Array, Array]:
        """(r, z) of the meridian at `count` points from the pole x = 0 to the pole x = pi."""
        return self.position(np.linspace(0.0, np.pi, count))


def meridian_of(x: Array, n: int) -> tuple[Array, Array, Array]:
    """`SteadySolution.meridian` of the vectors of unknowns (..., 3 n + 3) of n modes."""
    fine = grid(2 * n)
    psi = fine.x + (fine.odd_values[:, : n - 1] @ x[..., : n - 1, None])[..., 0]
    k = np.arange(1, fine.n + 1)
    runs = (fine.to_even @ np.cos(psi)[..., None])[..., 1:, 0]
    rises = (fine.to_odd @ np.sin(psi)[..., None])[..., 0] / k
    return resized(runs, fine.n) / k, rises, np.sum(rises[..., 1::2], axis=-1)


def unknowns_in_units(x: Array, n: int, units: Units) -> Array:
    """Unknowns of n modes measured in other units."""
    speed, concentration = units.of("L/T"), units.of("N/L^2")
    scalars = [units.of(d) for d in ("L", "M/T^2", "M/(L T^2)", "N/(L^2 T)")]
    sizes = np.repeat([1.0, speed, concentration], [n - 1, n, n])
    return x / np.concatenate([sizes, scalars])


def homogeneous(p: Parameters, n: int = MODES) -> SteadySolution:
    """The homogeneous sphere, a steady state at every parameter point.

    zeta_0 = (delta_P + gamma_c v_p(c0)) R0/2 + 2 v_p(c0) (eta_s + eta_b)/R0 - tau(c0).
    """
    return SteadySolution(p, n, homogeneous_unknowns(p, n), True, (0.0,))


def homogeneous_unknowns(p: Any, n: int) -> Array:
    """The unknowns of the homogeneous sphere (..., 3 n + 3), for real or complex parameters."""
    f0 = p.v_p(p.c0)
    held = p.delta_P + p.gamma_c * f0
    zeta0 = held * p.R0 / 2 + 2 * f0 * (p.eta_s + p.eta_b) / p.R0 - p.tau(p.c0)
    kind = np.result_type(zeta0, p.c0, p.R0, float)
    x = np.zeros((*np.shape(zeta0), unknown_count(n)), dtype=kind)
    x[..., 2 * n - 1], x[..., 3 * n - 1], x[..., 3 * n] = p.c0, p.R0, zeta0
    return x


def steady_state(
    p: Parameters, guess: SteadySolution, cue: Cue | None = None, max_iterations: int = 25
) -> SteadySolution:
    """The steady state that Newton's method reaches from `guess`, with as many modes as it needs.

    `cue`: one along the axis, towards the pole x = 0 for the direction (0, 0, 1);
    `max_iterations`: of Newton's method, fewer where only a good guess is to be followed. Raises
    InvalidInput for a cue in another direction.

    Never raises for want of convergence: look at `converged`, `residuals` and `message`.
    """
    axial_strength(cue)  # refuses cues in other directions
    n, x = guess.n, guess.x
    history: tuple[float, ...] = ()
    while True:
        system = SteadySystem(p, n, cue=cue)
        found = newton_solution(system, x, max_iterations)
        history += found.residuals
        if not found.converged:
            advice = "start from a closer state, in smaller steps of the parameter"
            why = f"Newton stalled; {advice}"
            return SteadySolution(p, n, found.x, False, history, why, cue)
        if system.resolved(found.x, np.zeros(0)):
            return SteadySolution(p, n, found.x, True, history, cue=cue)
        finer = system.refined(found.x, np.zeros(0))
        if finer is None:
            advice = f"{n} modes do not resolve the state; raise D"
            return SteadySolution(p, n, found.x, False, history, advice, cue)
        n, x = finer.n, system.prolonged(found.x, finer)


def newton_solution(system: SteadySystem, start: Array, max_iterations: int = 25) -> Any:
    """Newton's method on a system without free parameters."""
    q = np.zeros(0)
    return newton(
        lambda x: system.residual(x, q),
        lambda x: system.residual_and_jacobian(x, q),
        start,
        scale=system.scale,
        max_iterations=max_iterations,
    )


def strong_residual(state: SteadySolution, finer: int = FINER) -> float:
    """Largest residual of the continuous equations between the collocation points.

    Force balance and transport, without the slack unknowns (the axial force counts with friction),
    on a grid of `finer` * n points, each in units of its magnitude in that state: pressure plus
    viscous force, largest c times largest speed over R0.
    """
    system = SteadySystem(state.parameters, state.n, cue=state.cue)
    return system.strong_residual(state.x, np.zeros(0), finer)
