"""Filament balance: dc/dt + div_s(v c) = D lap_s c + beta (c0 - c), on a mesh that moves.

Conservative ALE form: with m the node areas, M the mass matrix (whose columns sum to m) and u the
velocity of the filaments relative to the mesh, d(m c)/dt = C(u) c - D L c + beta M (c0 - c). The
columns of C and L sum to zero: what leaves one node arrives at another, and with beta = 0 the total
is kept to rounding. SI `cdot`. The node areas lump the mass matrix of the time derivative, which
does not affect steady states; turnover is integrated exactly, as the flow is.

Where the rear peak is sharper than the mesh, this linear scheme alone would oscillate below zero.
There (at local Peclet numbers above about two; with turnover also where diffusion does not reach
from node to node in a time 1/beta) just enough diffusion between neighbors is added implicitly to
rule that out, and returned explicitly as far as it makes no new extremum: algebraic flux correction
(D. Kuzmin, M. Moller, S. Turek, Comput. Methods Appl. Mech. Eng. 193, 4915, 2004). It is
conservative and keeps c >= 0 for any dt.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import Geometry
from amoeboid.meshes.operators import advection, mass, product, stiffness
from amoeboid.numerics.compiled import compiled
from amoeboid.surface.model import Model


def transported(
    model: Model, filaments: Array, g: Geometry, relative_velocity: Array, dt: float, c_ahead: Array
) -> Array:
    """Concentration (V,) after an implicit step of length dt that ends on geometry g.

    `filaments` (V,) >= 0: numbers m c at the nodes before the step; `relative_velocity` (V, 3): of
    the filaments against the mesh; `c_ahead` (V,) >= 0: the predicted c, which determines
    the returned fluxes. The result is >= 0 to rounding. Raises SingularMatrix.
    """
    p = model.parameters
    entries, added = implicit_matrix(model, g, relative_velocity, dt)
    given_back = returned_fluxes(added, c_ahead, filaments, model)
    gained = dt * p.beta * p.c0 * g.node_areas
    return model.scalar_solver.solve(entries, filaments + given_back + gained, guess=c_ahead)


def implicit_matrix(model: Model, g: Geometry, velocity: Array, dt: float) -> tuple[Array, Array]:
    """Entries (P,) of what c is multiplied by in an implicit step of length dt, an M-matrix, and
    the diffusion (P,) that was added to make it one."""
    entries = -dt * exchange(model, g, velocity)
    added = added_diffusion(entries, model)
    entries -= added
    entries[model.diagonal] += _sums(added, model) + g.node_areas
    return entries, added


def exchange(model: Model, g: Geometry, velocity: Array) -> Array:
    """Entries (P,) of C(velocity) - D L - beta M: gain by flow, diffusion and turnover."""
    p, mesh = model.parameters, model.mesh
    return np.asarray(
        advection(g, mesh, velocity) - p.D * stiffness(g, mesh) - p.beta * mass(g, mesh)
    )


def added_diffusion(entries: Array, model: Model) -> Array:
    """Least symmetric exchange d_ij >= 0 (P,) that makes all off-diagonal entries <= 0."""
    mesh = model.mesh
    return np.asarray(_added_diffusion(entries, model.transposed, mesh.row_start, mesh.columns))


@compiled
def _added_diffusion(entries, transposed, row_start, columns):  # type: ignore[no-untyped-def]
    added = np.empty(len(entries))
    for i in range(len(row_start) - 1):
        for k in range(row_start[i], row_start[i + 1]):
            least = max(0.0, entries[k], entries[transposed[k]])
            added[k] = least if columns[k] != i else 0.0
    return added


def diffusive_loss(added: Array, c: Array, model: Model) -> Array:
    """What each node loses (V,) to its neighbors by the added diffusion, if nothing is returned."""
    return _sums(added, model) * c - product(added, model.mesh, c)


def returned_fluxes(added: Array, c: Array, stock: Array, model: Model) -> Array:
    """The part of the added diffusion that is returned to each node (V,).

    It is limited such that no new extremum among neighbors arises, and no node gives more than its
    `stock`.
    """
    if not added.any():
        return np.zeros_like(c)
    return np.asarray(_returned_fluxes(added, c, stock, model.mesh.row_start, model.mesh.columns))


@compiled
def _returned_fluxes(added, c, stock, row_start, columns):  # type: ignore[no-untyped-def]
    n = len(row_start) - 1
    gain, loss = np.empty(n), np.empty(n)  # shares of what would be returned that may be
    for i in range(n):
        reach, gained, lost, higher, lower = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(row_start[i], row_start[i + 1]):
            step = c[i] - c[columns[k]]
            reach += added[k]
            gained += max(added[k] * step, 0.0)
            lost += max(-added[k] * step, 0.0)
            higher, lower = max(higher, -step), max(lower, step)
        above, below = reach * higher, min(stock[i], reach * lower)
        gain[i] = above / gained if gained > above else 1.0
        loss[i] = below / lost if lost > below else 1.0
    returned = np.zeros(n)
    for i in range(n):
        for k in range(row_start[i], row_start[i + 1]):
            j = columns[k]
            flux = added[k] * (c[i] - c[j])
            share = min(gain[i], loss[j]) if flux > 0.0 else min(loss[i], gain[j])
            returned[i] += share * flux
    return returned


def _sums(entries: Array, model: Model) -> Array:
    """Row sums (V,) of entries on the pattern of the mesh."""
    return np.asarray(np.add.reduceat(entries, model.mesh.row_start[:-1]))


def filaments(c: Array, g: Geometry) -> Array:
    """Number of filaments at each node (V,): concentration times node area."""
    return c * g.node_areas


def rate_of_change(model: Model, c: Array, g: Geometry, velocity: Array) -> Array:
    """dc/dt (V,) [N/(L^2 T)] at points at rest in the cell frame; main text `cdot_advective`.

    Exact for a surface that does not move, velocity.n = 0; there it vanishes in a steady state,
    however the mesh drifts within the surface.
    """
    p = model.parameters
    return exchanged(model, c, g, velocity) / g.node_areas + p.beta * p.c0


def exchanged(model: Model, c: Array, g: Geometry, relative_velocity: Array) -> Array:
    """Filaments that each node gains per unit time (V,) [N/T], without the new ones (beta c0).

    `relative_velocity` (V, 3): of the filaments against the mesh.
    """
    entries = exchange(model, g, relative_velocity)
    added = added_diffusion(-entries, model)
    kept = returned_fluxes(added, c, np.full_like(c, np.inf), model) - diffusive_loss(
        added, c, model
    )
    return product(entries, model.mesh, c) + kept


def gained(model: Model, c: Array, g: Geometry, relative_velocity: Array) -> Array:
    """Filaments that each node gains per unit time (V,) [N/T], the new ones included."""
    p = model.parameters
    return exchanged(model, c, g, relative_velocity) + p.beta * p.c0 * g.node_areas
