"""An implicit Euler step of small disturbances of a steady cell, with one factorization.

The equations of motion (force balance, area, filament balance) are those of the step, evaluated at
a slightly disturbed state. The force balance near a known flow takes one back-substitution, exact
to first order in the disturbance; so does one pass towards the solution of the implicit step,
x = T x + S y, from disturbances y before the step. The passes themselves need not converge:
(1 - T) x = S y is solved as what it is, a linear equation.

A disturbance (2V,) is c'/(c0 + c) and h/R0, h along the normals. Nodes that slide within the
surface are none, so that the many slow modes of the mesh play no part. Nodes turn with the cell, as
they do in a run: a mesh at rest would hold or drive a cell that is about to turn. Seen from axes
that turn, a cue tilts: the angles by which they have turned in the step are unknowns as well, and
what comes out is told in axes that have not. Without a cue there are no such angles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import (
    Geometry,
    area_gradient,
    geometry,
    node_areas,
    normal_part,
    volume_centroid,
)
from amoeboid.numerics.recycling import Recycling
from amoeboid.surface.force_balance import cortex, force_balance
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import changes, gradient, held_axes, rotations, turned, turning_rate
from amoeboid.surface.state import Flow, State
from amoeboid.surface.transport import exchanged, implicit_matrix

# Largest disturbance: small against what is not linear, large against rounding.
AMPLITUDE = 1e-6
# Flux correction compares neighbors, and flows from one to another with flows back. It has a kink
# where they are equal, as in a cell that is as symmetric as its mesh. It is linearized for
# concentrations and velocities so far beside, relative to c0 + c and rate R0, on one side or on the
# opposite.
BESIDE = 1e-5


@dataclass(frozen=True, eq=False)
class SeenFrom:
    """A cue as it is in axes that have turned by the angles `tilt` (3,)."""

    cue: Any
    tilt: Array

    def factor(self, directions: Array, t: float) -> Array:
        """See Cue.factor; directions in the turned axes."""
        return np.asarray(self.cue.factor(turned(directions, self.tilt, 1.0), t))


class LinearizedStep:
    """What an implicit Euler step of length dt makes of small disturbances of `state`.

    `flow`: that in the state, up to a small error. Raises SingularMatrix, InvalidInput.
    """

    def __init__(self, model: Model, state: State, flow: Flow, dt: float) -> None:
        self.model, self.state, self.dt = model, state, dt
        self.g = geometry(state.r, model.mesh.faces)
        self._scale = model.parameters.c0 + state.c
        self._zeta0, self._v_c = flow.zeta0, flow.v_c
        self._near = cortex(model, state.r, self.g, dt, flow.zeta0, flow.v_c)
        along = np.einsum("vi,vi->v", area_gradient(self.g, model.mesh.faces), self.g.normals)
        self._area_gradient = along
        self._by_tension = np.einsum("vi,vi->v", self._near.slope, self.g.normals)
        rest = np.zeros(len(state.c))
        v, _, _ = self._velocity(rest, rest, rest)
        # what the velocity is less in axes that turn, by unit rates around three axes (3, V, 3)
        self._turns = [self._velocity(rest, rest, rest, axis)[0] - v for axis in np.eye(3)]
        self._turning = turning_rate(model, state.r, state.c, self.g, v)
        self._v_n = np.einsum("vi,vi->v", v, self.g.normals)
        u = v - normal_part(v, self.g.normals)
        beside = BESIDE * np.random.default_rng(0).uniform(-1.0, 1.0, (len(rest), 4))
        self._c_beside = beside[:, 0] * self._scale
        self._u_beside = beside[:, 1:] * model.rate * model.parameters.R0
        self._gain = {side: self._gained(state.c, self.g, u, side) for side in (1, -1)}
        self._entries, _ = implicit_matrix(model, self.g, u, dt)
        self._axes = held_axes(model, state.r)
        self._rotations = self._rotated()
        self._equations = Recycling(self._defect, 2 * len(rest) + len(self._axes))

    def image(self, y: Array, tolerance: float) -> Array:
        """The disturbance (2V,) after the step, from that before. Raises NoConvergence."""
        none = np.zeros(len(y) + len(self._axes))
        return self._untilted(self._equations.solve(self.one_pass(none, y), tolerance))

    def remainder(self, x: Array, y: Array, tolerance: float) -> Array:
        """How far x (2V,) is from being what the step makes of y (2V,). Raises NoConvergence.

        From the equations with the opposite sign of the disturbances, on the other side of the
        kinks: also as far as they do not act as a linear map.
        """
        axes = len(self._axes)
        extended = np.concatenate([x, np.zeros(axes)])
        if axes:
            angles = -self.one_pass(-extended, -y)[len(x) :]
            extended = np.concatenate([x - self._rotations @ angles, angles])
        left = self.one_pass(-extended, -y, side=-1) + extended
        return self._untilted(self._equations.solve(left, tolerance))

    def _untilted(self, x: Array) -> Array:
        """The disturbance (2V,) in axes that have not turned."""
        axes = len(self._axes)
        return x[: len(x) - axes] + self._rotations @ x[len(x) - axes :] if axes else x

    def _defect(self, x: Array) -> Array:
        return x - self.one_pass(x, np.zeros(len(x) - len(self._axes)))

    def one_pass(self, x: Array, y: Array, side: int = 1) -> Array:
        """T x + S y: an estimate of the disturbance after the step from x, one before, and y (2V,).

        x (2V + k,): with the angles by which the axes have turned about the k axes that a cue holds
        the cell to. `side` (1 or -1): on which side of its kinks the flux correction is taken; see
        `BESIDE`.
        """
        size = max(np.abs(x).max(), np.abs(y).max())
        if size == 0.0:
            return np.zeros_like(x)
        amplitude = AMPLITUDE / size
        angles = amplitude * x[len(y) :]
        (c_x, h_x), (c_y, h_y) = np.split(amplitude * x[: len(y)], 2), np.split(amplitude * y, 2)
        p, dt, area = self.model.parameters, self.dt, self._area_gradient
        v, c, g = self._velocity(c_x, h_x, h_y, angles=angles)
        # nodes turn with the cell
        turning = turning_rate(self.model, self._moved(h_x), c, g, v) - self._turning
        v = v + np.tensordot(turning, self._turns, 1)
        h = h_y + dt / p.R0 * (np.einsum("vi,vi->v", v, g.normals) - self._v_n)
        # the tension that keeps the area
        zeta0 = -(area @ h) / (area @ self._by_tension) * p.R0 / dt
        h += dt / p.R0 * zeta0 * self._by_tension
        v = v + zeta0 * self._near.slope
        u = v - normal_part(v, g.normals)
        gain = self._gained(c, g, u, side) - self._gain[side]
        before = node_areas(self._moved(h_y), self.model.mesh.faces)
        numbers = before * (self.state.c + self._scale * c_y) - g.node_areas * c
        more = self._transported(numbers + dt * gain)
        return np.concatenate([c_x + more / self._scale, h, dt * self._axes @ turning]) / amplitude

    def _velocity(
        self,
        c_x: Array,
        h_x: Array,
        h_y: Array,
        turning: Array | None = None,
        angles: Array | None = None,
    ) -> tuple[Array, Array, Geometry]:
        """Velocity (V, 3), c (V,) and geometry, disturbed by x, with tension of the state.

        Implicit tension acts on what the step moves the shape beyond x. The velocity is that in
        axes that turn at the rate `turning` (3,) [1/T], or do not, and have turned by `angles` (k,)
        about `self._axes`.
        """
        model = self.model
        if angles is not None and len(angles):
            model = replace(model, cue=SeenFrom(model.cue, self._axes.T @ angles))
        c, r = self.state.c + self._scale * c_x, self._moved(h_x)
        g, ahead = geometry(r, self.model.mesh.faces), r - self._moved(h_y)
        solution = force_balance(model, self._near, r, g, c, self._zeta0, ahead, self._v_c, turning)
        return solution.v(self._zeta0), c, g

    def _rotated(self) -> Array:
        """What unit angles about the axes that a cue holds the cell to make of it, (2V, k)."""
        if not len(self._axes):
            return np.zeros((2 * len(self.state.c), 0))
        slope = gradient(self.state.c, self.g, self.model.mesh) / self._scale[:, None]
        x = self.state.r - volume_centroid(self.state.r, self.model.mesh.faces)
        motions = rotations(x, self._axes)
        return changes(motions, slope, self.g.normals, self.model.parameters.R0)

    def _gained(self, c: Array, g: Geometry, u: Array, side: int) -> Array:
        """Filaments (V,) that nodes gain in a unit of time, on one side of the kinks."""
        p = self.model.parameters
        c, u = c + side * self._c_beside, u + side * self._u_beside
        return exchanged(self.model, c, g, u) + p.beta * p.c0 * g.node_areas

    def _moved(self, h: Array) -> Array:
        """Nodes (V, 3) at a height h R0 over those of the state."""
        return np.asarray(self.state.r + self.model.parameters.R0 * h[:, None] * self.g.normals)

    def _transported(self, numbers: Array) -> Array:
        """What becomes of `numbers` of filaments (V,) that a step adds: a concentration (V,)."""
        rest = np.zeros_like(numbers)
        return self.model.scalar_solver.solve(self._entries, numbers, guess=rest)
