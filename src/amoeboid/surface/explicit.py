"""One explicit step, the algorithm of the paper (SI, numerical procedure), for comparison.

Euler's method with a fixed step. Conjugate gradients give the cortex velocity and the tension under
the linear constraint that the area changes by the missing amount, (A0 - A)/dt; they start from
the flow of the previous step. Nodes move with the full velocity v, so that the concentration obeys
the Lagrangian balance dc/dt = -(div_s v) c + D lap_s c + beta (c0 - c); the advective form printed
beside the algorithm would count v.grad c twice. Then the nodes are moved back along the surface,
and c is interpolated at their new places.

Tension and isotropic stress are the exact derivatives of the energy (SI `energy`), without the
normal projection of `force_balance`; pressure is that of `force_balance`, so that both start from
one equilibrium. The stiff shape modes limit the step: to less than 1e-4 on 642 nodes at delta_P
R0/(eta_s rate) = 300, in inverse proportion to delta_P and number of nodes.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.bending import bending_gradient
from amoeboid.meshes.geometry import (
    Geometry,
    area,
    area_gradient,
    geometry,
    normal_part,
    scatter,
    volume_centroid,
    weighted_area_gradient,
)
from amoeboid.meshes.operators import advection, scalar_matrix, stiffness
from amoeboid.meshes.relaxation import relaxation
from amoeboid.numerics.conjugate_gradients import constrained_minimum
from amoeboid.surface.dissipation import dissipation_blocks
from amoeboid.surface.force_balance import pressure_force
from amoeboid.surface.frame import Drag, rigid_motions
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.surface.stepping import StepFailed, check_step

# Share of the way to the middle of their triangles that nodes go in one unit of model.rate: twice
# that of the semi-implicit scheme, as there is no remeshing to help. Steady states do not depend on
# it.
MESH_RELAXATION = 2.0
# Residual force left by the conjugate gradients, relative to the pressure force plus the viscous
# force of a flow at model.rate.
RESIDUAL = 1e-7
# Conjugate gradients need some hundred iterations from nothing and a few from the previous flow.
MAX_ITERATIONS = 100_000
# |A/A0 - 1| after a step that is no error of order dt^2 any more: stable steps leave under 1e-5.
MAX_AREA_ERROR = 1e-3


def explicit_step(
    model: Model, state: State, dt: float, flow: Flow | None = None
) -> tuple[State, Flow]:
    """The state after dt, and the flow that led there; `flow` is the one of the previous step.

    Raises StepFailed: the step is too long for the stiff shape modes, or the cell has deformed
    more than its mesh can follow.
    """
    model = model.at(state.t, since=state.t)  # Euler's method: what acts as the step begins
    mesh, r, c = model.mesh, state.r, state.c
    g = geometry(r, mesh.faces)
    v_p = model.v_p(r, c)[:, None] * g.normals
    start = np.zeros_like(r) if flow is None else flow.v_c
    v_c, zeta0 = constrained_flow(model, state, g, v_p, dt, start)
    v = v_c + v_p
    c_moved = c + dt * lagrangian_rate(model, c, g, v)

    drift = frame_velocity(g, v)
    back = redistribution(model, r, g, v - drift, dt)
    moved = r + dt * (v - drift) + back
    shift = volume_centroid(moved, mesh.faces) - volume_centroid(r, mesh.faces)
    new = State(
        state.t + dt,
        moved - shift,
        interpolated(model, c_moved, g, back),
        zeta0,
        state.position + dt * drift + shift,
    )
    if not new.c.min() >= 0:
        raise StepFailed(f"the concentration became negative: {new.c.min():.3g}")
    check_step(model, state, new)
    wrong = abs(area(new.r, mesh.faces) / model.A0 - 1.0)
    if wrong > MAX_AREA_ERROR:
        raise StepFailed(
            f"the step is too long for the stiff shape modes: the relative area error {wrong:.2g} "
            f"exceeds {MAX_AREA_ERROR:g}; lower time.max_step"
        )
    return new, Flow(v_c - drift, v_p, zeta0, g.normals, g.node_areas)


def constrained_flow(
    model: Model, state: State, g: Geometry, v_p: Array, dt: float, start: Array
) -> tuple[Array, float]:
    """Cortex velocity (V, 3) and the tension.

    Without mean translation, and without friction without mean rotation.

    SI `forcebalance2`, with dA/dr.(v_c + v_p) = (A0 - A)/dt. Raises StepFailed.
    """
    p, mesh, r = model.parameters, model.mesh, state.r
    force = p.delta_P * pressure_force(r, g, mesh.faces)
    if p.has_isotropic_stress:
        force -= weighted_area_gradient(g, mesh.faces, p.tau(state.c)[mesh.faces].mean(axis=1))
    if p.kappa > 0:
        force -= p.kappa * bending_gradient(r, g, mesh.faces)
    per_area = area_gradient(g, mesh.faces)
    wanted = (model.A0 - g.area) / dt - np.sum(per_area * (v_p + start))
    start = start + wanted / np.sum(per_area**2) * per_area
    viscous = (p.eta_s + p.eta_b) * model.rate * np.linalg.norm(per_area)
    least = RESIDUAL * float(np.linalg.norm(force) + viscous)
    dissipation, drag = dissipation_blocks(g, mesh, p.eta_s, p.eta_b), Drag.on(model, g, state.c)
    if drag is not None:
        dissipation[model.diagonal] += drag.of_cortex
        force -= drag.resisting(np.zeros_like(r), v_p)
    found = constrained_minimum(
        dissipation,
        mesh.columns,
        mesh.row_start,
        force,
        per_area,
        start,
        least,
        MAX_ITERATIONS,
    )
    if not found.residual <= least:
        raise StepFailed(
            f"the conjugate gradients stopped at a residual force of {found.residual:.3g} after "
            f"{found.iterations} iterations"
        )
    if drag is not None:  # friction tells the rotation
        return found.x - g.node_areas @ found.x / g.area, found.multiplier
    rigid = rigid_motions(r, g)
    weighted = np.repeat(g.node_areas, 3)[:, None] * rigid
    share = np.linalg.solve(rigid.T @ weighted, weighted.T @ found.x.ravel())
    return found.x - (rigid @ share).reshape(-1, 3), found.multiplier


def lagrangian_rate(model: Model, c: Array, g: Geometry, v: Array) -> Array:
    """dc/dt (V,) at nodes that move with v [N/(L^2 T)]; main text `cdot`."""
    p, mesh = model.parameters, model.mesh
    divergence = g.face_areas * np.einsum("fai,fai->f", g.gradients, v[mesh.faces])
    corners = c[mesh.faces]
    # integral of phi_a c over a triangle, c linear: area (sum of c + c_a) / 12
    diluted = divergence[:, None] * (corners.sum(axis=1, keepdims=True) + corners) / 12.0
    loss = scatter(diluted[:, :, None], mesh.faces, len(c))[:, 0]
    spread = p.D * (scalar_matrix(stiffness(g, mesh), mesh) @ c)
    return np.asarray(-(loss + spread) / g.node_areas + p.beta * (p.c0 - c))


def frame_velocity(g: Geometry, v: Array) -> Array:
    """The translation (3,) whose normal part comes closest to that of v (V, 3) [L/T]."""
    weighted = g.node_areas[:, None] * g.normals
    v_n = np.einsum("vi,vi->v", v, g.normals)
    return np.linalg.solve(weighted.T @ g.normals, v_n @ weighted)


def redistribution(model: Model, r: Array, g: Geometry, v: Array, dt: float) -> Array:
    """Tangential move (V, 3) of nodes that v has carried along for dt.

    Back to where only the normal part of v would have brought them, and by a small share towards
    the middle of their triangles.
    """
    drift = min(0.5, MESH_RELAXATION * model.rate * dt) * relaxation(r, g, model.mesh)
    return drift - dt * (v - normal_part(v, g.normals))


def interpolated(model: Model, c: Array, g: Geometry, move: Array) -> Array:
    """Concentration (V,) at nodes that have been moved by `move` (V, 3) along the surface.

    c + move.grad c on every triangle, then the mean around each node, weighted by its hat function.
    The number of filaments is kept up to the angles between triangles, a second-order error.
    """
    mesh = model.mesh
    gradient = scalar_matrix(advection(g, mesh, move), mesh).T
    return np.asarray(c + gradient @ c / g.node_areas)
