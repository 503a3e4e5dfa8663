"""Whether a cell is steady: its relative rate of change, and the growth rate of perturbations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import Geometry, geometry, volume_centroid
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import angular_velocity, free_axes, rotation
from amoeboid.surface.stability import MAX_ERROR, Growth
from amoeboid.surface.state import Flow, State
from amoeboid.surface.transport import rate_of_change

# A cell is steady if its relative rate of change, without slow rigid rotation, is below this, in
# units of model.rate.
STEADY = 1e-5
# A state is unstable if the growth rate of perturbations is above this, in units of model.rate. The
# value is the error of the growth rate; slower growth has little effect in a run of default length.
UNSTABLE = MAX_ERROR
# A cell that was steady changes again if its relative rate of change exceeds this multiple of
# STEADY.
CHANGED = 3.0
# Growth that has not appeared within this multiple of its growth time 1/lambda is not waited for
# any longer: the mesh does not resolve it, or it oscillates so fast that the time steps damp it.
MAX_GROWTH_TIMES = 20.0
# Rigid rotation with a smaller angular velocity, in units of model.rate, is excluded from the rate
# of change: no force holds the axis of a straight cell, and discretization errors rotate it
# slightly.
SLOW_ROTATION = 0.02
ROTATION_CORRECTIONS = 2


@dataclass(frozen=True)
class Rest:
    """A cell that no longer changes: the time since when [T], and the growth of perturbations."""

    since: float
    growth: Growth


def own_rate(model: Model, state: State, flow: Flow) -> tuple[float, Array]:
    """Largest relative rate of change in axes that rotate with the cell, in units of model.rate.

    And the angular velocity (3,) of these. A cell on a circle or a helix changes in others.
    """
    g = geometry(state.r, model.mesh.faces)
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    v, omega = flow.v, np.zeros(3)
    for _ in range(ROTATION_CORRECTIONS):
        more = angular_velocity(model, state.r, state.c, g, v)
        v, omega = v - rotation(more, x), omega + more
    return _change(model, state, flow, g, v), omega


def _change(model: Model, state: State, flow: Flow, g: Geometry, v: Array) -> float:
    """The largest relative rate of change with velocity v (V, 3), in units of model.rate."""
    p = model.parameters
    c_rate = rate_of_change(model, state.c, g, v) / max(p.c0, np.abs(state.c).max())
    r_rate = np.einsum("vi,vi->v", v, flow.normals) / p.R0
    return float(max(np.abs(c_rate).max(), np.abs(r_rate).max()) / model.rate)


def relative_rate(model: Model, state: State, flow: Flow) -> tuple[float, bool]:
    """Largest relative rate of change, in units of model.rate, and whether the cell is steady."""
    p = model.parameters
    g = geometry(state.r, model.mesh.faces)
    c_scale = max(p.c0, np.abs(state.c).max())
    x = state.r - volume_centroid(state.r, model.mesh.faces)

    def free(omega: Array) -> Array:
        """The part of an angular velocity about axes on which a cue does not act."""
        if model.cue is None:
            return omega
        axes = free_axes(model, state.r)
        return np.asarray(axes.T @ (axes @ omega))

    rate = _change(model, state, flow, g, flow.v)
    known = np.full(3, np.inf) if state.angular_velocity is None else state.angular_velocity
    if rate >= STEADY and np.linalg.norm(known) < SLOW_ROTATION * model.rate:
        # in axes that rotate with the cell, where a rigidly rotating cell does not change; the
        # angular velocity is damped, so that the remaining rotation is removed repeatedly
        v = flow.v - rotation(free(known), x)
        for _ in range(ROTATION_CORRECTIONS):
            v -= rotation(free(angular_velocity(model, state.r, state.c, g, v)), x)
        rate = min(rate, _change(model, state, flow, g, v))
    # A small polarization that grows at lambda_1 also changes slowly.
    amplitude = np.linalg.norm(3.0 * (g.node_areas * state.c) @ x) / (model.A0 * p.R0 * c_scale)
    growth = model.growth_rate * amplitude / model.rate
    return rate, bool(rate < STEADY and not (growth > 0 and rate > 0.1 * growth))
