"""Extrema between nodes: the quadratic around a node is the one of least squares."""

import numpy as np
import pytest

from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.extrema import refined_extremum
from amoeboid.meshes.geometry import geometry


def bipyramid(around, rng):
    """Node 0 has `around` neighbors."""
    angles = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    r = np.concatenate([[[0.0, 0.0, 0.6]], [[0.0, 0.0, -0.6]], ring])
    k = 2 + np.arange(around)
    after = np.roll(k, -1)
    faces = [(0, a, b) for a, b in zip(k, after, strict=True)]
    faces += [(1, b, a) for a, b in zip(k, after, strict=True)]
    return r + 0.1 * rng.standard_normal(r.shape), np.array(faces)


def by_least_squares(r, normal, values, ring, sign):
    """The same at node 0 by singular values, eigenvalues and any axes in the tangent plane."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    x = (r[ring] - r[0]) @ np.column_stack([first, np.cross(normal, first)])
    reach = np.abs(x).max()
    x, y = (x / np.linalg.norm(x, axis=1).max()).T
    reach /= np.linalg.norm(
        (r[ring] - r[0]) - np.outer((r[ring] - r[0]) @ normal, normal), axis=1
    ).max()
    basis = np.column_stack([x, y, x * x / 2, x * y, y * y / 2])
    gx, gy, xx, xy, yy = np.linalg.lstsq(basis, values[ring] - values[0], rcond=None)[0]
    hessian, gradient = np.array([[xx, xy], [xy, yy]]), np.array([gx, gy])
    if np.max(sign * np.linalg.eigvalsh(hessian)) >= 0:
        return values[0]
    step = -np.linalg.solve(hessian, gradient)
    return values[0] + 0.5 * gradient @ step if np.linalg.norm(step) <= reach else values[0]


@pytest.mark.parametrize("around", [3, 4, 5, 6, 8])
def test_extremum_is_that_of_the_quadratic_of_least_squares(around):
    """Also with fewer neighbors than it has coefficients, where the shortest ones are taken."""
    rng = np.random.default_rng(around)
    between = 0
    for _ in range(40):
        r, faces = bipyramid(around, rng)
        mesh, normals = connectivity(faces), geometry(r, faces).normals
        for sign in (1.0, -1.0):
            values = -sign * (0.3 * rng.standard_normal(len(r)) + np.sum(r[:, :2] ** 2, axis=1))
            found = refined_extremum(0, sign, mesh.row_start, mesh.columns, r, normals, values)
            wanted = by_least_squares(r, normals[0], values, np.arange(2, 2 + around), sign)
            assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)
            between += found != values[0]
    assert between > 10


@pytest.mark.parametrize(
    "ring",
    [
        [[1, 0, 0], [0.5, 0, 0], [-1, 0, 0], [-0.5, 0, 0]],  # on one line as seen from above
        [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [-1, -0.5, 0], [-0.3, -1, 0]],  # two pairs
    ],
)
def test_of_a_constant_and_of_dependent_neighbors_the_value_at_the_node_counts(ring):
    r, faces = bipyramid(len(ring), np.random.default_rng(0))
    r[2:] = ring
    mesh, normals = connectivity(faces), np.tile([0.0, 0.0, 1.0], (len(r), 1))
    fields = np.random.default_rng(1).standard_normal((50, len(r)))
    for values in (np.full(len(r), 2.0), *fields):
        for sign in (1.0, -1.0):
            found = refined_extremum(0, sign, mesh.row_start, mesh.columns, r, normals, values)
            assert found == values[0]
