"""What motions of the whole cell make of shape and concentration at its nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.geometry import (
    Geometry,
    area_gradient,
    geometry,
    scatter,
    volume_centroid,
)
from amoeboid.surface.mesh import Connectivity
from amoeboid.surface.model import Flow, Model, State
from amoeboid.surface.operators import advection, mass, product
from amoeboid.surface.transport import rate_of_change

Array = NDArray[np.float64]

# Mean square of what a rotation must change, c relative to c0 + c or r.n to R0, for the cell to
# count as one that can turn around that axis.
LEAST_CHANGE = 1e-4


def gradient(c: Array, g: Geometry, mesh: Connectivity) -> Array:
    """Surface gradient of c at the nodes (V, 3)."""
    faces = mesh.faces
    slopes = np.einsum("fa,fad->fd", c[faces], g.gradients) * g.face_areas[:, None] / 3.0
    mean = scatter(np.repeat(slopes[:, None, :], 3, axis=1), faces, len(c))
    mean /= g.node_areas[:, None]
    # a step of iteration with the mass matrix: such a mean around a node is too flat
    entries = mass(g, mesh)
    blurred = [product(entries, mesh, slope) for slope in mean.T]
    return np.asarray(2.0 * mean - np.transpose(blurred) / g.node_areas[:, None])


def changes(motions: Sequence[Array], slope: Array, normals: Array, length: float) -> Array:
    """Changes (2V, k) of c and of r.n/`length` at fixed places, as `motions` (V, 3) carry the cell.

    `slope` (V, 3) is the gradient of c, in whatever unit the change of c is wanted.
    """
    columns = [
        np.concatenate(
            [
                -np.einsum("vi,vi->v", motion, slope),
                np.einsum("vi,vi->v", motion, normals) / length,
            ]
        )
        for motion in motions
    ]
    return np.stack(columns, axis=1)


def translations(x: Array) -> list[Array]:
    """Displacements of nodes x (V, 3) by unit lengths along the axes."""
    return [np.broadcast_to(axis, x.shape) for axis in np.eye(3)]


def rotations(x: Array) -> list[Array]:
    """Velocities of nodes x (V, 3) that turn around the axes at unit rates."""
    return [np.cross(axis, x) for axis in np.eye(3)]


def turning(model: Model, state: State, flow: Flow) -> Array:
    """Rate (3,) [1/T] at which shape and concentration turn, in the frame of `flow`.

    That of the rotation which comes closest to how both change.
    """
    p, mesh, c = model.parameters, model.mesh, state.c
    g = geometry(state.r, mesh.faces)
    x = (state.r - volume_centroid(state.r, mesh.faces)) / p.R0
    bend = np.einsum("vi,vi->v", area_gradient(g, mesh.faces), g.normals) / g.node_areas

    def changed(of_c: Array, v: Array) -> Array:
        v_n = np.einsum("vi,vi->v", v, g.normals)
        return np.concatenate([(of_c - bend * v_n * c) / (p.c0 + c), v_n / p.R0])

    # as the filament balance itself makes a pattern turn
    made = [
        changed(product(advection(g, mesh, v), mesh, c) / g.node_areas, v)
        for v in (p.R0 * motion for motion in rotations(x))
    ]
    basis = np.stack(made, axis=1)
    weighted = np.tile(g.node_areas / g.area, 2)[:, None] * basis
    change = changed(rate_of_change(model, c, g, flow.v), flow.v)
    return np.linalg.solve(basis.T @ weighted + LEAST_CHANGE * np.eye(3), weighted.T @ change)
