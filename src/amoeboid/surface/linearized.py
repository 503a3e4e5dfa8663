"""An implicit Euler step of small perturbations of a steady cell, with one factorization.

The equations of motion (force balance, area, filament balance) are those of the time step,
evaluated at a slightly perturbed state. Near a known flow the force balance takes one
back-substitution, which is exact to first order in the perturbation. The implicit step maps a
perturbation y before the step to the solution x of x = T x + S y; one iteration evaluates the right
side with one back-substitution. The iteration need not converge, because the linear equation
(1 - T) x = S y is solved by a method for linear equations.

A perturbation (2V,) consists of c'/(c0 + c) and h/R0, with the displacement h along the normals.
Displacements within the surface are excluded, and with them the many slow modes of the mesh. Nodes
rotate with the cell as they do in a run, because a mesh that does not rotate would hold or drive a
cell that starts to rotate. In rotating axes a cue changes its direction. The angles of the axes at
the end of the step are therefore unknowns as well, about the axes in which a cue tells the rotated
cell from the original one; the result is transformed back to axes that do not rotate. Without a cue
there are no such angles.
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
from amoeboid.surface.force_balance import (
    factorized_cortex,
    force_balance,
    turning_responses,
    velocity_of_motion,
)
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import (
    angular_response,
    changes,
    cue_axes,
    gradient,
    rotated,
    rotations,
)
from amoeboid.surface.state import Flow, State
from amoeboid.surface.transport import gained, implicit_matrix

# Size of the perturbation: nonlinear terms and rounding errors are small compared to it.
AMPLITUDE = 1e-6
# Flux correction compares the concentrations of neighbors, and the flows from one to the other and
# back. It has a kink where they are equal, as in a cell with the symmetry of its mesh. It is
# therefore linearized at concentrations and velocities that differ by random offsets of this size,
# relative to c0 + c and rate R0.
OFFSET = 1e-5


@dataclass(frozen=True, eq=False)
class RotatedCue:
    """A cue in axes that are rotated by the angles (3,)."""

    cue: Any
    angles: Array

    def factor(self, directions: Array, t: float) -> Array:
        """See Cue.factor; directions in the rotated axes."""
        return np.asarray(self.cue.factor(rotated(directions, self.angles, 1.0), t))


class LinearizedStep:
    """The linear map of small perturbations of `state` by an implicit Euler step of length dt.

    `flow`: the flow in the state, up to a small error, relative to axes with the angular velocity
    `turning` (3,), those of a cell on a circular path. Raises SingularMatrix, InvalidInput.
    """

    def __init__(
        self, model: Model, state: State, flow: Flow, dt: float, turning: Array | None = None
    ) -> None:
        self.model, self.state, self.dt = model, state, dt
        self._turning = np.zeros(3) if turning is None else turning
        self.g = geometry(state.r, model.mesh.faces)
        self._scale = model.parameters.c0 + state.c
        self._zeta0, self._v_c = flow.zeta0, flow.v_c
        self._factorized = factorized_cortex(
            model, state.r, state.c, self.g, dt, flow.zeta0, flow.v_c
        )
        dA_dr = area_gradient(self.g, model.mesh.faces)
        self._area_gradient = np.einsum("vi,vi->v", dA_dr, self.g.normals)
        zero = np.zeros(len(state.c))
        v = self._v = self._velocity(zero, zero, zero)[0]
        # change of the velocity in a frame with unit angular velocity around each axis, and by a
        # unit of tension (4, V, 3)
        turned = turning_responses(
            model, self._factorized, state.r, self.g, state.c, flow.v_c, self._turning
        )
        self._responses = np.stack([*turned, self._factorized.dv_dzeta0])
        self._response_n = np.einsum("kvi,vi->kv", self._responses, self.g.normals)
        self._turned_by = angular_response(model, state.r, state.c, self.g)
        self._v_n = np.einsum("vi,vi->v", v, self.g.normals)
        u = v - normal_part(v, self.g.normals)
        offset = OFFSET * np.random.default_rng(0).uniform(-1.0, 1.0, (len(zero), 4))
        self._c_offset = offset[:, 0] * self._scale
        self._u_offset = offset[:, 1:] * model.rate * model.parameters.R0
        self._gain = {side: self._gained(state.c, self.g, u, side) for side in (1, -1)}
        self._gain_by = {side: self._gains(u, side) for side in (1, -1)}
        self._transport = model.scalar_solver.factor(implicit_matrix(model, self.g, u, dt)[0])
        self._axes = cue_axes(model, state.r)
        self._tilts = self._tilted()
        self._equations = Recycling(self._defect, self.n)

    def image(self, y: Array, tolerance: float) -> Array:
        """The perturbation (2V,) after the step, from that before. Raises NoConvergence."""
        return self.in_fixed_axes(self._equations.solve(self.before(y), tolerance))

    def residual(self, x: Array, y: Array, tolerance: float) -> Array:
        """The error (2V,) of x (2V,) as the image of y (2V,). Raises NoConvergence.

        The equations are evaluated with the opposite sign of the perturbations and on the other
        side of the kinks, so that the error includes deviations from a linear map.
        """
        return self.in_fixed_axes(self._equations.solve(self.defect(x, y), tolerance))

    @property
    def n(self) -> int:
        """The number of unknowns of a step: 2V, and the angles about the k axes of a cue."""
        return 2 * len(self.state.c) + len(self._axes)

    def defect(self, x: Array, y: Array) -> Array:
        """By how much the equations (n,) are not fulfilled with x (2V,) as the image of y (2V,).

        On the other side; see `residual`.
        """
        unknowns = np.concatenate([x, np.zeros(len(self._axes))])
        if len(self._axes):
            angles = -self.iterate(-unknowns, -y)[len(x) :]
            unknowns = np.concatenate([x - self._tilts @ angles, angles])
        return self.iterate(-unknowns, -y, side=-1) + unknowns

    def in_fixed_axes(self, unknowns: Array) -> Array:
        """The perturbation (2V,) in axes that do not rotate."""
        count = 2 * len(self.state.c)
        x, angles = unknowns[:count], unknowns[count:]
        return x + self._tilts @ angles if len(angles) else x

    def _defect(self, unknowns: Array) -> Array:
        return unknowns - self.iterate(unknowns, np.zeros(2 * len(self.state.c)))

    def iterate(self, x: Array, y: Array, side: int = 1) -> Array:
        """T x + S y: an improved estimate of the perturbation after the step, from an estimate x.

        x (2V + k,) ends with the angles about the k axes of a cue; y (2V,) is the perturbation
        before the step. `side` (1 or -1): the side of the kinks of the flux correction; see
        `OFFSET`.
        """
        size = max(np.abs(x).max(), np.abs(y).max())
        if size == 0.0:
            return np.zeros_like(x)
        amplitude = AMPLITUDE / size
        angles = amplitude * x[len(y) :]
        (c_x, h_x), (c_y, h_y) = np.split(amplitude * x[: len(y)], 2), np.split(amplitude * y, 2)
        v, c, g = self._velocity(c_x, h_x, h_y, angles)
        return self._ended(v, c, g, c_x, c_y, h_y, side) / amplitude

    def before(self, y: Array) -> Array:
        """S y, `iterate` from x = 0: without a force balance, as the shape is that of the state."""
        size = np.abs(y).max()
        if size == 0.0:
            return np.zeros(self.n)
        amplitude = AMPLITUDE / size
        c_y, h_y = np.split(amplitude * y, 2)
        still = velocity_of_motion(
            self.model, self._factorized, self.state.r, self.g, self.state.c,
            self.model.parameters.R0 * h_y,
        )  # fmt: skip
        v, zero = self._v + still, np.zeros(len(c_y))
        return self._ended(v, self.state.c, self.g, zero, c_y, h_y, 1) / amplitude

    def _ended(
        self, v: Array, c: Array, g: Geometry, c_x: Array, c_y: Array, h_y: Array, side: int
    ) -> Array:
        """The perturbation (n,) at the end of a step with the velocity v (V, 3)."""
        R0, dt = self.model.parameters.R0, self.dt
        v_n = np.einsum("vi,vi->v", v, g.normals) - self._v_n
        gain = self._gained(c, g, v - normal_part(v, g.normals), side) - self._gain[side]
        # nodes rotate with the cell, and the tension keeps the area
        of_gain, of_v_n = self._turned_by
        omega = of_gain @ gain + of_v_n @ v_n
        h = h_y + dt / R0 * (v_n + omega @ self._response_n[:3])
        zeta0 = -(self._area_gradient @ h) / (self._area_gradient @ self._response_n[3]) * R0 / dt
        h += dt / R0 * zeta0 * self._response_n[3]
        gain += np.array([*omega, zeta0]) @ self._gain_by[side]
        numbers = self._areas(h_y) * (self.state.c + self._scale * c_y) - g.node_areas * c
        more = self._transport.solve(numbers + dt * gain)
        return np.concatenate([c_x + more / self._scale, h, dt * self._axes @ omega])

    def _velocity(
        self,
        c_x: Array,
        h_x: Array,
        h_y: Array,
        angles: Array | None = None,
    ) -> tuple[Array, Array, Geometry]:
        """Velocity (V, 3), c (V,) and geometry of the perturbed cell, at the tension of the state.

        Implicit tension acts on the motion of the shape beyond h_x. The velocity is relative to
        axes that turn as those of the state do, and are rotated by `angles` (k,) about the axes of
        the cue (None: 0).
        """
        model = self.model
        if angles is not None and len(angles):
            model = replace(model, cue=RotatedCue(model.cue, self._axes.T @ angles))
        c, r = self.state.c + self._scale * c_x, self._moved(h_x)
        g, ahead = geometry(r, self.model.mesh.faces), r - self._moved(h_y)
        solution = force_balance(
            model, self._factorized, r, g, c, self._zeta0, ahead, self._v_c, self._turning
        )
        return solution.v(self._zeta0), c, g

    def _tilted(self) -> Array:
        """The perturbations (2V, k) by rotations of the cell about the axes of the cue."""
        if not len(self._axes):
            return np.zeros((2 * len(self.state.c), 0))
        slope = gradient(self.state.c, self.g, self.model.mesh) / self._scale[:, None]
        x = self.state.r - volume_centroid(self.state.r, self.model.mesh.faces)
        motions = rotations(x, self._axes)
        return changes(motions, slope, self.g.normals, self.model.parameters.R0)

    def _gained(self, c: Array, g: Geometry, u: Array, side: int) -> Array:
        """Filaments (V,) that nodes gain per unit time, on one side of the kinks."""
        c, u = c + side * self._c_offset, u + side * self._u_offset
        return gained(self.model, c, g, u)

    def _gains(self, u: Array, side: int) -> Array:
        """Changes (4, V) of the gain by such changes of the velocity as `_responses`."""
        unit = AMPLITUDE * self.model.rate * self.model.parameters.R0
        changes = []
        for w in self._responses:
            step = unit / np.abs(w).max()
            moved = self._gained(
                self.state.c, self.g, u + step * (w - normal_part(w, self.g.normals)), side
            )
            changes.append((moved - self._gain[side]) / step)
        return np.stack(changes)

    def _areas(self, h: Array) -> Array:
        """Node areas (V,) at a height h R0."""
        return node_areas(self._moved(h), self.model.mesh.faces) if h.any() else self.g.node_areas

    def _moved(self, h: Array) -> Array:
        """Nodes (V, 3) at a height h R0 over those of the state."""
        return np.asarray(self.state.r + self.model.parameters.R0 * h[:, None] * self.g.normals)
