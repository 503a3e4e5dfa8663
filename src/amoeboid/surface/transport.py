"""Filament balance: dc/dt + div_s(v c) = D lap_s c + beta (c0 - c), on a mesh that moves.

Conservative ALE form: with m the node areas and u the velocity of the filaments relative to the
mesh, d(m c)/dt = C(u) c - D L c + beta m (c0 - c). The columns of C and L sum to zero: what leaves
one node arrives at another, and with beta = 0 the total is kept to rounding. SI `cdot`.

Where the rear peak is sharper than the mesh, this linear scheme alone would oscillate below
zero. There (and only there, at local Peclet numbers above about two) just enough diffusion between
neighbors is added implicitly to rule that out, and returned explicitly as far as it makes no new
extremum: algebraic flux correction (D. Kuzmin, M. Moller, S. Turek, Comput. Methods Appl. Mech.
Eng. 193, 4915, 2004). It is conservative and keeps c >= 0 for any dt.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.geometry import Geometry
from amoeboid.surface.model import Model
from amoeboid.surface.operators import advection, scalar_matrix, stiffness

Array = NDArray[np.float64]


def transported(
    model: Model, filaments: Array, g: Geometry, relative_velocity: Array, dt: float, c_ahead: Array
) -> Array:
    """Concentration (V,) after an implicit step of length dt that ends on geometry g.

    `filaments` (V,) >= 0: numbers m c at the nodes before the step; `relative_velocity` (V, 3): of
    the filaments against the mesh; `c_ahead` (V,) >= 0: what c is expected to be, which decides
    on returned fluxes. The result is >= 0 to rounding. Raises SingularMatrix.
    """
    p, mesh = model.parameters, model.mesh
    entries = dt * (p.D * stiffness(g, mesh) - advection(g, mesh, relative_velocity))
    added = added_diffusion(entries, model)
    given_back = returned_fluxes(added, c_ahead, filaments, model)
    entries -= added
    entries[model.diagonal] += _sums(added, model) + g.node_areas * (1.0 + dt * p.beta)
    gained = dt * p.beta * p.c0 * g.node_areas
    return model.scalar_solver.solve(entries, filaments + given_back + gained, guess=c_ahead)


def added_diffusion(entries: Array, model: Model) -> Array:
    """Least symmetric exchange d_ij >= 0 (P,) that makes all off-diagonal entries <= 0."""
    added = np.maximum(0.0, np.maximum(entries, entries[model.transposed]))
    added[model.diagonal] = 0.0
    return added


def diffusive_loss(added: Array, c: Array, model: Model) -> Array:
    """What each node loses (V,) to its neighbors by the added diffusion, if nothing is returned."""
    rows, columns = model.mesh.rows, model.mesh.columns
    return _sums(added * (c[rows] - c[columns]), model)


def returned_fluxes(added: Array, c: Array, stock: Array, model: Model) -> Array:
    """What each node gets back (V,) of the added diffusion.

    No more than makes a new extremum among its neighbors, and no node gives more than its `stock`.
    """
    if not added.any():
        return np.zeros_like(c)
    rows, columns, starts = model.mesh.rows, model.mesh.columns, model.mesh.row_start[:-1]
    step = c[rows] - c[columns]
    fluxes = added * step
    reach = _sums(added, model)
    gain = _share(_sums(np.maximum(fluxes, 0.0), model), reach * np.maximum.reduceat(-step, starts))
    below = np.minimum(stock, reach * np.maximum.reduceat(step, starts))
    loss = _share(_sums(np.maximum(-fluxes, 0.0), model), below)
    inward, outward = np.minimum(gain[rows], loss[columns]), np.minimum(loss[rows], gain[columns])
    return _sums(fluxes * np.where(fluxes > 0, inward, outward), model)


def _sums(entries: Array, model: Model) -> Array:
    """Row sums (V,) of entries on the pattern of the mesh."""
    return np.asarray(np.add.reduceat(entries, model.mesh.row_start[:-1]))


def _share(wanted: Array, allowed: Array) -> Array:
    """allowed/wanted where more is wanted than allowed, else 1."""
    share = np.ones_like(wanted)
    np.divide(allowed, wanted, out=share, where=wanted > allowed)
    return share


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
    added = added_diffusion(-exchange, model)
    kept = returned_fluxes(added, c, np.full_like(c, np.inf), model) - diffusive_loss(
        added, c, model
    )
    gain = scalar_matrix(exchange, mesh) @ c + kept
    return np.asarray(gain / g.node_areas + p.beta * (p.c0 - c))
