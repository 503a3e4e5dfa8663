"""Steady states of the free-shape axisymmetric cell, by Newton's method with an exact Jacobian.

In the frame of the cell the shape rests: the normal cortex velocity is -v_p(c), the tangential one
u is the retrograde flow itself. Besides shape, u, c, length scale and tension there are two slack
unknowns that vanish at a solution: an axial force (one force equation is redundant; with friction
it is the drag on the motion of the cell instead, see `force_balance.forces`) and a uniform source
of filaments (the filament number c0 A0 is a condition of its own; for beta > 0 it follows
from the turnover, for beta = 0 it is the conserved number).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.cell import AxisymmetricCell
from amoeboid.axisymmetric.force_balance import (
    Motion,
    axial_strength,
    forces,
    function_of,
    speed,
    stress,
    transport,
    with_cue,
)
from amoeboid.axisymmetric.shape import Shape, shape
from amoeboid.axisymmetric.spectral import even_basis, grid, odd_basis, resized
from amoeboid.axisymmetric.unknowns import (
    FIELDS,
    Fields,
    fields_by_name,
    fields_of,
    maps_of,
    resampled,
    split,
    unknown_count,
)
from amoeboid.forces import friction
from amoeboid.model.cues import Cue
from amoeboid.model.natural_units import in_units
from amoeboid.model.parameters import ParameterPoint, Parameters
from amoeboid.model.units import Units
from amoeboid.numerics.jacobians import Equations, recorded
from amoeboid.numerics.newton import newton
from amoeboid.numerics.programs import Record, Symbol, Values, values_of
from amoeboid.observables import Measured

MODES = 32
MAX_MODES = 256
STRONG, FINER = 5e-9, 3
"""A state is resolved up to this residual of the continuous equations, on a finer grid."""

FRICTION = ("gamma_t", "gamma_n", "gamma_c")
OPTIONAL = (*FRICTION, "gamma_share", "kappa", "cue")
"""Parameters whose terms are left out of the equations where they are 0."""


@dataclass(frozen=True)
class Magnitudes:
    """Typical magnitudes of the unknowns and of the equations at a parameter point, or at many."""

    speed: Any
    concentration: Any
    force: Any
    rate: Any

    @classmethod
    def of(cls, p: Any) -> Magnitudes:
        """Magnitudes from the homogeneous sphere, of Parameters or of Points."""
        concentration = np.where(p.c0 > 0, p.c0, p.c_r)
        frequency = p.beta + p.D / p.R0**2
        pressed = p.delta_P * p.R0**2 / (p.eta_s + p.eta_b)
        speed_here = np.maximum(np.abs(p.v_p(p.c0)), frequency * p.R0)
        for other in (p.v_p0, pressed, p.R0):
            speed_here = np.where(speed_here == 0, other, speed_here)
        viscous = (p.eta_s + p.eta_b) * speed_here / p.R0**2
        force = p.delta_P + viscous + np.abs(p.tau(concentration)) / p.R0
        force = force + friction.unit(p) * speed_here + p.kappa / p.R0**3
        return cls(speed_here, concentration, force, concentration * speed_here / p.R0)

    def by_equation(self, p: Any) -> Array:
        """Typical magnitude of each kind of equation (..., 5); see `equation_counts`."""
        area = 4 * np.pi * p.R0**2
        return self._together(self.force, self.rate, 1.0, area, self.concentration * area)

    def by_unknown(self, p: Any) -> Array:
        """Typical magnitude of each kind of unknown (..., 7); see `unknown_counts`."""
        scalars = (p.R0, self.force * p.R0, self.force, self.rate)
        return self._together(1.0, self.speed, self.concentration, *scalars)

    def of_equations(self, p: Any, n: int) -> Array:
        """Typical magnitude of each equation (..., 3 n + 3)."""
        return np.repeat(self.by_equation(p), equation_counts(n), axis=-1)

    def of_unknowns(self, p: Any, n: int) -> Array:
        """Typical magnitude of each unknown (..., 3 n + 3)."""
        return np.repeat(self.by_unknown(p), unknown_counts(n), axis=-1)

    def _together(self, *each: Any) -> Array:
        everywhere = 0.0 * self.rate  # which has a value at every point
        return np.array([value + everywhere for value in each]).T


def equation_counts(n: int) -> list[int]:
    """How many equations of each kind there are: force balance, transport, closure, area, number.

    >>> sum(equation_counts(32)) == sum(unknown_counts(32)) == unknown_count(32)
    True
    """
    return [2 * n, n, 1, 1, 1]


def unknown_counts(n: int) -> list[int]:
    """How many unknowns of each kind there are: psi, u, c and the four scalars."""
    return [n - 1, n, n, 1, 1, 1, 1]


@dataclass(frozen=True)
class SteadySystem:
    """The discretized steady problem as a function of chosen parameters.

    `names` are the parameters that the argument q of the methods replaces; q may be complex.
    `cue`: one along the axis, or None.
    """

    parameters: Parameters
    n: int = MODES
    names: tuple[str, ...] = ()
    cue: Cue | None = None

    @cached_property
    def scales(self) -> Magnitudes:
        """Typical magnitudes at the parameter point that the system was made with."""
        return Magnitudes.of(self.parameters)

    @cached_property
    def row_scales(self) -> Array:
        """Typical magnitude of each equation."""
        return self.scales.of_equations(self.parameters, self.n)

    @cached_property
    def scale(self) -> Array:
        """Typical magnitude of each unknown."""
        return self.scales.of_unknowns(self.parameters, self.n)

    @cached_property
    def weights(self) -> Array:
        """Weights of the inner product that measures the length of a branch."""
        weights = 1.0 / self.scale**2
        weights[-4:] = 0.0
        return weights

    def point(self, q: Array) -> Any:
        """The parameters with those in `names` replaced by q."""
        if not self.names:
            return self._parameters
        return self._parameters.replaced(dict(zip(self.names, q, strict=True)))

    @cached_property
    def _parameters(self) -> ParameterPoint:
        return with_cue(self.parameters.point(), self.cue)

    def residual(self, x: Array, q: Array) -> Array:
        """Scaled residual of all equations, shape (3 n + 3,)."""
        return self._recorded.residual(self._inputs(x, q), np.result_type(x, q)) / self.row_scales

    def jacobian(self, x: Array, q: Array) -> Array:
        """Its exact derivative to x, shape (3 n + 3, 3 n + 3)."""
        return self.residual_and_jacobian(x, q)[1]

    def residual_and_jacobian(self, x: Array, q: Array) -> tuple[Array, Array]:
        """Both at once."""
        kind = np.result_type(x, q)
        return self._recorded.residual_and_jacobian(self._inputs(x, q), self.row_scales, kind)

    @cached_property
    def _recorded(self) -> Equations:
        return recorded_equations(self.n, self._present)

    @cached_property
    def _present(self) -> frozenset[str]:
        """The names of `OPTIONAL` that count: those that are not 0, or may change."""
        values = ((name, getattr(self._parameters, name, 0.0)) for name in OPTIONAL)
        return frozenset(name for name, value in values if value != 0 or name in self.names)

    def _inputs(self, x: Array, q: Array) -> Inputs:
        return Inputs(fields_by_name(x, self.n), self.point(q))

    def resolved(self, x: Array, q: Array) -> bool:
        """Whether x solves the continuous equations at q, not only the discrete ones."""
        return self.strong_residual(x, q) <= STRONG

    def strong_residual(self, x: Array, q: Array, finer: int = FINER) -> float:
        """See `strong_residual`, of the unknowns x at q."""
        m = finer * self.n
        p, x = self.point(q), x.copy()
        x[-1] = 0.0
        if not p.has_friction:
            x[-2] = 0.0
        found = strong_equations(m, self._present)(Inputs(fields_by_name(x, self.n, m), p))
        *residuals, u, v_p, c, tau = np.abs(found).max(axis=1).tolist()
        units = np.repeat(strong_units(u, v_p, c, tau, p), (2, 1, 1, 1, 1))
        return float(np.max(residuals / units))

    def refined(self, x: Array, q: Array) -> SteadySystem | None:
        """The same problem with as many modes as x at q needs; None beyond MAX_MODES."""
        n = finer_count(self.n, self.strong_residual(x, q))
        return None if n is None else replace(self, n=n)

    def prolonged(self, x: Array, finer: SteadySystem) -> Array:
        """A vector of unknowns carried to a refined system."""
        return resampled(x, self.n, finer.n)


def finer_count(n: int, residual: float) -> int | None:
    """How many modes the state needs of which n leave a `strong_residual`; None beyond MAX_MODES.

    The residual falls exponentially with the number of modes, from the order of 1. At most twice as
    many are taken at a time, and only every count of the form 4, 5, 6 or 7 times a power of two.

    >>> [finer_count(32, residual) for residual in (1e-8, 1e-6, 1e-2)]
    [40, 48, 64]
    """
    if n >= MAX_MODES:
        return None
    share = np.log(STRONG) / np.log(residual) if 0.0 < residual < 1.0 else np.inf
    needed = max(n + 1, n * min(float(share), 2.0))
    step = 2 ** max(int(np.log2(needed)) - 2, 0)
    return min(step * int(np.ceil(needed / step)), MAX_MODES)


def equations(n: int, f: Fields, p: Any) -> list[Any]:
    """Residuals of the steady problem: force balance, transport, closure, area, filament number."""
    s = shape(grid(n), f.psi, f.psi_slope, f.scale)
    return equations_on(s, speed(s, f.c, p), f, p)


def equations_on(s: Shape, v_p: Any, f: Fields, p: Any) -> list[Any]:
    """The same on a shape, with the polymerization speed there."""
    motion = Motion(f.u, 0.0, -v_p, f.c)
    tangential, normal = forces(s, stress(s, f.u, -v_p, f.c, f.zeta0, p), motion, f.axial, p)
    area = 4 * np.pi * p.R0**2
    return [
        tangential,
        normal,
        transport(s, f.c, f.u, p) + f.source,
        s.gap,
        s.area - area,
        s.surface_integral(f.c) - p.c0 * area,
    ]


@lru_cache(maxsize=16)
def recorded_equations(n: int, present: frozenset[str]) -> Equations:
    """`equations` as a program with its derivatives; the same object each time.

    Those of `OPTIONAL` that are not `present` are 0.
    """

    def function(fields: Mapping[str, Any], record: Record) -> list[Any]:
        return equations(n, Fields(**fields), _Recorded(record, present))

    return recorded(function, n, unknown_count(n), maps_of(n))


@lru_cache(maxsize=16)
def strong_equations(m: int, present: frozenset[str]) -> Values:
    """`equations` on a grid of m points as a program, and u, v_p, c and tau there."""

    def function(fields: Mapping[str, Any], record: Record) -> list[Any]:
        f, p = Fields(**fields), _Recorded(record, present)
        tau: Any = p.tau_derivatives
        s = shape(grid(m), f.psi, f.psi_slope, f.scale)
        v_p = speed(s, f.c, p)
        return [*equations_on(s, v_p, f, p), f.u, v_p, f.c, function_of(f.c, tau)]

    return values_of(function, m, FIELDS)


class Inputs:
    """What a recorded program is given: fields and parameters by their names."""

    def __init__(self, fields: Mapping[str, Array], p: Any) -> None:
        self._fields, self._p = fields, p

    def __getitem__(self, name: str) -> Any:
        return self._fields[name] if name in self._fields else getattr(self._p, name)


class _Recorded:
    """Parameters as inputs of a program, each by its name."""

    def __init__(self, record: Record, present: frozenset[str]) -> None:
        self._record, self._present = record, present

    def __getattr__(self, name: str) -> Symbol | float:
        if name in OPTIONAL and name not in self._present:
            return 0.0
        return self._record.input(name)

    @property
    def has_friction(self) -> bool:
        """See Material.has_friction."""
        return not self._present.isdisjoint(FRICTION)


@dataclass(frozen=True)
class SteadySolution(Measured):
    """A steady state, or an attempt at one: it is a solution only if `converged`.

    Every observable is an attribute: `max_retrograde_speed`, `polarity`.

    `x` is the vector of unknowns of n modes (module docstring); `residuals` the scaled root mean
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


def strong_units(u: Any, v_p: Any, c: Any, tau: Any, p: Any) -> list[Any]:
    """The magnitude of each kind of equation (`equation_counts`) in a state.

    Of the largest |u|, |v_p|, |c| and |tau| in it, numbers or arrays, as are the parameters.
    """
    fastest = np.maximum(np.maximum(u, v_p), p.D / p.R0 + p.beta * p.R0)
    force = p.delta_P + (p.eta_s + p.eta_b) * fastest / p.R0**2
    force = force + tau / p.R0 + friction.unit(p) * fastest + p.kappa / p.R0**3
    area = 4 * np.pi * p.R0**2 + 0.0 * fastest  # which has a value at every point
    return [force, c * fastest / p.R0, area / area, area, c * area]
