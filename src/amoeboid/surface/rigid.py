"""What motions of the whole cell make of shape and concentration at its nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface.geometry import Geometry, scatter
from amoeboid.surface.mesh import Connectivity
from amoeboid.surface.operators import mass, product

Array = NDArray[np.float64]


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
