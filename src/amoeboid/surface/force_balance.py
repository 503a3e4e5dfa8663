"""Force balance of the cortex: div_s sigma + f_t + delta_P n = 0, solved for the velocity.

In the discrete variables K v_c = delta_P dV/dr - zeta0 dA/dr + (elastic force), K the dissipation
matrix. Two things make a long time step stable and keep the flow clean:

*Implicit tension.* A shape that moves by dt v_n changes its tension force by about
-dt zeta0 L v_n, L the stiffness matrix. Added to K for the normal motion only, it damps the stiff
shape modes (rate delta_P R0/eta_s); on the tangential motion it would be a false viscosity. It
vanishes in a steady state, and it fixes the translation: the frame moves with the cell.

*Normal tension.* Tension and pressure depend on the shape alone, so that moving nodes within the
surface must do no work. The exact dA/dr of a polyhedron has a tangential part, a discretization
error multiplied by the large zeta0, which would drive a parasitic flow; it is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.surface.dissipation import dissipation_blocks
from amoeboid.surface.geometry import (
    Geometry,
    area_gradient,
    normal_part,
    volume_gradient,
    weighted_area_gradient,
)
from amoeboid.surface.model import Model
from amoeboid.surface.operators import block_product, normal_blocks, stiffness

Array = NDArray[np.float64]

# Rigid modes have no stiffness; this share of the viscous one makes the matrix regular. The
# constraint of zero rotation then removes what little it does.
REGULARIZATION = 1e-8
# Least implicit tension, in viscosity / time step: it fixes the frame where there is no tension.
LEAST_TENSION = 1e-3


@dataclass(frozen=True, eq=False)
class TensionFlow:
    """The velocity as a function of the tension that is still to be found: v = rest + zeta0 slope.

    `rest`, `slope` (V, 3); v_p (V, 3) is contained in `rest`.
    """

    rest: Array
    slope: Array
    v_p: Array

    def v(self, zeta0: float) -> Array:
        """Full velocity at tension zeta0, (V, 3)."""
        return self.rest + zeta0 * self.slope


def force_balance(
    model: Model, r: Array, g: Geometry, c: Array, dt: float, zeta0: float
) -> TensionFlow:
    """Solve the force balance for concentration c; `zeta0` enters the implicit term only.

    r (V, 3), c (V,), dt > 0. Main text, force balance below `vp`; SI `forcebalance2`.
    Raises SingularMatrix if the shape has degenerated, InvalidInput where v_p(c) is not defined.
    """
    p, mesh = model.parameters, model.mesh
    v_p = p.v_p(c)[:, None] * g.normals
    viscosity = p.eta_s + p.eta_b
    tension = max(zeta0, LEAST_TENSION * viscosity / dt)
    implicit = dt * tension * normal_blocks(stiffness(g, mesh), g.normals, mesh)

    matrix = dissipation_blocks(g, mesh, p.eta_s, p.eta_b) + implicit
    shift = REGULARIZATION * viscosity * g.node_areas / g.node_areas.mean()
    matrix[model.diagonal] += shift[:, None, None] * np.eye(3)
    factor = model.vector_solver.factor(matrix)

    force = p.delta_P * volume_gradient(r, mesh.faces)
    if p.alpha > 0:
        # the stress -alpha c I acts like a negative, uneven tension
        force += weighted_area_gradient(g, mesh.faces, p.alpha * c[mesh.faces].mean(axis=1))
    implicit_v_p = block_product(implicit, mesh, v_p)
    tension_force = normal_force(area_gradient(g, mesh.faces), r, g)

    rotations = rigid_motions(r, g)[:, 3:]
    weight = np.repeat(g.node_areas, 3)[:, None]
    solved = factor.solve(
        np.column_stack(
            [(force - implicit_v_p).ravel(), -tension_force.ravel(), weight * rotations]
        )
    )
    # zero rotation as a constraint: subtract the torques that keep it
    rotate = solved[:, 2:]
    torques = np.linalg.solve(
        rotations.T @ (weight * rotate), rotations.T @ (weight * solved[:, :2])
    )
    v_c, slope = ((solved[:, :2] - rotate @ torques).T).reshape(2, -1, 3)
    return TensionFlow(rest=v_c + v_p, slope=slope, v_p=v_p)


def normal_force(force: Array, r: Array, g: Geometry) -> Array:
    """Node forces (V, 3) without their tangential part, net force and net torque still as given.

    Net force and torque of `force` must vanish (those of any energy of the shape do); what the
    projection adds to them is spread over the surface and taken off again.
    """
    projected = normal_part(force, g.normals)
    rigid = rigid_motions(r, g)
    weighted = np.repeat(g.node_areas, 3)[:, None] * rigid
    share = np.linalg.solve(rigid.T @ weighted, rigid.T @ projected.ravel())
    return np.asarray(projected - (weighted @ share).reshape(-1, 3))


def rigid_motions(r: Array, g: Geometry) -> Array:
    """Three translations and three rotations about the center of area, columns (3V, 6)."""
    return np.asarray(_rigid_motions(r, g.node_areas @ r / g.area).reshape(-1, 6))


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
