"""The equilibrium shape for a given concentration, and the flow in a given state."""

from __future__ import annotations

import numpy as np

from amoeboid.meshes.geometry import geometry
from amoeboid.surface.force_balance import factorized_cortex, force_balance
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.surface.stepping import StepFailed, area_preserving_move

# Step of the relaxation in units of 1/model.rate, long, so that tension dominates.
RELAXATION_STEP = 100.0
# A shape counts as being at rest if its normal speed is below this, in units of rate R0.
MAX_SPEED_AT_REST = 1e-3


def flow_of(model: Model, state: State, dt: float) -> Flow:
    """The flow in `state`, with the tension that keeps the area over the next dt."""
    g = geometry(state.r, model.mesh.faces)
    factorized = factorized_cortex(model, state.r, state.c, g, dt, state.zeta0)
    solution = force_balance(model, factorized, state.r, g, state.c, state.zeta0)
    _, zeta0 = area_preserving_move(model, state.r, g, solution, dt, state.zeta0)
    return Flow(solution.v(zeta0) - solution.v_p, solution.v_p, zeta0, g.normals, g.node_areas)


def relaxed(model: Model, state: State, tolerance: float = 1e-9, max_steps: int = 200) -> State:
    """`state` with its shape at rest under its present, frozen concentration.

    A polyhedral sphere is not a discrete equilibrium: at delta_P R0/(eta_s rate) = 300 its
    imbalance would drive flows larger than those of a small perturbation. Without pressure there is
    hardly any imbalance, but the shape also converges slowly; a small speed is then sufficient.
    Raises StepFailed.
    """
    dt = RELAXATION_STEP / model.rate
    factorized, v_c, change = None, None, np.inf
    for _ in range(max_steps):
        g = geometry(state.r, model.mesh.faces)
        if factorized is None:
            factorized = factorized_cortex(model, state.r, state.c, g, dt, state.zeta0)
        solution = force_balance(model, factorized, state.r, g, state.c, state.zeta0, v_c=v_c)
        moved, zeta0 = area_preserving_move(model, state.r, g, solution, dt, state.zeta0)
        before, change = change, np.abs(moved - state.r).max() / model.parameters.R0
        v_c = solution.v(zeta0) - solution.v_p
        state = State(state.t, moved, state.c, zeta0, state.position)
        if change < tolerance:
            return state
        if change > before:  # too far from the shape that was factorized
            factorized, v_c = None, None
    flow = flow_of(model, state, 1e-2 / model.rate)
    speed = np.abs(np.einsum("vi,vi->v", flow.v, flow.normals)).max()
    if not speed < MAX_SPEED_AT_REST * model.rate * model.parameters.R0:
        raise StepFailed(f"the initial shape does not come to rest; it still moves at {speed:.3g}")
    return state
