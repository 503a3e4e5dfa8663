"""Motions of the whole cell: what they make of shape and concentration, and how fast it turns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import (
    Geometry,
    area_gradient,
    scatter,
    volume_centroid,
)
from amoeboid.meshes.operators import mass, product
from amoeboid.numerics.compiled import compiled
from amoeboid.surface.model import Model
from amoeboid.surface.transport import rate_of_change

# Mean square of what a rotation must change, c relative to c0 + c or r.n to R0, for the cell to
# count as one that can turn around that axis.
LEAST_CHANGE = 1e-4
# Angle by which a cell is turned to see whether a cue acts on it differently then, and the rms
# change of the factor per radian up to which it does not.
TILT, SAME_FACTOR = 1e-4, 1e-7


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


def rotations(x: Array, axes: Array) -> list[Array]:
    """Velocities of nodes x (V, 3) that turn around `axes` (k, 3) at unit rates."""
    return [np.cross(axis, x) for axis in axes]


def free_axes(model: Model, r: Array) -> Array:
    """Orthonormal axes (k, 3) about which a rotated cell r (V, 3) meets the same surroundings.

    All three without a cue, the axis of a cue along one direction, none in general.
    """
    return _axes(model, r)[0]


def held_axes(model: Model, r: Array) -> Array:
    """The orthonormal axes (k, 3) about which it does not, those that a cue holds the cell to."""
    return _axes(model, r)[1]


def _axes(model: Model, r: Array) -> tuple[Array, Array]:
    if model.cue is None:
        return np.eye(3), np.zeros((0, 3))
    directions = model.directions(r)
    differences = [
        model.cue_factor(turned(directions, TILT * axis, 1.0))
        - model.cue_factor(turned(directions, -TILT * axis, 1.0))
        for axis in np.eye(3)
    ]
    _, sizes, axes = np.linalg.svd(np.stack(differences, axis=1) / (2.0 * TILT * np.sqrt(len(r))))
    free = sizes < SAME_FACTOR
    return axes[free], axes[~free]


def turning_rate(model: Model, r: Array, c: Array, g: Geometry, v: Array) -> Array:
    """Rate (3,) [1/T] at which shape and concentration turn, in the axes of the velocity v (V, 3).

    That of the rotation which comes closest to how both change. A cell that only turns, as on a
    circle, does so at exactly this rate in the discrete equations as well.
    """
    p, mesh = model.parameters, model.mesh
    x = r - volume_centroid(r, mesh.faces)
    # rates of change where the points of the surface move along its normals: of those that the
    # cell would have to turn around the axes, in columns, and of what it does
    tilt = _moments(x, g.normals)
    carried = _carried(g.face_areas, g.gradients, mesh.faces, c, x) / g.node_areas[:, None]
    v_n = np.einsum("vi,vi->v", v, g.normals)
    c_rate = rate_of_change(model, c, g, v)
    bend = np.einsum("vi,vi->v", area_gradient(g, mesh.faces), g.normals) / g.node_areas
    of_c, of_r = 1.0 / (p.c0 + c), 1.0 / p.R0
    basis = np.concatenate([(of_c * (carried - (bend * c)[:, None] * tilt).T).T, of_r * tilt])
    change = np.concatenate([of_c * (c_rate - bend * c * v_n), of_r * v_n])
    weighted = (np.tile(g.node_areas / g.area, 2) * basis.T).T
    return np.linalg.solve(basis.T @ weighted + LEAST_CHANGE * np.eye(3), weighted.T @ change)


@compiled
def _moments(x, normals):  # type: ignore[no-untyped-def]
    # normal motion of the unit rotations: (e x x).n = e.(x x n)
    moments = np.empty(x.shape)
    for i in range(x.shape[0]):
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            moments[i, d] = x[i, p] * normals[i, q] - x[i, q] * normals[i, p]
    return moments


@compiled
def _carried(areas, gradients, faces, c, x):  # type: ignore[no-untyped-def]
    # (V, 3): `advection` by the unit rotations times c, integrals of c (e x x).grad phi
    carried = np.zeros(x.shape)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        share, total = areas[f] / 12.0, c[i] + c[j] + c[k]
        a, b, w = share * (total + c[i]), share * (total + c[j]), share * (total + c[k])
        px = a * x[i, 0] + b * x[j, 0] + w * x[k, 0]
        py = a * x[i, 1] + b * x[j, 1] + w * x[k, 1]
        pz = a * x[i, 2] + b * x[j, 2] + w * x[k, 2]
        for n in range(3):
            v, gx, gy, gz = faces[f, n], gradients[f, n, 0], gradients[f, n, 1], gradients[f, n, 2]
            carried[v, 0] += py * gz - pz * gy
            carried[v, 1] += pz * gx - px * gz
            carried[v, 2] += px * gy - py * gx
    return carried


def turned(vectors: Array, rate: Array, time: float) -> Array:
    """Vectors (V, 3) after they have turned at `rate` (3,) [1/T] for a time."""
    angle = float(np.linalg.norm(rate)) * time
    if angle == 0.0:
        return vectors
    axis = rate * (time / angle)
    across = np.cross(axis, np.eye(3))
    return vectors + vectors @ (np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across)


def spin(rate: Array, x: Array) -> Array:
    """Velocities (V, 3) of points x (V, 3) that turn around the origin at `rate` (3,)."""
    return x @ np.cross(rate, np.eye(3))
