"""Motions of the whole cell, against exact gradients and against moving it."""

import numpy as np
import pytest

from amoeboid.surface.geometry import geometry
from amoeboid.surface.mesh import connectivity, icosphere
from amoeboid.surface.rigid import changes, gradient, rotations, translations
from surface.shapes import observed_orders


def bumpy(x):
    """A field on the unit sphere, and its surface gradient."""
    value = x[:, 0] * x[:, 1] + x[:, 2] ** 3
    slope = np.stack([x[:, 1], x[:, 0], 3.0 * x[:, 2] ** 2], axis=1)
    return value, slope - np.einsum("vi,vi->v", slope, x)[:, None] * x


def test_the_gradient_at_nodes_converges():
    errors = []
    for subdivisions in (2, 3, 4):
        x, faces = icosphere(subdivisions)
        value, exact = bumpy(x)
        found = gradient(value, geometry(x, faces), connectivity(faces))
        errors.append(np.sqrt(np.mean((found - exact) ** 2)))
    print(errors)
    # of 0.7 on average; order 1.5 on the uneven triangles of a subdivided icosahedron
    assert errors[0] < 0.02
    assert np.all(observed_orders((162, 642, 2562), np.array(errors)) > 1.3)


@pytest.mark.parametrize("motions", [translations, rotations])
def test_changes_are_those_at_fixed_places(motions):
    """As seen from the nodes: the field where a node was before the surface was moved under it."""
    x, _ = icosphere(4)
    value, exact = bumpy(x)
    normals = x  # of the sphere
    small = 1e-5
    for motion, found in zip(motions(x), changes(motions(x), exact, normals, 2.0).T, strict=True):
        before = x - small * motion
        before /= np.linalg.norm(before, axis=1)[:, None]
        c, h = np.split(found, 2)
        np.testing.assert_allclose(c, (bumpy(before)[0] - value) / small, atol=1e-4)
        np.testing.assert_allclose(h, np.einsum("vi,vi->v", motion, x) / 2.0, atol=1e-12)
