"""The state of the 3D cell, and the flow that one evaluation of the force balance gives."""

from __future__ import annotations

from dataclasses import dataclass

from amoeboid.arrays import Array


@dataclass(frozen=True, eq=False)
class State:
    """A cell at time t: nodes r (V, 3), concentration c (V,), tension zeta0.

    The nodes live in a frame that follows the cell; `position` (3,) is how far the cell has come
    if all drag is on the cortex, uniformly: in the frame where the mean cortex velocity vanishes.
    `turning` (3,) [1/T]: the rate at which shape and concentration turn, in axes that do not; None
    where no step on this mesh has led here.
    """

    t: float
    r: Array
    c: Array
    zeta0: float
    position: Array
    turning: Array | None = None


@dataclass(frozen=True, eq=False)
class Flow:
    """Velocities at the nodes (V, 3) in the frame of the nodes, and the tension with them.

    v_c cortex velocity, v_p polymerization velocity; v = v_c + v_p moves the shape. `normals`
    (V, 3) outward, `node_areas` (V,) their share of the area.
    """

    v_c: Array
    v_p: Array
    zeta0: float
    normals: Array
    node_areas: Array

    @property
    def v(self) -> Array:
        """Full velocity v = v_c + v_p."""
        return self.v_c + self.v_p
