"""The steady equations of the free-shape axisymmetric cell, with an exact Jacobian.

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
from amoeboid.axisymmetric.force_balance import (
    Motion,
    forces,
    function_of,
    speed,
    stress,
    transport,
    with_cue,
)
from amoeboid.axisymmetric.shape import Shape, shape
from amoeboid.axisymmetric.spectral import grid
from amoeboid.axisymmetric.unknowns import (
    FIELDS,
    Fields,
    fields_by_name,
    maps_of,
    resampled,
    unknown_count,
)
from amoeboid.forces import friction
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import ParameterPoint, Parameters
from amoeboid.numerics.jacobians import Equations, recorded
from amoeboid.numerics.programs import Record, Symbol, Values, values_of

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


def strong_units(u: Any, v_p: Any, c: Any, tau: Any, p: Any) -> list[Any]:
    """The magnitude of each kind of equation (`equation_counts`) in a state.

    Of the largest |u|, |v_p|, |c| and |tau| in it, numbers or arrays, as are the parameters.
    """
    fastest = np.maximum(np.maximum(u, v_p), p.D / p.R0 + p.beta * p.R0)
    force = p.delta_P + (p.eta_s + p.eta_b) * fastest / p.R0**2
    force = force + tau / p.R0 + friction.unit(p) * fastest + p.kappa / p.R0**3
    area = 4 * np.pi * p.R0**2 + 0.0 * fastest  # which has a value at every point
    return [force, c * fastest / p.R0, area / area, area, c * area]
