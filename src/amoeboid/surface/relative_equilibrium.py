"""A cell that changes only by a rigid motion, as the fixed point of one implicit iteration.

Straight, circling and helical cells are steady in a frame that moves with a velocity and an angular
velocity (relative equilibria). Both are unknowns. In turn, the position of the cell relative to the
nodes is fixed: perturbations of shape and concentration by rigid motions are excluded. Then the
equations have isolated solutions, on any mesh and wherever the cell lies on it.

One iteration is an implicit Euler step of length dt from a state to itself, with the operators of
the force balance and of the transport factorized once, in a `base` state nearby. Unknowns are
c/(c0 + c) and the height h/R0 of the nodes along the normals of the base, relative to it. Its fixed
points depend neither on dt nor on the base but for the place of the nodes within the surface: the
equations hold on the shape itself.

The filament number c0 A0 is a condition of its own, as in the axisymmetric solver: for beta > 0 it
follows from the turnover, but slowly where that is slow; for beta = 0 any number would be steady.
The concentration is scaled to it in each iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import Geometry, geometry, normal_part
from amoeboid.surface.force_balance import factorized_cortex, force_balance, turning_responses
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import rigid_changes
from amoeboid.surface.stepping import StepFailed, tension_for_area
from amoeboid.surface.transport import gained, implicit_matrix


@dataclass(frozen=True, eq=False, repr=False)
class Moving:
    """A cell in a frame that moves with it: nodes, concentration, tension, flow.

    `v_c` (V, 3) is relative to the frame, which rotates with `angular_velocity` (3,).
    """

    r: Array
    c: Array
    zeta0: float
    v_c: Array
    angular_velocity: Array

    def __repr__(self) -> str:
        return f"Moving({len(self.r)} nodes, zeta0 = {self.zeta0:.6g})"


class ImplicitMap:
    """One implicit iteration around a `base`; see the module. Raises SingularMatrix.

    A vector z holds the unknowns (2V,), which are scaled to about 1, then the angular velocity, the
    tension and v_c, in units of the rate, of delta_P R0 + eta_s rate, and of rate R0.
    """

    def __init__(self, model: Model, base: Moving, dt: float) -> None:
        self.model, self.base, self.dt = model, base, dt
        p, faces = model.parameters, model.mesh.faces
        self.n = len(base.c)
        self.g = geometry(base.r, faces)
        self._scale = p.c0 + base.c
        self._units = (model.rate, p.delta_P * p.R0 + p.eta_s * model.rate, model.rate * p.R0)
        self._start = np.concatenate([base.c / self._scale, np.zeros(self.n)])
        self._factorized = factorized_cortex(
            model, base.r, base.c, self.g, dt, base.zeta0, base.v_c
        )
        v = self._velocity(model, base, self.g)[0]
        u = v - normal_part(v, self.g.normals)
        self._transport = model.scalar_solver.factor(implicit_matrix(model, self.g, u, dt)[0])
        self._excluded, shares, motions = rigid_changes(model, base.r, base.c, self.g)
        self._frame_rates = model.rate * shares @ motions[:, 3:]
        self._frame_velocities = self._of_frame(shares, model.rate * motions)
        self._frame_images = self._images(u, self._frame_velocities)
        self._inverse = np.linalg.inv(self._excluded.T @ self._frame_images)

    def vector(self, cell: Moving) -> Array:
        """The vector z of a cell; how its nodes lie within the surface is left out."""
        rate, tension, speed = self._units
        h = np.einsum("vi,vi->v", cell.r - self.base.r, self.g.normals)
        rest = [*cell.angular_velocity / rate, cell.zeta0 / tension]
        x = [cell.c / self._scale, h / self.model.parameters.R0]
        return np.concatenate([*x, rest, cell.v_c.ravel() / speed])

    def cell(self, z: Array) -> Moving:
        """The cell of a vector z, with c >= 0."""
        n, (rate, tension, speed) = self.n, self._units
        h, rest = z[n : 2 * n, None] * self.model.parameters.R0, z[2 * n :]
        return Moving(
            r=self.base.r + h * self.g.normals,
            c=np.maximum(z[:n] * self._scale, 0.0),
            zeta0=float(rest[3] * tension),
            v_c=rest[4:].reshape(-1, 3) * speed,
            angular_velocity=rest[:3] * rate,
        )

    def image(self, z: Array, model: Model | None = None) -> Array:
        """The vector after one iteration, with the parameters of `model` if they are others.

        Raises StepFailed, InvalidInput.
        """
        model, cell = model or self.model, self.cell(z)
        p, dt = self.model.parameters, self.dt
        g = geometry(cell.r, model.mesh.faces)
        v, v_p = self._velocity(model, cell, g)
        zeta0 = cell.zeta0 + self._missing_tension(model, cell.r, v, g)
        v = v + (zeta0 - cell.zeta0) * self._factorized.dv_dzeta0
        h = z[self.n : 2 * self.n] + dt / p.R0 * np.einsum("vi,vi->v", v, g.normals)
        gain = gained(model, cell.c, g, v - normal_part(v, g.normals))
        c = cell.c + self._transport.solve(dt * gain)
        number = float(g.node_areas @ cell.c)
        if not number > 0.0:
            raise StepFailed("the cell has lost all its filaments")
        c = c * (model.parameters.c0 * model.A0 / number) / self._scale
        x = np.concatenate([c, h])
        # the motion of the frame that keeps the cell in its place on the nodes
        kept = -self._inverse @ (self._excluded.T @ (x - self._start))
        v = v + np.tensordot(kept, self._frame_velocities, 1)
        omega = cell.angular_velocity + kept @ self._frame_rates
        after = Moving(cell.r, cell.c, zeta0, v - v_p, omega)
        return np.concatenate([x + self._frame_images @ kept, self.vector(after)[2 * self.n :]])

    def _velocity(self, model: Model, cell: Moving, g: Geometry) -> tuple[Array, Array]:
        """v and v_p (V, 3) relative to the frame, at the tension of the cell."""
        found = force_balance(
            model, self._factorized, cell.r, g, cell.c, cell.zeta0,
            v_c=cell.v_c, turning=cell.angular_velocity,
        )  # fmt: skip
        return found.v(cell.zeta0), found.v_p

    def _missing_tension(self, model: Model, r: Array, v: Array, g: Geometry) -> float:
        """The tension beside that of v (V, 3) that keeps the area, with motion along the base."""
        v_n, dv_n = (
            np.einsum("vi,vi->v", velocity, g.normals)[:, None] * self.g.normals
            for velocity in (v, self._factorized.dv_dzeta0)
        )
        return tension_for_area(model, r + self.dt * v_n, self.dt * dv_n, 0.0)[1]

    def _of_frame(self, shares: Array, motions: Array) -> Array:
        """Changes (k, V, 3) of the velocity by such shares (k, m) of motions of the frame."""
        R0 = self.model.parameters.R0
        base = self.base
        fields = [np.broadcast_to(-R0 * motion[:3], base.r.shape) for motion in motions[:3]]
        turned = turning_responses(
            self.model, self._factorized, base.r, self.g, base.c, base.v_c, base.angular_velocity
        )
        fields.extend(np.tensordot(motions[3:, 3:], turned, 1))
        return np.tensordot(shares, np.stack(fields), 1)

    def _images(self, u: Array, velocities: Array) -> Array:
        """Changes (2V, k) of the unknowns in one iteration by such changes of the velocity."""
        model, normals, images = self.model, self.g.normals, []
        before = gained(model, self.base.c, self.g, u)
        for w in velocities:
            gain = gained(model, self.base.c, self.g, u + w - normal_part(w, normals)) - before
            h = self.dt / model.parameters.R0 * np.einsum("vi,vi->v", w, normals)
            images.append(np.concatenate([self._transport.solve(self.dt * gain) / self._scale, h]))
        return np.stack(images, axis=1)
