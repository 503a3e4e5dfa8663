"""One semi-implicit time step: geometry, v_p(c), force balance, shape, concentration.

First order in time. Implicit: tension (on the normal motion), advection, diffusion, turnover;
explicit: v_p(c), which is no stiffer than the flow itself. The area is exact after every step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.force_balance import TensionFlow, force_balance
from amoeboid.surface.geometry import (
    Geometry,
    area,
    area_gradient,
    geometry,
    mesh_quality,
    normal_part,
    volume_centroid,
)
from amoeboid.surface.model import Flow, Model, State
from amoeboid.surface.relaxation import relaxation
from amoeboid.surface.transport import filaments, transported

Array = NDArray[np.float64]

AREA_TOLERANCE = 1e-13
ROUNDING = 1e-12
# A mesh with worse triangles than this (1 is equilateral) is no longer a discretization.
LEAST_QUALITY = 0.02
# Share of the way to their resting place that nodes drift in one unit of model.rate, at most half
# of it in one step.
MESH_RELAXATION = 2.0
# Step, in units of 1/model.rate, that brings a shape to rest: long, so that tension rules.
RELAXATION_STEP = 100.0
# Normal speed, in units of rate R0, of a shape that counts as resting.
RESTING = 1e-3


class StepFailed(ArithmeticError):
    """The step could not be made; the message says why. A shorter one may succeed."""


def semi_implicit_step(model: Model, state: State, dt: float) -> tuple[State, Flow]:
    """The state after dt, and the flow that led there. Raises StepFailed, SingularMatrix."""
    mesh, r = model.mesh, state.r
    g = geometry(r, mesh.faces)
    solution = force_balance(model, r, g, state.c, dt, state.zeta0)
    drift = min(0.5, MESH_RELAXATION * model.rate * dt) * relaxation(r, g, mesh)
    r_new, zeta0 = _area_preserving_move(model, r + drift, g, solution, dt, state.zeta0)

    v = solution.v(zeta0)
    mesh_velocity = (r_new - r) / dt
    g_new = geometry(r_new, mesh.faces)
    c_new = transported(model, filaments(state.c, g), g_new, v - mesh_velocity, dt)
    if c_new.min() < -ROUNDING * c_new.max():
        raise StepFailed(f"the concentration has become negative: {c_new.min():.3g}")
    c_new = np.maximum(c_new, 0.0)
    flow = Flow(v - solution.v_p, solution.v_p, zeta0, g.normals, g.node_areas)
    new = State(
        state.t + dt, r_new, c_new, zeta0, state.position + _progress(model, r, r_new, flow, dt)
    )
    _check(model, new, g, g_new)
    return new, flow


def flow_of(model: Model, state: State, dt: float) -> Flow:
    """The flow in `state`, with the tension that keeps the area over the next dt."""
    g = geometry(state.r, model.mesh.faces)
    solution = force_balance(model, state.r, g, state.c, dt, state.zeta0)
    _, zeta0 = _area_preserving_move(model, state.r, g, solution, dt, state.zeta0)
    return Flow(solution.v(zeta0) - solution.v_p, solution.v_p, zeta0, g.normals, g.node_areas)


def relaxed(model: Model, state: State, tolerance: float = 1e-9, most_steps: int = 200) -> State:
    """`state` with its shape at rest under its present, frozen concentration.

    A polyhedral sphere is no discrete equilibrium: at delta_P R0/(eta_s rate) = 300 its
    imbalance would drive flows that swamp a small perturbation. Without pressure there is next to
    no imbalance, but the shape also settles slowly; there it is enough that nothing moves fast.
    Raises StepFailed.
    """
    dt = RELAXATION_STEP / model.rate
    for _ in range(most_steps):
        g = geometry(state.r, model.mesh.faces)
        solution = force_balance(model, state.r, g, state.c, dt, state.zeta0)
        moved, zeta0 = _area_preserving_move(model, state.r, g, solution, dt, state.zeta0)
        change = np.abs(moved - state.r).max() / model.parameters.R0
        state = State(state.t, moved, state.c, zeta0, state.position)
        if change < tolerance:
            return state
    flow = flow_of(model, state, 1e-2 / model.rate)
    speed = np.abs(np.einsum("vi,vi->v", flow.v, flow.normals)).max()
    if not speed < RESTING * model.rate * model.parameters.R0:
        raise StepFailed(f"the initial shape does not come to rest, it moves at {speed:.3g}")
    return state


def _area_preserving_move(
    model: Model, start: Array, g: Geometry, solution: TensionFlow, dt: float, zeta0: float
) -> tuple[Array, float]:
    """Nodes moved by the normal velocity, with the tension that makes the area A0 (Newton)."""
    faces, A0 = model.mesh.faces, model.A0
    rest = start + dt * normal_part(solution.rest, g.normals)
    slope = dt * normal_part(solution.slope, g.normals)
    for _ in range(30):
        r = rest + zeta0 * slope
        excess = area(r, faces) - A0
        if not np.isfinite(excess):
            break
        if abs(excess) < AREA_TOLERANCE * A0:
            return r, zeta0
        growth = float(np.sum(area_gradient(geometry(r, faces), faces) * slope))
        if growth >= 0:
            break
        zeta0 -= excess / growth
    raise StepFailed("no tension keeps the area over this step")


def _progress(model: Model, r: Array, r_new: Array, flow: Flow, dt: float) -> Array:
    """How far the cell comes in the laboratory frame, where the mean cortex velocity vanishes."""
    shift = volume_centroid(r_new, model.mesh.faces) - volume_centroid(r, model.mesh.faces)
    mean_v_c = flow.node_areas @ flow.v_c / flow.node_areas.sum()
    return np.asarray(shift - dt * mean_v_c)


def _check(model: Model, new: State, g: Geometry, g_new: Geometry) -> None:
    if not (np.all(np.isfinite(new.r)) and np.all(np.isfinite(new.c)) and np.isfinite(new.zeta0)):
        raise StepFailed("a node position, concentration or tension is not finite")
    turned = np.einsum("fi,fi->f", g.face_normals, g_new.face_normals).min()
    if mesh_quality(new.r, model.mesh.faces) < LEAST_QUALITY:
        raise StepFailed(
            f"a triangle has degenerated (quality below {LEAST_QUALITY:g}): the cell deforms more "
            "than its mesh can follow; increase mesh.subdivisions or delta_P"
        )
    if turned <= 0:
        raise StepFailed("a triangle has turned over: the surface folds, or its mesh is too coarse")
