"""Triangulated bodies: drag, swimming and rotation at second order, and the reciprocal theorem."""

import numpy as np
import pytest

import amoeboid as am
from amoeboid.motility.cells import surface_of
from amoeboid.motility.triangulated import TriangulatedSurface
from motility.bodies import drag_of_ellipsoid, ellipsoid, smooth_tangential

AXES = np.array([1.3, 1.0, 0.8])
FRONT = np.array([0.0, 0.0, 1.0])


def rotation_matrix(seed=3):
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


def body(axes, subdivisions, seed=0):
    """An ellipsoid with a smooth flow: nodes, faces, flow, normals."""
    r, faces, normals = ellipsoid(axes, subdivisions)
    return r, faces, smooth_tangential(r, normals, seed), normals


def exact_velocity(axes, seed=0):
    """V = -(1/(3 Vol)) int (x.n) u dA of an ellipsoid; x.n dA is Vol/(4 pi) times 3 dOmega there.

    So it is minus the mean of u over the directions of the sphere that it is made from.
    """
    z, w = np.polynomial.legendre.leggauss(40)
    phi = 2 * np.pi * np.arange(80) / 80
    s = np.sqrt(1 - z**2)
    n = np.stack([np.outer(s, np.cos(phi)), np.outer(s, np.sin(phi)), np.outer(z, 1 + 0 * phi)], -1)
    r, normals = n.reshape(-1, 3) * axes, n.reshape(-1, 3) / axes
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    u = smooth_tangential(r, normals, seed)
    weights = np.repeat(w, 80) / (2 * 80)
    return -weights @ u, weights, n.reshape(-1, 3), u


@pytest.mark.parametrize(
    "axes", [(1.0, 1.0, 1.0), (1.0, 1.0, 2.0), (2.0, 2.0, 1.0), (1.3, 1.0, 0.8)]
)
def test_drag_and_torque_of_ellipsoids_are_of_second_order(axes):
    drag, torque = drag_of_ellipsoid(axes)
    errors = []
    for n in (1, 2):
        r, faces, _ = ellipsoid(np.array(axes), n)
        matrix = TriangulatedSurface(r, faces, 0 * r, FRONT).fluid
        errors.append(np.diag(matrix)[:6] / [*drag, *torque] - 1)
    coarse, fine = np.abs(errors)
    assert np.all(fine < 0.012)
    orders = np.log(coarse / fine) / np.log(np.sqrt(162 / 42))
    assert np.all((orders > 1.6) & (orders < 2.6))


@pytest.mark.slow
def test_orders_of_drag_and_torque_up_to_642_nodes():
    drag, torque = drag_of_ellipsoid(AXES)
    errors = []
    for n in (2, 3):
        r, faces, _ = ellipsoid(AXES, n)
        matrix = TriangulatedSurface(r, faces, 0 * r, FRONT).fluid
        errors.append(np.abs(np.diag(matrix)[:6] / [*drag, *torque] - 1))
    assert np.all(errors[1] < 0.003)
    orders = np.log(errors[0] / errors[1]) / np.log(np.sqrt(642 / 162))
    assert np.all(np.abs(orders - 2.0) < 0.25)


@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 1.0, 2.0), (1.3, 1.0, 0.8)])
def test_ellipsoids_swim_as_the_closed_form_off_axis_and_anywhere(axes):
    axes = np.array(axes)
    exact, *_ = exact_velocity(axes)
    turn, errors, sizes = rotation_matrix(), [], []
    for n in (1, 2):
        r, faces, u, _ = body(axes, n)
        if np.linalg.det(turn) < 0:
            turn = -turn
        cell = am.MeasuredCell(r @ turn.T + [3.0, -2.0, 5.0], faces, u @ turn.T, front=FRONT)
        found = am.migrate(cell)
        errors.append(np.linalg.norm(found.velocity @ turn - exact) / np.linalg.norm(exact))
        sizes.append(len(r))
        # the estimate is not too small
        assert found.error > 0.7 * np.linalg.norm(found.velocity @ turn - exact)
    assert errors[1] < 0.025
    assert errors[0] / errors[1] > 2.0


def test_rotation_of_a_sphere():
    """Omega = -3/(8 pi R^3) int n x u dA (Stone and Samuel 1996)."""
    _, weights, n, u = exact_velocity(np.ones(3))
    exact = -1.5 * weights @ np.cross(n, u)
    errors = []
    for k in (1, 2):
        r, faces, flow, _ = body(np.ones(3), k)
        found = am.migrate(am.MeasuredCell(r, faces, flow, front=FRONT))
        errors.append(np.linalg.norm(found.angular_velocity - exact) / np.linalg.norm(exact))
    assert errors[1] < 0.02
    assert errors[0] / errors[1] > 2.0


def test_resistance_is_symmetric_and_does_not_depend_on_the_axes():
    r, faces, u, _ = body(AXES, 1)
    a = am.migrate(am.MeasuredCell(r, faces, u, front=FRONT))
    assert np.allclose(a.motion.resistance, a.motion.resistance.T)
    assert np.all(np.linalg.eigvalsh(a.motion.resistance) > 0)
    turn = rotation_matrix()
    turn *= np.sign(np.linalg.det(turn))
    b = am.migrate(am.MeasuredCell(r @ turn.T, faces, u @ turn.T, front=turn @ FRONT))
    np.testing.assert_allclose(b.velocity, turn @ a.velocity, atol=1e-12)
    np.testing.assert_allclose(b.angular_velocity, turn @ a.angular_velocity, atol=1e-12)
    np.testing.assert_allclose(b.drag, turn @ a.drag @ turn.T, atol=1e-10)
    assert b.power == pytest.approx(a.power, rel=1e-10)
    assert b.speed == pytest.approx(a.speed, rel=1e-10)


def stokeslets(x, sources):
    d = x[:, None] - sources
    size = np.linalg.norm(d, axis=2)
    tensor = np.eye(3) / size[..., None, None]
    tensor = tensor + d[..., :, None] * d[..., None, :] / size[..., None, None] ** 3
    return tensor.transpose(0, 2, 1, 3).reshape(3 * len(x), -1)


def swimming(x, u, sources):
    """Velocity and rotation from the flow itself: point forces inside, without force or torque."""
    rigid = [np.broadcast_to(e, x.shape).ravel() for e in np.eye(3)]
    rigid += [np.cross(e, x).ravel() for e in np.eye(3)]
    matrix = np.hstack([stokeslets(x, sources), -np.stack(rigid, axis=1)])
    force = np.hstack([np.tile(np.eye(3), len(sources)), np.zeros((3, 6))])
    torque = np.zeros((3, 3 * len(sources) + 6))
    for k, s in enumerate(sources):
        torque[:, 3 * k : 3 * k + 3] = np.cross(s, np.eye(3)).T
    rows = np.vstack([matrix, 1e3 * force, 1e3 * torque])
    right = np.concatenate([u.ravel(), np.zeros(6)])
    return np.linalg.lstsq(rows, right, rcond=1e-13)[0][-6:]


def test_reciprocal_theorem_agrees_with_rings_of_forces_for_an_axisymmetric_cell():
    """The flow around a soft polarized cell by rings of forces, with no boundary integral."""
    state = am.steady_states(am.Parameters(D=0.4, v_p0=6.0, delta_P=20.0), (1,)).fastest_stable
    surface, rings, around = surface_of(state.solution.cell), 28, 96
    x = (np.arange(120) + 0.5) * np.pi / 120
    points = surface._points(x, 0 * x, 0 * x)
    r, z = surface.meridian.position((np.arange(rings) + 0.5) * np.pi / rings)
    phi = np.arange(around) * 2 * np.pi / around
    columns = []
    for ring, height in zip(0.6 * r, 0.6 * z, strict=True):
        place = np.stack([ring * np.cos(phi), ring * np.sin(phi), 0 * phi + height], axis=1)
        tensor = stokeslets(points.x, place).reshape(-1, around, 3) / around
        out = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
        columns.append(np.einsum("pai,ai->p", tensor, out))
        columns.append(tensor[:, :, 2].sum(axis=1))
    ahead = np.tile([0.0, 0.0, 1.0], len(x))
    matrix = np.column_stack([*columns, -ahead])
    no_force = np.append(np.tile([0.0, 1.0], rings), 0.0)
    rows = np.vstack([matrix, 1e3 * no_force])
    right = np.append(points.ways[6].ravel(), 0.0)
    found, *_ = np.linalg.lstsq(rows, right, rcond=1e-14)
    assert np.abs(rows @ found - right).max() < 1e-6
    assert found[-1] == pytest.approx(am.migrate(state).velocity[2], abs=1e-8)


def test_reciprocal_theorem_agrees_with_point_forces_on_a_mesh():
    """An ellipsoid with a flow without symmetry, with its rotation, to the error of the mesh."""
    r, faces, u, _ = body(AXES, 2)
    k = np.arange(120) + 0.5
    z, phi = 1 - 2 * k / 120, np.pi * (1 + np.sqrt(5)) * k
    n = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z], axis=1)
    expected = swimming(r, u, 0.5 * n * AXES)
    found = am.migrate(am.MeasuredCell(r, faces, u, front=FRONT))
    size = np.abs(expected).max()
    np.testing.assert_allclose(found.velocity, expected[:3], atol=0.015 * size)
    np.testing.assert_allclose(found.angular_velocity, expected[3:], atol=0.015 * size)


def test_area_of_caps_and_bands_is_that_of_the_sphere():
    r, faces, _ = ellipsoid(np.ones(3), 2)
    surface = TriangulatedSurface(r, faces, 0 * r, FRONT)
    for angle in np.radians([20.0, 40.0, 80.0]):
        cap = 2 * np.pi * (1 - np.cos(angle))
        for points, axis in surface.cap(angle, None)[:5]:
            assert abs(axis @ FRONT) < 1e-12
            assert points.weights.sum() == pytest.approx(cap, rel=0.05)
        band = 4 * np.pi * np.sin(angle)
        assert surface.band(angle).weights.sum() == pytest.approx(band, rel=0.03)


def test_patch_with_an_axis_moves_along_its_substrate():
    r, faces, u, _ = body(AXES, 2)
    cell = am.MeasuredCell(r, faces, u, front=FRONT)
    found = am.migrate(cell, am.Patch(40.0, axis=(1.0, 0.0, 0.0)))
    assert found.velocity[0] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(found.angular_velocity[1:], 0.0, atol=1e-12)
    # far from the patch the flow does not matter
    other = np.where(r[:, :1] < -0.3, 0.0, u)
    again = am.migrate(am.MeasuredCell(r, faces, other, front=FRONT), found.environment)
    moved = found.motion.velocity - again.motion.velocity
    # but for the velocity of the center of volume, which is taken out of a flow
    assert np.linalg.norm(moved) < 0.05 * np.linalg.norm(found.velocity)
