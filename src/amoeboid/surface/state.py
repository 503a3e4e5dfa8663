"""The state of the 3D cell, and the flow that one evaluation of the force balance gives."""

from __future__ import annotations

from dataclasses import dataclass

from amoeboid.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class State:
    """A cell at time t [T]: nodes r (V, 3) [L], c (V,) [N/L^2], tension zeta0 [M/T^2].

    The nodes are relative to a frame that follows the cell. `position` (3,) [L]: the path of the
    cell if all drag is on the cortex, uniformly, that is in the frame where the mean cortex
    velocity vanishes. `angular_velocity` (3,) [1/T]: that of shape and concentration, relative to
    fixed axes; None if no step on this mesh has led to this state.
    """

    t: float
    r: Array
    c: Array
    zeta0: float
    position: Array
    angular_velocity: Array | None = None

    def __repr__(self) -> str:
        return f"State(t = {self.t:.6g}, {len(self.r)} nodes, zeta0 = {self.zeta0:.6g})"


@dataclass(frozen=True, eq=False, repr=False)
class Flow:
    """Velocities at the nodes (V, 3), in the frame of the nodes, and the tension.

    v_c is the cortex velocity, v_p the polymerization velocity; v = v_c + v_p moves the shape.
    `normals` (V, 3) point outward, `node_areas` (V,) are the areas of the nodes [L^2]. Velocities
    are [L/T], the tension `zeta0` is [M/T^2].
    """

    v_c: Array
    v_p: Array
    zeta0: float
    normals: Array
    node_areas: Array

    @property
    def v(self) -> Array:
        """Full velocity v = v_c + v_p (V, 3) [L/T]."""
        return self.v_c + self.v_p

    def __repr__(self) -> str:
        return f"Flow({len(self.v_c)} nodes, zeta0 = {self.zeta0:.6g})"
