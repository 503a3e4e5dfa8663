"""Force balance of the cortex: div_s sigma + f_t + delta_P n = 0, solved for the velocity.

In the discrete variables K v_c = delta_P dV/dr - (zeta0 + tau) dA/dr, K the dissipation matrix.
Two things make a long time step stable and keep the flow clean:

*Implicit tension.* A shape that moves by dt v_n changes its tension force by about
-dt zeta0 L v_n, L the stiffness matrix. Added to K for the normal motion only, this term damps the
stiff shape modes (rate delta_P R0/eta_s); for the tangential motion it would be a false viscosity.
It acts on the difference between the motion in the step and the predicted one, and vanishes in a
steady state.

*Implicit bending.* The force of bending resists a normal motion by about dt kappa L A^-1 L, in the
same way: without it, a step would have to be as short as edge^4 eta_s/(kappa R0^2).

*Normal viscosity.* Where the Gaussian curvature is negative, a membrane resists some changes of its
shape with next to no viscosity. A small additional viscosity that resists gradients of v.n keeps
their speed finite. Its forces vanish in a steady state, where v.n = 0.

*Normal tension, and pressure on the same areas.* Tension and pressure depend on the shape alone,
so that they must do no work when nodes move within the surface. The exact dA/dr of a polyhedron has
a tangential part. It is a discretization error multiplied by the large zeta0, and would drive a
parasitic flow; it is left out. The normal part is the curvature times the dual area of the node.
The dual area differs from a third of the triangles around the node; at a node of valence five the
latter is 13 % smaller. Pressure therefore acts on dual areas as well: it then balances tension
exactly on a sphere, and on other shapes no node of valence five or seven is pushed out of the
surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.bending import BendingStiffness, bending_gradient
from amoeboid.meshes.geometry import (
    Geometry,
    area_centroid,
    area_gradient,
    volume,
    weighted_area_gradient,
)
from amoeboid.meshes.operators import (
    block_product,
    normal_blocks,
    normal_projection,
    product,
    stiffness,
    tensile_stiffness,
)
from amoeboid.numerics.compiled import compiled
from amoeboid.numerics.sparse import Factor, SingularMatrix
from amoeboid.surface.dissipation import dissipation_blocks, viscous_forces, viscous_stress
from amoeboid.surface.frame import (
    Drag,
    FreeFrame,
    ResistedFrame,
    free_frame,
    resisted_frame,
)
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import rotation

# Rigid modes have no viscous resistance. A friction of this share of the viscosity, spread over an
# area R0^2, makes the matrix regular; the constraints on translation and rotation then determine
# these modes. A fixed friction of every node would add up to a drag that grows with their number.
REGULARIZATION = 1e-7
# Viscosity that resists gradients of v.n, as a share of eta_s + eta_b; see the module.
NORMAL_VISCOSITY = 1e-3
# Ratio of the works of the pressure on the volume and on dual areas: at least this, at most 1/this.
MIN_FACTOR = 0.3


@dataclass(frozen=True, eq=False)
class TensionFlow:
    """The velocity as a linear function of the tension: v_at_zero_tension + zeta0 dv_dzeta0.

    Each (V, 3); `v_at_zero_tension` includes v_p (V, 3).
    """

    v_at_zero_tension: Array
    dv_dzeta0: Array
    v_p: Array

    def v(self, zeta0: float) -> Array:
        """Full velocity at tension zeta0, (V, 3)."""
        return self.v_at_zero_tension + zeta0 * self.dv_dzeta0


@dataclass(frozen=True, eq=False)
class FactorizedCortex:
    """The factorized operator of the force balance on one shape, for time steps dt.

    On the pattern of the mesh: `dissipation` (P, 3, 3) are the blocks of K; `tension` and `damping`
    (P,) are the implicit tension and the normal viscosity, along `normals` (V, 3), as `bending` is.
    `frame`: rigid motions. `dv_dzeta0` (V, 3): the velocity that a unit of tension drives.
    """

    dt: float
    dissipation: Array
    tension: Array
    damping: Array
    bending: BendingStiffness | None
    normals: Array
    factor: Factor
    frame: FreeFrame | ResistedFrame
    dv_dzeta0: Array


def factorized_cortex(
    model: Model,
    r: Array,
    c: Array,
    g: Geometry,
    dt: float,
    zeta0: float,
    v_c: Array | None = None,
) -> FactorizedCortex:
    """Assemble and factorize on the shape r (V, 3) with c (V,) for a step dt > 0.

    `zeta0` and `v_c` (V, 3; None: 0) are estimates of tension and flow, for the implicit tension.
    Raises SingularMatrix if the shape has degenerated.
    """
    p, mesh = model.parameters, model.mesh
    viscosity = p.eta_s + p.eta_b
    if v_c is None:
        v_c = np.zeros_like(r)
    stress = viscous_stress(g, mesh, v_c, p.eta_s, p.eta_b)
    np.einsum("fii->fi", stress)[:] += zeta0
    tension = normal_projection(tensile_stiffness(g, mesh, stress), g.normals, mesh)
    dissipation = dissipation_blocks(g, mesh, p.eta_s, p.eta_b)
    resistance = NORMAL_VISCOSITY * viscosity * stiffness(g, mesh)
    damping = normal_projection(resistance, g.normals, mesh)
    matrix = normal_blocks(damping + dt * tension, g.normals, mesh)
    matrix += dissipation
    shift = REGULARIZATION * viscosity * g.node_areas / p.R0**2
    np.einsum("pii->pi", matrix)[model.diagonal] += shift[:, None]
    drag = Drag.on(model, g, c)
    if drag is not None:
        matrix[model.diagonal] += drag.of_cortex
    bending = None
    if p.kappa > 0:
        bending, rings = BendingStiffness.on(g, mesh), model.solvers.two_rings
        wide = rings.added(matrix, dt * p.kappa, bending, g.normals)
        factor = model.solvers.bending_solver.factor(wide)
    else:
        factor = model.vector_solver.factor(matrix)
    force = -tension_force(r, g, mesh.faces).reshape(-1, 1)
    frame: FreeFrame | ResistedFrame
    if drag is None:
        frame, dv_dzeta0 = free_frame(model, factor, r, g, force)
    else:
        frame, dv_dzeta0 = resisted_frame(model, factor, r, g, drag, force)
    return FactorizedCortex(
        dt, dissipation, tension, damping, bending, g.normals, factor, frame, dv_dzeta0
    )


def force_balance(
    model: Model,
    factorized: FactorizedCortex,
    r: Array,
    g: Geometry,
    c: Array,
    zeta0: float,
    ahead: Array | None = None,
    v_c: Array | None = None,
    turning: Array | None = None,
) -> TensionFlow:
    """Solve the force balance on the shape r (V, 3) with concentration c (V,).

    The solution uses the factorization `factorized` of a nearby shape. The frame follows the cell.
    `zeta0`: an estimate of the tension; for this tension the velocity is that of the shape r, for
    others the response is that of the factorized shape. `v_c` (V, 3): an estimate of the solution;
    with it viscosity acts on the shape r, up to the error of the estimate, without it on the
    factorized shape. `ahead` (V, 3): displacement of r from the known part of the step (None: 0);
    implicit tension acts on the normal part of dt v - ahead. `turning` (3,): angular velocity of
    the frame [1/T] (None: 0); all velocities are relative to it. Main text, force balance below
    `vp`; SI `forcebalance2`. Raises InvalidInput where v_p(c) is not defined.
    """
    p, mesh = model.parameters, model.mesh
    v_p = model.v_p(r, c)[:, None] * g.normals
    push = p.delta_P * _pressure(r, g, mesh.faces)
    force = normal_force(push - zeta0 * area_gradient(g, mesh.faces), r, g)
    if p.has_isotropic_stress:
        # the stress tau(c) I acts like an inhomogeneous tension
        force -= weighted_area_gradient(g, mesh.faces, p.tau(c)[mesh.faces].mean(axis=1))
    if p.kappa > 0:
        force -= p.kappa * bending_force(r, g, mesh.faces)
    v_n = np.einsum("vi,vi->v", v_p, g.normals)
    if v_c is not None:
        force += block_product(factorized.dissipation, mesh, v_c)
        force += viscous_forces(g, mesh, v_c, p.eta_s, p.eta_b)
        v_n += np.einsum("vi,vi->v", v_c, g.normals - factorized.normals)
    moved = factorized.dt * v_n
    if ahead is not None:
        moved -= np.einsum("vi,vi->v", ahead, g.normals)
    resisted = product(factorized.damping, mesh, v_n) + product(factorized.tension, mesh, moved)
    if factorized.bending is not None:
        resisted += p.kappa * factorized.bending.product(moved)
    force -= resisted[:, None] * factorized.normals
    turned = None if turning is None else rotation(turning, r)
    frame = factorized.frame.at(model, r, g, c, v_p, turned)
    force += frame.force(v_c)
    v = v_p + frame.fulfilled(factorized.factor.solve(force.ravel()))
    return TensionFlow(v - zeta0 * factorized.dv_dzeta0, factorized.dv_dzeta0, v_p)


def turning_responses(
    model: Model,
    factorized: FactorizedCortex,
    r: Array,
    g: Geometry,
    c: Array,
    v_c: Array,
    turning: Array | None = None,
) -> Array:
    """Changes (3, V, 3) of the velocity of `force_balance` by unit angular velocities of the frame.

    Around the three axes, beside `turning` (3,); on the factorized shape, where the flow is `v_c`.
    """
    v_p = model.v_p(r, c)[:, None] * g.normals
    start = np.zeros(3) if turning is None else turning
    still, *turned = (
        factorized.frame.at(model, r, g, c, v_p, rotation(start + more, r))
        for more in (np.zeros(3), *np.eye(3))
    )
    known = still.force(v_c)
    forces = np.stack([frame.force(v_c) - known for frame in turned])
    driven = np.zeros_like(forces).reshape(3, -1)
    if forces.any():
        driven = factorized.factor.solve(np.ascontiguousarray(forces.reshape(3, -1).T)).T
    at_rest = still.fulfilled(np.zeros_like(driven[0]))
    found = zip(turned, driven, strict=True)
    return np.stack([frame.fulfilled(np.array(w)) - at_rest for frame, w in found])


def velocity_of_motion(
    model: Model, factorized: FactorizedCortex, r: Array, g: Geometry, c: Array, along: Array
) -> Array:
    """Change (V, 3) of the velocity of `force_balance` on the factorized shape by `ahead`.

    `along` (V,): the part of -`ahead` along the normals.
    """
    still = np.zeros_like(r)
    resisted = product(factorized.tension, model.mesh, along)
    if factorized.bending is not None:
        resisted += model.parameters.kappa * factorized.bending.product(along)
    force = -resisted[:, None] * factorized.normals
    frame = factorized.frame.at(model, r, g, c, still, None)
    return frame.fulfilled(factorized.factor.solve(force.ravel()))


def tension_force(r: Array, g: Geometry, faces: Index) -> Array:
    """Minus the node forces of a unit of tension (V, 3): the normal part of dA/dr [L]."""
    return normal_force(area_gradient(g, faces), r, g)


def bending_force(r: Array, g: Geometry, faces: Index) -> Array:
    """Minus the node forces of a unit of bending stiffness (V, 3), along the normals [1/L]."""
    return normal_force(bending_gradient(r, g, faces), r, g)


def pressure_force(r: Array, g: Geometry, faces: Index) -> Array:
    """Node forces of a unit of pressure (V, 3): along the normals, on the dual areas [L^2].

    One factor scales all forces, such that their work under uniform growth of the cell equals that
    of the pressure on the volume. The factor corrects the error of the mesh; on bent surfaces that
    the mesh hardly resolves it changes by a few percent. Raises SingularMatrix where the dual areas
    no longer measure the surface.
    """
    return normal_force(_pressure(r, g, faces), r, g)


def _pressure(r: Array, g: Geometry, faces: Index) -> Array:
    """`pressure_force` including the net force and torque of discretization errors."""
    force = g.dual_areas[:, None] * g.normals
    # about the center of area, where the rigid part that `normal_force` removes does no work
    factor = 3.0 * volume(r, faces) / np.vdot(force, r - area_centroid(r, g))
    if not MIN_FACTOR < factor < 1.0 / MIN_FACTOR:
        raise SingularMatrix("the mesh is too coarse for the surface: a dual area is not positive")
    return np.asarray(force * factor)


def normal_force(force: Array, r: Array, g: Geometry) -> Array:
    """Node forces (V, 3) without their tangential part, net force and net torque.

    Net force and torque of `force` must vanish up to the error of the mesh, as they do for any
    energy of the shape. The net force and torque of the normal part are subtracted, spread over the
    surface by area.
    """
    # about the center of area, where translation and rotation uncouple
    center = area_centroid(r, g)
    size, shift, torque, inertia = _normal_moments(force, g.normals, r, center, g.node_areas)
    turn = np.linalg.solve(inertia, torque)
    return np.asarray(
        _without_rigid(size, g.normals, r, center, g.node_areas, shift / g.area, turn)
    )


@compiled
def _normal_moments(force, normals, r, center, areas):  # type: ignore[no-untyped-def]
    size, shift, torque, inertia = np.empty(len(areas)), np.zeros(3), np.zeros(3), np.zeros((3, 3))
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(areas)):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        along = force[i, 0] * nx + force[i, 1] * ny + force[i, 2] * nz
        x, y, z = r[i, 0] - center[0], r[i, 1] - center[1], r[i, 2] - center[2]
        size[i] = along
        shift[0] += along * nx
        shift[1] += along * ny
        shift[2] += along * nz
        torque[0] += along * (y * nz - z * ny)
        torque[1] += along * (z * nx - x * nz)
        torque[2] += along * (x * ny - y * nx)
        xx += areas[i] * x * x
        xy += areas[i] * x * y
        xz += areas[i] * x * z
        yy += areas[i] * y * y
        yz += areas[i] * y * z
        zz += areas[i] * z * z
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = yy + zz, xx + zz, xx + yy
    inertia[0, 1], inertia[0, 2], inertia[1, 2] = -xy, -xz, -yz
    inertia[1, 0], inertia[2, 0], inertia[2, 1] = -xy, -xz, -yz
    return size, shift, torque, inertia


@compiled
def _without_rigid(size, normals, r, center, areas, shift, turn):  # type: ignore[no-untyped-def]
    forces = np.empty(normals.shape)
    for i in range(len(areas)):
        x, y, z = r[i, 0] - center[0], r[i, 1] - center[1], r[i, 2] - center[2]
        rigid_x = shift[0] + turn[1] * z - turn[2] * y
        rigid_y = shift[1] + turn[2] * x - turn[0] * z
        rigid_z = shift[2] + turn[0] * y - turn[1] * x
        forces[i, 0] = size[i] * normals[i, 0] - areas[i] * rigid_x
        forces[i, 1] = size[i] * normals[i, 1] - areas[i] * rigid_y
        forces[i, 2] = size[i] * normals[i, 2] - areas[i] * rigid_z
    return forces
