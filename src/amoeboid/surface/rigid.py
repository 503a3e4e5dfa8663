"""Rigid motions of the cell: how they change shape and concentration, and its angular velocity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import (
    Geometry,
    area_gradient,
    volume_centroid,
)
from amoeboid.meshes.operators import mass, product
from amoeboid.numerics.compiled import compiled
from amoeboid.surface.model import Model
from amoeboid.surface.transport import rate_of_change

# A rotation is seen if it changes the cell by more than this, per radian: the mean square of the
# changes of c, relative to c0 + c, and of r.n, relative to R0. It is damped below.
MIN_CHANGE = 1e-4
# Rigid motions that change the cell by less than the first share of the largest change, or by what
# discretization errors make of a rotation around an axis of symmetry, the second number over that
# of the nodes (half of it is observed), are none: rotations of a sphere or around such an axis.
MIN_MOTION, ERROR_OF_MOTION = 0.02, 2.0
# A cell turns if its angular velocity in units of the rate is larger
# than these: than the mesh turns a straight cell that lies at an angle to its axes, the second
# number over that of the nodes. Observed: 0.0035 on 42 nodes and 0.0002 on 642; for soft cells near
# the onset of circles 0.010 on 642 and 0.003 on 2562.
MIN_TURNING, ERROR_OF_TURNING = 1e-3, 10.0
# Angle of a test rotation, and the largest rms change of a cue's factor per radian at which the
# rotation counts as free.
TILT, MAX_FREE_CHANGE = 1e-4, 1e-7


def gradient(c: Array, g: Geometry, mesh: Connectivity) -> Array:
    """Surface gradient of c at the nodes (V, 3)."""
    mean = _mean_slopes(c, g.face_areas, g.gradients, mesh.faces) / g.node_areas[:, None]
    # the mean around a node is too flat: one step of iteration with the mass matrix corrects it
    entries = mass(g, mesh)
    blurred = [product(entries, mesh, np.ascontiguousarray(slope)) for slope in mean.T]
    return np.asarray(2.0 * mean - np.transpose(blurred) / g.node_areas[:, None])


@compiled
def _mean_slopes(c, areas, gradients, faces):  # type: ignore[no-untyped-def]
    # a third of the integral of grad c over the triangles around each node
    sums = np.zeros((len(c), 3))
    for f in range(len(areas)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        for d in range(3):
            slope = (
                c[i] * gradients[f, 0, d] + c[j] * gradients[f, 1, d] + c[k] * gradients[f, 2, d]
            )
            share = slope * areas[f] / 3.0
            sums[i, d] += share
            sums[j, d] += share
            sums[k, d] += share
    return sums


def changes(motions: Sequence[Array], slope: Array, normals: Array, length: float) -> Array:
    """Changes (2V, k) of c and of r.n/`length` at fixed points under k rigid `motions` (V, 3).

    `slope` (V, 3): the gradient of c, in the unit in which the change of c is wanted.
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
    """Velocities of nodes x (V, 3) that rotate with unit angular velocity around `axes` (k, 3)."""
    return [np.cross(axis, x) for axis in axes]


def turns(model: Model, angular_velocity: Array) -> bool:
    """Whether a cell turns by itself, and not by the error of its mesh."""
    least = max(MIN_TURNING, ERROR_OF_TURNING / model.mesh.n_nodes)
    return bool(np.linalg.norm(angular_velocity) > least * model.rate)


def rigid_changes(model: Model, r: Array, c: Array, g: Geometry) -> tuple[Array, Array, Array]:
    """How rigid motions change the cell: orthonormal changes (2V, k) of c'/(c0 + c) and h/R0, of
    what motions they are sums (k, 6), and those.

    A motion is a velocity (in the unit R0) and an angular velocity about the center of volume.
    Motions that do not change the cell are left out, and rotations that change a cue.
    """
    p, mesh = model.parameters, model.mesh
    slope = gradient(c, g, mesh) / (p.c0 + c)[:, None]
    x, axes = r - volume_centroid(r, mesh.faces), free_axes(model, r)
    fields = [*(p.R0 * e for e in translations(x)), *rotations(x, axes)]
    motions = np.zeros((len(fields), 6))
    motions[:3, :3], motions[3:, 3:] = np.eye(3), axes
    found, sizes, shares = np.linalg.svd(changes(fields, slope, g.normals, p.R0), False)
    kept = sizes > min(MIN_MOTION, ERROR_OF_MOTION / len(c)) * sizes[0]
    return found[:, kept], shares[kept] / sizes[kept, None], motions


def free_axes(model: Model, r: Array) -> Array:
    """Orthonormal axes (k, 3): rotated about them, the cell r (V, 3) is under the same cue.

    Three without a cue, one for a cue along one direction, none in general.
    """
    return _axes(model, r)[0]


def cue_axes(model: Model, r: Array) -> Array:
    """The other orthonormal axes (k, 3): about these a cue holds the cell."""
    return _axes(model, r)[1]


def _axes(model: Model, r: Array) -> tuple[Array, Array]:
    if model.cue is None:
        return np.eye(3), np.zeros((0, 3))
    directions = model.directions(r)
    differences = [
        model.cue_factor(rotated(directions, TILT * axis, 1.0))
        - model.cue_factor(rotated(directions, -TILT * axis, 1.0))
        for axis in np.eye(3)
    ]
    _, sizes, axes = np.linalg.svd(np.stack(differences, axis=1) / (2.0 * TILT * np.sqrt(len(r))))
    free = sizes < MAX_FREE_CHANGE
    return axes[free], axes[~free]


def angular_velocity(model: Model, r: Array, c: Array, g: Geometry, v: Array) -> Array:
    """Angular velocity (3,) [1/T] of shape and concentration, for filaments of velocity v (V, 3).

    It is that of the rotation closest to the present change of both, in the frame of v. For a cell
    that rotates rigidly, as on a circular path, it is exact in the discrete equations as well.
    """
    p = model.parameters
    matrix, weighted, bend = _rotation_fit(model, r, c, g)
    v_n = np.einsum("vi,vi->v", v, g.normals)
    of_c, of_r = 1.0 / (p.c0 + c), 1.0 / p.R0
    c_rate = rate_of_change(model, c, g, v)
    change = np.concatenate([of_c * (c_rate - bend * c * v_n), of_r * v_n])
    return np.linalg.solve(matrix, weighted.T @ change)


def angular_response(model: Model, r: Array, c: Array, g: Geometry) -> tuple[Array, Array]:
    """Derivatives of `angular_velocity` about a cell that does not change, each (3, V).

    With respect to what the nodes gain per unit time, for filaments that move within the surface,
    and to v.n.
    """
    p, n = model.parameters, len(c)
    matrix, weighted, bend = _rotation_fit(model, r, c, g)
    of_changes = np.linalg.solve(matrix, weighted.T)
    of_c = of_changes[:, :n] / (p.c0 + c)
    of_gain = of_c / g.node_areas
    # motion along node normals is partly one within the triangles, and `rate_of_change` sees it
    within = np.stack([_flow_within(row, c, g, model.mesh.faces) for row in of_gain])
    return of_gain, of_changes[:, n:] / p.R0 - of_c * bend * c + within


def _flow_within(shares: Array, c: Array, g: Geometry, faces: Index) -> Array:
    """By v.n (V,): the sum of `shares` (V,) times what `advection` with v.n n brings to a node."""
    return np.asarray(_carried_along(shares, c, g.face_areas, g.gradients, g.normals, faces))


@compiled
def _carried_along(shares, c, areas, gradients, normals, faces):  # type: ignore[no-untyped-def]
    along = np.zeros(len(c))
    for f in range(len(areas)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        total = c[i] + c[j] + c[k]
        for d in range(3):
            slope = (
                (
                    shares[i] * gradients[f, 0, d]
                    + shares[j] * gradients[f, 1, d]
                    + shares[k] * gradients[f, 2, d]
                )
                * areas[f]
                / 12.0
            )
            along[i] += slope * (total + c[i]) * normals[i, d]
            along[j] += slope * (total + c[j]) * normals[j, d]
            along[k] += slope * (total + c[k]) * normals[k, d]
    return along


def _rotation_fit(model: Model, r: Array, c: Array, g: Geometry) -> tuple[Array, Array, Array]:
    """The closest rotation to a change x (2V,) of c/(c0 + c) and r.n/R0 is M^-1 W^T x.

    Changes at points that move along the normals. Returns M (3, 3), W (2V, 3), and the change of
    area (V,) by such a motion [1/L].
    """
    p, mesh = model.parameters, model.mesh
    x = r - volume_centroid(r, mesh.faces)
    # how a cell changes that rotates around the three axes, in columns
    tilt = _moments(x, g.normals)
    carried = _carried(g.face_areas, g.gradients, mesh.faces, c, x) / g.node_areas[:, None]
    bend = np.einsum("vi,vi->v", area_gradient(g, mesh.faces), g.normals) / g.node_areas
    of_c, of_r = 1.0 / (p.c0 + c), 1.0 / p.R0
    basis = np.concatenate([(of_c * (carried - (bend * c)[:, None] * tilt).T).T, of_r * tilt])
    weighted = (np.tile(g.node_areas / g.area, 2) * basis.T).T
    return basis.T @ weighted + MIN_CHANGE * np.eye(3), weighted, bend


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


def rotated(vectors: Array, angular_velocity: Array, time: float) -> Array:
    """Vectors (V, 3) after a rotation with `angular_velocity` (3,) [1/T] for a time."""
    angle = float(np.linalg.norm(angular_velocity)) * time
    if angle == 0.0:
        return vectors
    axis = angular_velocity * (time / angle)
    across = _cross_matrix(axis)
    return vectors + vectors @ (np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across)


def rotation(angular_velocity: Array, x: Array) -> Array:
    """Velocities (V, 3) of points x (V, 3) that rotate around the origin, angular velocity (3,)."""
    return x @ _cross_matrix(angular_velocity)


def _cross_matrix(a: Array) -> Array:
    # rows a x e_i: x @ them is a x x
    return np.array([[0.0, a[2], -a[1]], [-a[2], 0.0, a[0]], [a[1], -a[0], 0.0]])
