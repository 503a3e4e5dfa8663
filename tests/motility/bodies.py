"""Bodies with known drag, and flows on them."""

import numpy as np
from scipy.special import elliprd, elliprf

from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.motility.meridian import Meridian, StokesBody


def spheroid(width, length, modes=32):
    """A spheroid of half-axes width, width, length along z: r = width sin x, z = length cos x."""
    r, z = np.zeros(modes), np.zeros(modes)
    r[0], z[1] = width, length
    return StokesBody(Meridian(r, z), modes)


def ellipsoid(axes, subdivisions):
    """Nodes, faces and exact normals of an ellipsoid."""
    sphere, faces = uniform_icosphere(subdivisions)
    r, normals = sphere * axes, sphere / axes
    return r, faces, normals / np.linalg.norm(normals, axis=1)[:, None]


def drag_of_ellipsoid(axes):
    """Drag along its axes, and torque about them, viscosity 1 (Oberbeck 1876, Jeffery 1922)."""
    squares = np.asarray(axes, dtype=float) ** 2
    whole = 2.0 * elliprf(*squares)
    parts = np.array([2.0 / 3.0 * elliprd(*np.delete(squares, k), squares[k]) for k in range(3)])
    weighted = squares * parts
    drag = 16.0 * np.pi / (whole + weighted)
    pairs = [(1, 2), (2, 0), (0, 1)]
    torque = [
        16.0 * np.pi / 3.0 * (squares[i] + squares[j]) / (weighted[i] + weighted[j])
        for i, j in pairs
    ]
    return drag, np.array(torque)


def along_meridian(body, u):
    """Velocities (3, n), r, phi and z, of a flow u along the meridian."""
    n_r, n_z = body.normals
    return np.stack([u * n_z, 0.0 * u, -u * n_r])


def rigid(body):
    """Order 0: along and around z; order 1: along x and around y."""
    r, z = body.meridian.position(body.x)
    one, zero = np.ones_like(r), np.zeros_like(r)
    return (
        np.array([[zero, zero, one], [zero, r, zero]]),
        np.array([[one, -one, zero], [z, -z, -r]]),
    )


def product(body, forces, velocities):
    """Integrals (k, l) of products, of order 0."""
    return 2.0 * np.pi * np.einsum("kin,lin,n->kl", forces, velocities, body.weights)


def smooth_tangential(x, normals, seed=0):
    """A smooth tangential flow (V, 3) without any symmetry."""
    a, b, c = np.random.default_rng(seed).normal(size=(3, 3))
    v = np.outer(np.sin(x @ a), b) + np.outer((x @ b) * (x @ c), a) + np.cross(c, x) + b
    return v - np.einsum("vi,vi->v", v, normals)[:, None] * normals
