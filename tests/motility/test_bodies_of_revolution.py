"""Stokes flow around bodies of revolution against closed forms and other methods."""

import numpy as np
import pytest
from scipy.integrate import quad

from amoeboid.motility.ring_kernels import RingIntegrals, double_layer, single_layer
from motility.bodies import (
    along_meridian,
    drag_of_ellipsoid,
    product,
    rigid,
    spheroid,
)

RINGS = [(1.0, 0.9, 0.2), (1.0, 0.05, 0.7), (0.3, 1.1, -0.4), (1.0, 1.01, 0.02)]


def integrated(function):
    """Over a whole ring."""
    return 2.0 * quad(function, 0.0, np.pi, epsabs=1e-12, epsrel=1e-12, limit=400)[0]


def vectors(psi):
    return np.array([[np.cos(psi), np.sin(psi), 0], [-np.sin(psi), np.cos(psi), 0], [0, 0, 1]])


@pytest.mark.parametrize(("r0", "r", "z"), RINGS)
@pytest.mark.parametrize("m", [0, 1])
def test_ring_kernels_are_integrals_of_the_oseen_tensor(r0, r, z, m):
    rings = RingIntegrals(*(np.array([v]) for v in (r0, r, r0 - r, z)))
    found = single_layer(rings, m)[..., 0]
    even, odd = (lambda psi: np.cos(m * psi)), (lambda psi: np.sin(m * psi))
    for i in range(3):
        for j in range(3):

            def tensor(psi, i=i, j=j):
                d = np.array([r0 - r * np.cos(psi), -r * np.sin(psi), z])
                size = np.linalg.norm(d)
                source = vectors(psi)[j]
                return source[i] / size + d[i] * (d @ source) / size**3

            # the order m turns with the target: sin m(psi + phi0) and cos m(psi + phi0)
            factor = even if (i == 1) == (j == 1) else odd
            sign = -1.0 if i == 1 and j != 1 else 1.0
            expected = sign * integrated(lambda psi, f=factor, t=tensor: f(psi) * t(psi))
            assert found[i, j] == pytest.approx(expected, rel=1e-9, abs=1e-10)


@pytest.mark.parametrize(("r0", "r", "z"), RINGS[:3])
def test_ring_kernel_of_the_double_layer_is_the_integral_of_the_stress(r0, r, z):
    rings = RingIntegrals(*(np.array([v]) for v in (r0, r, r0 - r, z)))
    normal = np.array([0.6, 0.8])
    found = double_layer(rings, normal[:1], normal[1:])[..., 0]
    for i, target in enumerate((0, 2)):
        for j, source in enumerate((0, 2)):

            def stress(psi, target=target, source=source):
                d = np.array([r * np.cos(psi) - r0, r * np.sin(psi), -z])
                e = vectors(psi)
                n = normal[0] * e[0] + normal[1] * e[2]
                return -6.0 * (d @ e[source]) * (d @ n) * d[target] / np.linalg.norm(d) ** 5

            assert found[i, j] == pytest.approx(integrated(stress), rel=1e-9, abs=1e-10)


@pytest.mark.parametrize(("width", "length"), [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0), (1.0, 1.3)])
def test_drag_and_torque_of_spheroids_are_exact(width, length):
    body = spheroid(width, length)
    drag, torque = drag_of_ellipsoid([width, width, length])
    axial, across = rigid(body)
    found = product(body, -body.tractions(axial, 0), axial)
    np.testing.assert_allclose(np.diag(found), [drag[2], torque[2]], rtol=1e-9)
    found = 0.5 * product(body, -body.tractions(across, 1), across)
    np.testing.assert_allclose(np.diag(found), [drag[0], torque[1]], rtol=1e-9)
    np.testing.assert_allclose(found[0, 1], 0.0, atol=1e-10)


def test_errors_of_an_elongated_spheroid_fall_geometrically():
    drag, _ = drag_of_ellipsoid([1.0, 1.0, 5.0])
    errors = []
    for modes in (16, 32, 64):
        body = spheroid(1.0, 5.0, modes)
        axial, _ = rigid(body)
        errors.append(abs(product(body, -body.tractions(axial, 0), axial)[0, 0] / drag[2] - 1))
    assert errors[0] < 1e-3
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-2 * errors[1]


def test_velocity_of_a_prolate_spheroid_with_three_modes():
    """0.7224532203: -(1/(3 Vol)) int (x.n) u dA, computed once elsewhere, too."""
    body = spheroid(1.0, 2.0)
    x = body.x
    u = along_meridian(body, -(np.sin(x) + 0.3 * np.sin(2 * x) + 0.2 * np.sin(3 * x)))
    (axis, _), _ = rigid(body)
    force = -body.tractions(axis[None], 0)
    velocity = -product(body, force, u[None])[0, 0] / product(body, force, axis[None])[0, 0]
    assert abs(velocity) == pytest.approx(0.7224532203, abs=1e-9)
    r, z = body.meridian.position(x)
    n_r, n_z = body.normals
    volume = 4.0 * np.pi / 3.0 * 2.0
    mean = 2.0 * np.pi * body.weights @ ((r * n_r + z * n_z) * u[2]) / (3.0 * volume)
    assert velocity == pytest.approx(-mean, abs=1e-9)
    # and from the force on the flow itself, without the reciprocal theorem
    direct = product(body, -body.outside_tractions(u[None]), axis[None])[0, 0]
    assert -direct / product(body, force, axis[None])[0, 0] == pytest.approx(-mean, abs=1e-8)


@pytest.mark.parametrize("shape", [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0)])
def test_a_rigid_motion_has_the_tractions_of_its_single_layer(shape):
    body = spheroid(*shape)
    axis = rigid(body)[0][:1]
    np.testing.assert_allclose(
        body.outside_tractions(axis)[0, 2], body.tractions(axis, 0)[0, 2], atol=1e-6
    )


def test_power_of_squirmer_modes_on_a_sphere():
    """8 pi (2 B1^2 + B2^2)/3 for viscosity and radius 1 (Blake 1971)."""
    body = spheroid(1.0, 1.0)
    sin, cos = np.sin(body.x), np.cos(body.x)
    u = np.stack([along_meridian(body, sin), along_meridian(body, sin * cos)])
    (axis, _), _ = rigid(body)
    powers = product(body, -body.outside_tractions(u), u)
    coupling = product(body, -body.outside_tractions(u), axis[None])[:, 0]
    own = powers - np.outer(coupling, coupling) / (6.0 * np.pi)
    np.testing.assert_allclose(own, 8.0 * np.pi / 3.0 * np.diag([2.0, 1.0]), rtol=1e-10, atol=1e-10)
