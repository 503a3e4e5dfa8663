"""The rigid motions of the cell in the force balance, which viscosity does not resist.

The frame follows the cell: the center of its volume is at rest. Without friction a convention tells
how the cell rotates in it, as nothing in the force balance does: the cortex has no mean rotation.
With friction nothing is free. Drag acts on the velocity relative to the surroundings, v + U, and
the velocity U of the cell is the one at which no net force of the surroundings is left; the torque
of the surroundings vanishes in the same way, so that the rotation of the cell is part of v.

Forces of the discretization that have a net force or torque (the module `force_balance` names them)
must not move the cell. Without friction, free motions take them up; with friction, forces and
torques spread over the surface balance them, so that the drag is what vanishes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.forces.friction import resistances
from amoeboid.meshes.geometry import Geometry, area_centroid, volume_centroid
from amoeboid.numerics.compiled import compiled
from amoeboid.numerics.sparse import Factor
from amoeboid.surface.model import Model


@dataclass(frozen=True, eq=False)
class Drag:
    """Friction at the nodes, matrices (V, 3, 3) [M/T]: on v_c, the cortex, and on v_p, the rest."""

    of_cortex: Array
    of_growth: Array

    @classmethod
    def on(cls, model: Model, g: Geometry, c: Array) -> Drag | None:
        """That of a shape with concentration c (V,); None without friction."""
        p = model.parameters
        if not p.has_friction:
            return None
        of_v, of_v_c = resistances(p, c, g.normals, g.node_areas)
        return cls(of_v + of_v_c, of_v)

    def resisting(self, v_c: Array, v_p: Array) -> Array:
        """Minus the forces (V, 3) on a cell that moves with v_c + v_p, each (V, 3)."""
        resisted = np.einsum("vij,vj->vi", self.of_cortex, v_c)
        return np.asarray(resisted + np.einsum("vij,vj->vi", self.of_growth, v_p))


@dataclass(frozen=True, eq=False)
class FreeFrame:
    """Without friction: `free` (3V, 6) are three translations and three responses to torques."""

    free: Array

    def at(
        self, model: Model, r: Array, g: Geometry, c: Array, v_p: Array, turned: Array | None
    ) -> FreeMotions:
        """The frame on the shape r (V, 3), where v_p is (V, 3).

        `turned` (V, 3): the velocity of the nodes with rotating axes, None where these are fixed.
        """
        kept = Constraints.on(r, g, model.mesh.faces)
        drift = np.concatenate([kept.of(v_p)[:3], np.zeros(3)])
        if turned is not None:
            drift[3:] = kept.of(turned)[3:]
        return FreeMotions(self.free, kept, drift)


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """The constraints `kept`, and what v_p and the frame contribute to them, `drift` (6,)."""

    free: Array
    kept: Constraints
    drift: Array | float

    def force(self, v_c: Array | None) -> Array:
        """Forces (V, 3) of the surroundings: none."""
        return np.zeros((len(self.free) // 3, 3))

    def fulfilled(self, v_c: Array) -> Array:
        """v_c (3V,) as (V, 3), plus free motions to fulfill the constraints.

        The forces that drive these motions vanish with the time step and the mesh width.
        """
        excess = self.kept.of(v_c) + self.drift
        free = self.free @ np.linalg.solve(self.kept.of(self.free), excess)
        return np.asarray((v_c - free).reshape(-1, 3))


def free_frame(
    model: Model, factor: Factor, r: Array, g: Geometry, force: Array
) -> tuple[FreeFrame, Array]:
    """The frame of the factorized shape, and the velocity (V, 3) that `force` (3V, 1) drives."""
    motions, areas = rigid_motions(r, g), np.repeat(g.node_areas, 3)[:, None]
    response = factor.solve(np.hstack([force, areas * motions[:, 3:]]))
    frame = FreeFrame(np.hstack([motions[:, :3], response[:, 1:]]))
    kept = Constraints.on(r, g, model.mesh.faces)
    return frame, FreeMotions(frame.free, kept, 0.0).fulfilled(response[:, 0])


@dataclass(frozen=True, eq=False)
class ResistedFrame:
    """With friction: `responses` (3V, 9) to the drag of a translation, and to forces and torques.

    The first three are those to a velocity of the cell along the axes.
    """

    responses: Array
    drag: Drag

    def at(
        self, model: Model, r: Array, g: Geometry, c: Array, v_p: Array, turned: Array | None
    ) -> ResistedMotions:
        """See FreeFrame.at."""
        drag = Drag.on(model, g, c)
        assert drag is not None  # noqa: S101  # the parameters are those that were factorized
        carried = np.zeros_like(r) if turned is None else turned
        kept = Constraints.on(r, g, model.mesh.faces)
        return ResistedMotions(self, drag, kept, rigid_motions(r, g), v_p, carried)


@dataclass(frozen=True, eq=False)
class ResistedMotions:
    """The friction on one shape: of `kept` the first three keep the center at rest.

    `motions` (3V, 6): the rigid ones.
    """

    frame: ResistedFrame
    drag: Drag
    kept: Constraints
    motions: Array
    v_p: Array
    carried: Array

    def force(self, v_c: Array | None) -> Array:
        """Forces (V, 3) on known velocities, and with an estimate `v_c` what the shape changes."""
        known = -self.frame.drag.resisting(self.carried, self.v_p)
        if v_c is None:
            return known
        here = self.drag.resisting(v_c + self.carried, self.v_p)
        moved = self._resisting(self.motions[:, :3])
        net = self.motions[:, :3].T
        U = -np.linalg.solve(net @ moved, net @ here.ravel())
        v = v_c + self.carried + U
        change = self.frame.drag.resisting(v, self.v_p) - self.drag.resisting(v, self.v_p)
        return np.asarray(known + change)

    def fulfilled(self, v_c: Array) -> Array:
        """v_c (3V,) as (V, 3), with the velocity of the cell at which its drag vanishes."""
        responses, motions = self.frame.responses, self.motions
        moved = self._resisting(responses)
        moved[:, :3] += self._resisting(motions[:, :3])
        at_rest = self.drag.resisting(v_c.reshape(-1, 3) + self.carried, self.v_p).ravel()
        matrix = np.vstack([self.kept.of(responses)[:3], motions.T @ moved])
        drift = self.kept.of(v_c + self.v_p.ravel())[:3]
        excess = np.concatenate([drift, motions.T @ at_rest])
        return np.asarray((v_c - responses @ np.linalg.solve(matrix, excess)).reshape(-1, 3))

    def _resisting(self, motions: Array) -> Array:
        """Minus the drag (3V, k) on motions (3V, k) of the cortex."""
        columns = motions.reshape(len(self.v_p), 3, -1)
        return np.asarray(
            np.einsum("vij,vjk->vik", self.drag.of_cortex, columns).reshape(motions.shape)
        )


def resisted_frame(
    model: Model, factor: Factor, r: Array, g: Geometry, drag: Drag, force: Array
) -> tuple[ResistedFrame, Array]:
    """The frame of the factorized shape, and the velocity (V, 3) that `force` (3V, 1) drives."""
    motions, areas = rigid_motions(r, g), np.repeat(g.node_areas, 3)[:, None]
    translations = motions[:, :3].reshape(-1, 3, 3)
    moved = np.einsum("vij,vjk->vik", drag.of_cortex, translations).reshape(-1, 3)
    response = factor.solve(np.hstack([force, -moved, areas * motions]))
    frame = ResistedFrame(np.ascontiguousarray(response[:, 1:]), drag)
    still = np.zeros_like(r)
    kept = Constraints.on(r, g, model.mesh.faces)
    motion = ResistedMotions(frame, drag, kept, motions, still, still)
    return frame, motion.fulfilled(response[:, 0])


@dataclass(frozen=True, eq=False)
class Constraints:
    """Six sums over the velocities of the nodes that vanish in the frame of the cell.

    The first three apply to v = v_c + v_p: the volume times the velocity of its center. The other
    three apply to v_c: its rotation. `centered`, `about` (V, 3): the nodes as seen from the centers
    of volume and area.
    """

    centered: Array
    about: Array
    g: Geometry

    @classmethod
    def on(cls, r: Array, g: Geometry, faces: Index) -> Constraints:
        """Those on a shape r (V, 3)."""
        return cls(r - volume_centroid(r, faces), r - area_centroid(r, g), g)

    def of(self, velocities: Array) -> Array:
        """The sums (6, ...) of `velocities` (3V, ...) or (V, 3)."""
        g, v = self.g, velocities
        one = len(v) == len(g.normals) or v.ndim == 1
        # contiguous: of another layout, the kernel would be compiled once more
        columns = np.ascontiguousarray(v).reshape(len(g.normals), 3, -1)
        sums = _constrained(self.centered, self.about, g.node_areas, g.normals, columns)
        return np.asarray(sums[:, 0] if one else sums)


@compiled
def _constrained(centered, about, areas, normals, v):  # type: ignore[no-untyped-def]
    sums = np.zeros((6, v.shape[2]))
    for i in range(len(areas)):
        for k in range(v.shape[2]):
            x, y, z = areas[i] * v[i, 0, k], areas[i] * v[i, 1, k], areas[i] * v[i, 2, k]
            along = x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]
            for d in range(3):
                sums[d, k] += along * centered[i, d]
            sums[3, k] += about[i, 1] * z - about[i, 2] * y
            sums[4, k] += about[i, 2] * x - about[i, 0] * z
            sums[5, k] += about[i, 0] * y - about[i, 1] * x
    return sums


def rigid_motions(r: Array, g: Geometry) -> Array:
    """Three translations and three rotations about the center of area, columns (3V, 6)."""
    return np.asarray(_rigid_motions(r, area_centroid(r, g)).reshape(-1, 6))


@compiled
def _rigid_motions(r, center):  # type: ignore[no-untyped-def]
    motions = np.zeros((r.shape[0], 3, 6))
    for i in range(r.shape[0]):
        for d in range(3):
            motions[i, d, d] = 1.0
            # rotation about axis d: e_d x (r - center)
            p, q = (d + 1) % 3, (d + 2) % 3
            motions[i, p, 3 + d] = -(r[i, q] - center[q])
            motions[i, q, 3 + d] = r[i, p] - center[p]
    return motions
