"""Whether a cell still changes, and what is known of it once it does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import geometry, volume_centroid
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import free_axes, spin, turning_rate
from amoeboid.surface.stability import SETTLED, Growth
from amoeboid.surface.state import Flow, State
from amoeboid.surface.transport import rate_of_change

# Relative change within 1/model.rate that counts as none, slow turning of the cell left out.
STEADY = 1e-5
# Growth rate of disturbances, in units of model.rate, above which a state is unstable: the error
# that it is found with. Slower growth makes little of a disturbance in a run of the default length.
UNSTABLE = SETTLED
# Relative change, in units of STEADY, that ends a rest.
CHANGED = 3.0
# An instability that has not shown after so many times the inverse of its growth rate is none of
# the run: of what the mesh does not resolve, or so fast an oscillation that its steps damp it.
PATIENCE = 20.0
# Slower turning, in units of model.rate, is left out of what changes: no force holds the axis of a
# straight cell, and a mesh turns it a little.
SLOW_TURNING = 0.02
FINER_TURNING = 2


@dataclass(frozen=True)
class Rest:
    """What is known of a cell that no longer changes: since when [T], and how fast small
    disturbances grow."""

    since: float
    growth: Growth


def relative_rate(model: Model, state: State, flow: Flow) -> tuple[float, bool]:
    """Largest relative rate of change, in units of model.rate, and whether that is none."""
    p = model.parameters
    g = geometry(state.r, model.mesh.faces)
    c_scale = max(p.c0, np.abs(state.c).max())
    x = state.r - volume_centroid(state.r, model.mesh.faces)

    def changing(v: Array) -> float:
        c_rate = rate_of_change(model, state.c, g, v) / c_scale
        r_rate = np.einsum("vi,vi->v", v, flow.normals) / p.R0
        return float(max(np.abs(c_rate).max(), np.abs(r_rate).max()) / model.rate)

    def free(turning: Array) -> Array:
        """Its part about axes that no cue holds the cell to."""
        if model.cue is None:
            return turning
        axes = free_axes(model, state.r)
        return np.asarray(axes.T @ (axes @ turning))

    rate = changing(flow.v)
    turning = np.full(3, np.inf) if state.turning is None else state.turning
    if rate >= STEADY and np.linalg.norm(turning) < SLOW_TURNING * model.rate:
        # what changes in axes that turn with the cell, where a cell that only turns is at rest; the
        # rate is damped, and what it leaves of the turning is taken off in turn
        v = flow.v - spin(free(turning), x)
        for _ in range(FINER_TURNING):
            v -= spin(free(turning_rate(model, state.r, state.c, g, v)), x)
        rate = min(rate, changing(v))
    # A small polarization that grows at lambda_1 also changes slowly.
    amplitude = np.linalg.norm(3.0 * (g.node_areas * state.c) @ x) / (model.A0 * p.R0 * c_scale)
    growth = model.growth_rate * amplitude / model.rate
    return rate, bool(rate < STEADY and not (growth > 0 and rate > 0.1 * growth))
