"""Motions of the whole cell, against exact gradients and against moving it."""

import numpy as np
import pytest

from amoeboid.meshes.connectivity import connectivity, icosphere
from amoeboid.meshes.geometry import geometry, volume_centroid
from amoeboid.model.parameters import Parameters
from amoeboid.surface.initial import sphere
from amoeboid.surface.rigid import (
    angular_velocity,
    changes,
    gradient,
    rotated,
    rotation,
    rotations,
    translations,
)
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


def rotations_about_all_axes(x):
    return rotations(x, np.eye(3))


@pytest.mark.parametrize("motions", [translations, rotations_about_all_axes])
def test_changes_by_rigid_motions_are_those_at_fixed_points(motions):
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


def lopsided():
    """A cell without symmetry in which diffusion rules, and a smooth flow within it."""
    model, state = sphere(Parameters(D=3.0), 2)
    x = state.r
    r = x * (1.0 + 0.05 * x[:, :1] * x[:, 1:2] + 0.03 * x[:, 2:] ** 3)
    c = 3.0 + 2.0 * x[:, 0] + x[:, 1] * x[:, 2] + x[:, 2] ** 2
    v = np.stack([0.3 * x[:, 1] * x[:, 2], x[:, 2] ** 2, 0.2 * x[:, 0] - x[:, 1]], axis=1)
    return model, r, c, v


def rate_of(model, r, c, v):
    return angular_velocity(model, r, c, geometry(r, model.mesh.faces), v)


def test_angular_velocity_adds_an_imposed_rotation():
    model, r, c, v = lopsided()
    more = np.array([0.2, -0.5, 0.3])
    faster = v + rotation(more, r - volume_centroid(r, model.mesh.faces))
    found = rate_of(model, r, c, faster) - rate_of(model, r, c, v)
    np.testing.assert_allclose(found, more, rtol=1e-2)


def test_angular_velocity_rotates_with_the_cell():
    model, r, c, v = lopsided()
    angle = np.array([0.4, 1.1, -0.7])
    found = rate_of(model, rotated(r, angle, 1.0), c, rotated(v, angle, 1.0))
    expected = rotated(rate_of(model, r, c, v)[None], angle, 1.0)[0]
    assert np.linalg.norm(expected) > 0.05
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_angular_velocity_of_a_homogeneous_sphere_vanishes():
    model, state = sphere(Parameters(), 2)
    found = rate_of(model, state.r, state.c, rotation(np.array([0.0, 0.0, 1.0]), state.r))
    assert np.linalg.norm(found) < 0.05


def test_rotated_points_move_with_their_velocities():
    x, rate, short = icosphere(1)[0], np.array([0.3, -0.2, 0.5]), 1e-6
    moved = (rotated(x, rate, short) - rotated(x, rate, -short)) / (2.0 * short)
    np.testing.assert_allclose(moved, rotation(rate, x), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(rotated(x, rate, 7.0), axis=1), 1.0, atol=1e-14)
    whole = 2.0 * np.pi / np.linalg.norm(rate)
    np.testing.assert_allclose(rotated(x, rate, whole), x, atol=1e-14)
