"""Friction with the surroundings: forces per area that resist the motion of surface and cortex.

    f = -m(c) [ gamma_t P (v + U) + gamma_n n n.(v + U) + gamma_c (v_c + U) ]

v is the full velocity, of filaments and membrane, v_c that of the cortex, both in the frame of the
cell; P projects onto the surface. The velocity U of the cell follows: the total force of the
surroundings vanishes, as nothing else acts on the cell from outside. m = 1 + gamma_share (c/c0 - 1)
is 1 for uniform friction and c/c0 where every filament carries its share.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.observables import Cell, center_velocity
from amoeboid.validation import InvalidInput

# On meshes friction along the surface is at least this share of that along the normal, or of that
# with which viscosity competes, (eta_s + eta_b)/R0^2, if it is less. A round cell that slips
# without friction can turn as it likes, and normals of a mesh are not exact: forces along them
# would decide how.
MIN_GRIP = 1e-5


def density(c: Any, p: Any) -> Any:
    """m(c), the friction relative to that at c0 [1]."""
    if not p.gamma_share:
        return 1.0
    return (c / (p.c0 or p.c_r) - 1.0) * p.gamma_share + 1.0


def drag(u: Any, v_n: Any, w: Any, c: Any, p: Any) -> tuple[Any, Any]:
    """Force per area along the surface and along its normal [M/(L T^2)].

    `u`: velocity along the surface, the same of filaments and cortex; `v_n`, `w`: that of the
    membrane and of the cortex along the normal, all relative to the surroundings.
    """
    m = density(c, p)
    return (
        u * m * -(p.gamma_t + p.gamma_c),
        (v_n * p.gamma_n + w * p.gamma_c) * m * -1.0,
    )


def unit(p: Any) -> Any:
    """gamma_t + gamma_n + gamma_c: a typical friction [M/(L^2 T)]."""
    return p.gamma_t + p.gamma_n + p.gamma_c


def resistances(p: Any, c: Array, normals: Array, areas: Array) -> tuple[Array, Array]:
    """Matrices (V, 3, 3) at the points: what v, and what v_c is multiplied by [M/T].

    For points with unit `normals` (V, 3) that stand for `areas` (V,). A cell that slips keeps a
    friction of its cortex, by MIN_GRIP.
    """
    grip = MIN_GRIP * min(p.gamma_n, (p.eta_s + p.eta_b) / p.R0**2)
    of_cortex = max(p.gamma_c, grip - p.gamma_t)
    m = areas * density(c, p)
    across = normals[:, :, None] * normals[:, None, :]
    of_v = m[:, None, None] * (p.gamma_t * np.eye(3) + (p.gamma_n - p.gamma_t) * across)
    return of_v, m[:, None, None] * (of_cortex * np.eye(3))


def velocity(cell: Cell) -> Array:
    """U (3,): the velocity of the center of volume relative to the surroundings [L/T].

    Exact for a steady state, and for the flow of a run up to the error of its step. Raises
    InvalidInput without friction, where nothing in the force balance says how fast the cell moves.
    """
    p = cell.parameters
    if not p.has_friction:
        raise InvalidInput(
            "gamma_t, gamma_n or gamma_c must be > 0 for a velocity of the cell in its "
            "surroundings, all are 0; without friction see `cortex_drag_velocity`"
        )
    return center_velocity(cell) + frame_velocity(
        p, cell.c, cell.normals, cell.v, cell.v_c, cell.integral
    )


def frame_velocity(p: Any, c: Array, normals: Array, v: Array, v_c: Array, integral: Any) -> Array:
    """U (3,): the velocity of the frame of v and v_c (V, 3) at which no force is left [L/T].

    `integral` integrates vectors (V, 3) over the surface.
    """
    m = np.broadcast_to(density(c, p), c.shape)[:, None]

    def resisted(v: Array, v_c: Array) -> Array:
        along = np.einsum("pi,pi->p", v, normals)[:, None] * normals
        total = p.gamma_t * (v - along) + p.gamma_n * along + p.gamma_c * v_c
        return np.asarray(integral(m * total))

    axes = [np.broadcast_to(axis, v.shape) for axis in np.eye(3)]
    of_axes = np.stack([resisted(axis, axis) for axis in axes], axis=1)
    held = np.diag(of_axes) > 0.0  # on a meridian, forces across the axis cancel
    force = resisted(v, v_c)
    found = np.zeros(3)
    found[held] = np.linalg.solve(of_axes[np.ix_(held, held)], -force[held])
    return found
