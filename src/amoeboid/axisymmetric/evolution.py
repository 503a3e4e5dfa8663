"""Time evolution of the free-shape axisymmetric cell: shape and concentration, implicit in time.

State y: the sine coefficients 2..n-1 of psi - x and the n cosine coefficients of c. The first
sine coefficient follows from closure and the length scale from the area 4 pi R0^2, so both hold
to rounding at all times. At each instant the force balance gives u, the normal cortex velocity w
and zeta_0; the surface moves with V = w + v_p(c) along its normal, and its points slide along
the meridian so that they stay equidistant. Frame: without net motion along the axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.cell import AxisymmetricCell, heights, volume
from amoeboid.axisymmetric.force_balance import (
    Motion,
    forces,
    speed,
    stress,
    transport,
    with_cue,
)
from amoeboid.axisymmetric.shape import Shape, shape
from amoeboid.axisymmetric.spectral import grid, resized
from amoeboid.axisymmetric.steady import SteadySolution, steady_state
from amoeboid.axisymmetric.system import MAX_MODES, MODES, Magnitudes
from amoeboid.axisymmetric.unknowns import split
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import ParameterPoint, Parameters
from amoeboid.numerics.derivatives import Dual, stacked
from amoeboid.numerics.integrators import Control, StepTooSmall, integrate
from amoeboid.numerics.newton import solve
from amoeboid.observables import Measured
from amoeboid.validation import InvalidInput

TAIL = 1e-9
FIRST_STEP, MIN_STEP = 1e-3, 1e-12
"""Time steps in units of 1/rate."""


@dataclass(frozen=True)
class Instant(Measured):
    """The cell at time t: sine coefficients of psi - x and u, cosine ones of V and c; zeta_0.

    u and V are the tangential and normal velocity in the frame in which the center of volume
    rests. `rate` is the scaled rate of change of the state [1/time], zero when it is steady. Every
    observable is an attribute: `max_retrograde_speed`, `polarity`.
    """

    parameters: Parameters
    t: float
    n: int
    y: Array
    psi: Array
    u: Array
    V: Array
    c: Array
    length_scale: float
    zeta0: float
    rate: float
    cue: Cue | None = None

    @property
    def shape(self) -> Shape:
        """Geometry at the grid points."""
        g = grid(self.n)
        psi = g.x + g.odd_values[:, : self.n - 1] @ self.psi
        slope = 1.0 + g.odd_slopes[:, : self.n - 1] @ self.psi
        return shape(g, psi, slope, np.array([self.length_scale]))

    @cached_property
    def cell(self) -> AxisymmetricCell:
        """The instant as observables see it."""
        g, p, here = grid(self.n), self.parameters, self.shape
        u, V, c = g.odd_values @ self.u, g.even_values @ self.V, g.even_values @ self.c
        v_p = speed(here, c, with_cue(p.point(), self.cue))
        return AxisymmetricCell(p, here, c, u, V, v_p, self.zeta0)

    def as_guess(self) -> SteadySolution:
        """This instant as a guess for the steady state nearby (not converged)."""
        scalars = [self.length_scale, self.zeta0, 0.0, 0.0]
        x = np.concatenate([self.psi, self.u, self.c, scalars])
        return SteadySolution(self.parameters, self.n, x, False, (), cue=self.cue)


@dataclass(frozen=True)
class Dynamics:
    """y' = rate(y) for one parameter point and n points, and a cue along the axis or None."""

    parameters: Parameters
    n: int = MODES
    cue: Cue | None = None

    @cached_property
    def point(self) -> ParameterPoint:
        """The parameters as plain attributes."""
        return with_cue(self.parameters.point(), self.cue)

    def rate(self, y: Array) -> Array:
        """dy/dt, shape (2 n - 2,)."""
        closed = self.closed(y)
        q = self._velocities(closed)
        n = self.n
        g = grid(n)
        return self._rates(closed, g.odd_values @ q[:n], g.even_values @ q[n : 2 * n])

    def jacobian(self, y: Array) -> Array:
        """Exact d(rate)/dy, shape (2 n - 2, 2 n - 2)."""
        n, m = self.n, y.size
        closed = self.closed(y)
        q = self._velocities(closed)
        opened = self._differentiable(closed, m + q.size)
        g, seeds = grid(n), np.eye(m + q.size)[m:]
        u = Dual(g.odd_values @ q[:n], g.odd_values @ seeds[:n])
        w = Dual(g.even_values @ q[n : 2 * n], g.even_values @ seeds[n : 2 * n])
        zeta0, axial = (Dual(q[k : k + 1], seeds[k : k + 1]) for k in (2 * n, 2 * n + 1))
        balance = self._balance(opened, u, w, zeta0, axial).derivatives
        rates = self._rates(opened, u, w).derivatives
        return rates[:, :m] - rates[:, m:] @ solve(balance[:, m:], balance[:, :m])

    def closed(self, y: Array) -> tuple[Shape, Array, Array]:
        """(shape, c at the points, sine coefficients of psi - x) of a state."""
        n, g = self.n, grid(self.n)
        coefficients = np.concatenate([[0.0], y[: n - 2]])
        sines, slopes = g.odd_values[:, : n - 1], g.odd_slopes[:, : n - 1]
        for _ in range(30):
            psi = g.x + sines @ coefficients
            step = np.mean(np.cos(psi)) / np.mean(np.sin(psi) * sines[:, 0])
            coefficients[0] += step
            if abs(step) < 1e-15:
                break
        psi = g.x + sines @ coefficients
        unit = shape(g, psi, 1.0 + slopes @ coefficients, np.ones(1))
        if not (np.all(unit.r > 0) and float(unit.area[0]) > 0):
            raise InvalidInput("the surface must not touch its axis; use a smaller perturbation")
        scale = self.parameters.R0 * np.sqrt(4 * np.pi / unit.area)
        c = g.even_values @ y[n - 2 :]
        return shape(g, psi, unit.psi_slope, scale), c, coefficients

    def _differentiable(
        self, closed: tuple[Shape, Array, Array], size: int
    ) -> tuple[Shape, Dual, Array]:
        """The same with derivatives to y, through closure and area."""
        here, c, coefficients = closed
        n, g = self.n, grid(self.n)
        gap = -np.mean(here.sin_psi[:, None] * g.odd_values[:, : n - 1], axis=0)
        follow = np.vstack([-gap[1:] / gap[0], np.eye(n - 2)])
        seed = np.zeros((n - 1, size))
        seed[:, : n - 2] = follow
        psi = Dual(g.x + g.odd_values[:, : n - 1] @ coefficients, g.odd_values[:, : n - 1] @ seed)
        slope = Dual(here.psi_slope, g.odd_slopes[:, : n - 1] @ seed)
        area = shape(g, psi, slope, np.ones(1)).area
        scale = self.parameters.R0 * np.sqrt(4 * np.pi / area.values)
        opened = shape(g, psi, slope, area.map(scale, -scale / (2 * area.values)))
        c_seed = np.zeros((n, size))
        c_seed[:, n - 2 : 2 * n - 2] = g.even_values
        return opened, Dual(c, c_seed), coefficients

    def _balance(self, closed: Any, u: Any, w: Any, zeta0: Any, axial: Any) -> Any:
        here, c, _ = closed
        p = self.point
        V = w + speed(here, c, p)
        motion = Motion(u, V, w, c)
        tangential, normal = forces(here, stress(here, u, w, c, zeta0, p), motion, axial, p)
        fixed_area = here.surface_integral(here.curvature_sum * V)
        at_rest = here.surface_integral(here.cos_psi * V)
        s = Magnitudes.of(self.parameters)
        change = s.speed * self.parameters.R0
        return stacked(
            [
                tangential / s.force,
                normal / s.force,
                fixed_area / change,
                at_rest / (change * self.parameters.R0),
            ]
        )

    def _velocities(self, closed: tuple[Shape, Array, Array]) -> Array:
        """Coefficients of u and w, zeta_0 and the slack axial force, from the force balance."""
        n, g = self.n, grid(self.n)
        seeds = np.eye(2 * n + 2)
        u = Dual(np.zeros(n), g.odd_values @ seeds[:n])
        w = Dual(np.zeros(n), g.even_values @ seeds[n : 2 * n])
        zeta0, axial = (Dual(np.zeros(1), seeds[k : k + 1]) for k in (2 * n, 2 * n + 1))
        balance = self._balance(closed, u, w, zeta0, axial)
        return solve(balance.derivatives, -balance.values)

    def _rates(self, closed: Any, u: Any, w: Any) -> Any:
        here, c, _ = closed
        p, g, n = self.point, grid(self.n), self.n
        V = w + speed(here, c, p)
        slide = -(g.integral @ (here.psi_slope * V))
        turning = here.kappa_1 * slide - here.even_slope(V)
        c_rate = slide * here.even_slope(c) - c * here.curvature_sum * V + transport(here, c, u, p)
        return stacked([g.to_odd[1 : n - 1] @ turning, g.to_even @ c_rate])

    def scales(self) -> Array:
        """Magnitude of the entries of y."""
        p = self.parameters
        return np.repeat([1.0, p.c0 if p.c0 > 0 else p.c_r], [self.n - 2, self.n])

    def instant(self, t: float, y: Array) -> Instant:
        """The cell at a state y."""
        here, c, coefficients = self.closed(y)
        n, g = self.n, grid(self.n)
        q = self._velocities((here, c, coefficients))
        u, V = g.odd_values @ q[:n], g.even_values @ q[n : 2 * n] + speed(here, c, self.point)
        center = float(here.surface_integral(V * heights(here))[0]) / volume(here)
        u, V = g.to_odd @ (u + center * here.sin_psi), g.to_even @ (V - center * here.cos_psi)
        rate = float(np.sqrt(np.mean((self.rate(y) / self.scales()) ** 2)))
        return Instant(
            self.parameters, t, n, y, coefficients, u, V, y[n - 2 :],
            float(here.scale[0]), float(q[2 * n]), rate, self.cue,
        )  # fmt: skip

    def resolved(self, y: Array) -> bool:
        """Whether the series of psi and c have decayed."""
        count = max(2, self.n // 8)
        psi, c = np.abs(y[: self.n - 2]), np.abs(y[self.n - 2 :])
        return bool(psi[-count:].max() <= TAIL and c[-count:].max() <= TAIL * c.max())

    def refined(self, y: Array) -> tuple[Dynamics, Array]:
        """Twice the points, and y on them."""
        n = 2 * self.n
        halves = resized(y[: self.n - 2], n - 2), resized(y[self.n - 2 :], n)
        return replace(self, n=n), np.concatenate(halves)


def perturbed_sphere(
    p: Parameters,
    concentration: Mapping[int, float],
    angle: Mapping[int, float] | None = None,
    n: int = MODES,
) -> Array:
    """State y of a sphere with c = c0 + sum a_k cos(k x) and psi = x + sum b_k sin(k x), k >= 2.

    `concentration` maps k >= 0 to a_k [1/length^2], `angle` k to b_k. Raises InvalidInput.
    """
    y = np.zeros(2 * n - 2)
    y[n - 2] = p.c0
    for k, amplitude in concentration.items():
        if not 0 <= k < n:
            raise InvalidInput(f"a mode of c must lie between 0 and {n - 1}, got {k}")
        y[n - 2 + k] += amplitude
    for k, amplitude in (angle or {}).items():
        if not 2 <= k < n:
            raise InvalidInput(f"a mode of the shape must lie between 2 and {n - 1}, got {k}")
        y[k - 2] += amplitude
    return y


def state_of(state: SteadySolution) -> Array:
    """The state y of a steady state."""
    psi, _, c, _ = split(state.x, state.n)
    return np.concatenate([psi[1:], c])


def evolve(
    p: Parameters,
    y: Array,
    end: float = np.inf,
    control: Control | None = None,
    cue: Cue | None = None,
) -> Iterator[Instant]:
    """The cell from the state y at t = 0 on, one instant a step, the first one included.

    The number of points doubles when the series need it. Raises StepTooSmall if the error cannot
    be controlled or MAX_MODES do not resolve the state, InvalidInput for an impossible start.
    `control` has its steps in the units of p; left out, they are measured in 1/p.rate. `cue`: one
    along the axis, towards the pole x = 0 for the direction (0, 0, 1).
    """
    dynamics = Dynamics(p, (y.size + 2) // 2, cue)
    base = control or Control(first_step=FIRST_STEP / p.rate, min_step=MIN_STEP / p.rate)
    t, step = 0.0, base.first_step
    yield dynamics.instant(t, y)
    while t < end * (1 - 1e-14):
        settings = replace(base, scale=dynamics.scales(), first_step=step)
        for taken in integrate(dynamics.rate, dynamics.jacobian, y, settings, t, end):
            t, y, step = taken.t, taken.y, taken.step
            yield dynamics.instant(t, y)
            if not dynamics.resolved(y):
                break
        while not dynamics.resolved(y):
            if 2 * dynamics.n > MAX_MODES:
                raise StepTooSmall(f"{dynamics.n} modes cannot resolve the cell at t = {t:.6g}")
            dynamics, y = dynamics.refined(y)


def evolve_to_steady(
    p: Parameters,
    y: Array,
    end: float,
    control: Control | None = None,
    rate: float = 1e-10,
    cue: Cue | None = None,
) -> Instant:
    """The last instant of an evolution: steady to `rate` in units of p.rate, or at time `end`."""
    last = None
    for last in evolve(p, y, end, control, cue):
        if last.rate <= rate * p.rate:
            break
    if last is None:
        raise InvalidInput(f"end must be > 0, got {end!r}")
    return last


def newton_refined(instant: Instant) -> SteadySolution:
    """The steady state that Newton's method reaches from an instant."""
    return steady_state(instant.parameters, instant.as_guess(), instant.cue)
