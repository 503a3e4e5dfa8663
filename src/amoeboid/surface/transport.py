"""Filament balance: dc/dt + div_s(v c) = D lap_s c + beta (c0 - c), on a mesh that moves.

Conservative ALE form: with m the node areas and u the velocity of the filaments relative to the
mesh, d(m c)/dt = C(u) c - D L c + beta m (c0 - c). The columns of C and L sum to zero: what leaves
one node arrives at another, and with beta = 0 the total is kept to rounding. SI `cdot`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.geometry import Geometry
from amoeboid.surface.model import Model
from amoeboid.surface.operators import advection, scalar_matrix, stiffness

Array = NDArray[np.float64]


def transported(
    model: Model, filaments: Array, g: Geometry, relative_velocity: Array, dt: float
) -> Array:
    """Concentration (V,) after an implicit step of length dt that ends on geometry g.

    `filaments` (V,): numbers m c at the nodes before the step; `relative_velocity` (V, 3): of the
    filaments against the mesh. Raises SingularMatrix.
    """
    p, mesh = model.parameters, model.mesh
    entries = dt * (p.D * stiffness(g, mesh) - advection(g, mesh, relative_velocity))
    entries[model.diagonal] += g.node_areas * (1.0 + dt * p.beta)
    gained = dt * p.beta * p.c0 * g.node_areas
    return model.scalar_band.factor(entries).solve(filaments + gained)


def filaments(c: Array, g: Geometry) -> Array:
    """Number of filaments at each node (V,): concentration times node area."""
    return c * g.node_areas


def rate_of_change(model: Model, c: Array, g: Geometry, velocity: Array) -> Array:
    """dc/dt (V,) [N/(L^2 T)] at points at rest in the cell frame; main text `cdot_advective`.

    Exact for a surface that does not move, velocity.n = 0; there it vanishes in a steady state,
    however the mesh drifts within the surface.
    """
    p, mesh = model.parameters, model.mesh
    exchange = advection(g, mesh, velocity) - p.D * stiffness(g, mesh)
    return np.asarray(scalar_matrix(exchange, mesh) @ c / g.node_areas + p.beta * (p.c0 - c))
