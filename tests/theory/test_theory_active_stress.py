"""Active stress: the one-velocity model equals the two-velocity one, on shapes without symmetry."""

import numpy as np
import pytest
import sympy as sp

import theory.shell_equations as model
from amoeboid.closed_forms.active_stress import (
    Meridian,
    active_stress,
    principal_active_stresses,
    principal_curvatures,
    single_velocity_stress,
    strain_tensor,
    viscous_stress,
)
from amoeboid.validation import InvalidInput

u, w = sp.symbols("u w")
ETA_S, ETA_B = 1.3, 0.45


def general_surface():
    """Position, full velocity and v_p of a lopsided closed-surface patch, and its normal."""
    radius = 1 + sp.sin(2 * u) * sp.cos(w) / 5 + sp.cos(3 * u) / 7
    position = sp.Matrix([
        radius * sp.sin(u) * sp.cos(w),
        sp.Rational(6, 5) * radius * sp.sin(u) * sp.sin(w),
        radius * sp.cos(u) + sp.sin(w) / 9,
    ])  # fmt: skip
    velocity = sp.Matrix([sp.sin(u + 2 * w), sp.cos(u) * sp.sin(w), u * sp.cos(w) / 3])
    speed = 1 + sp.cos(u) * sp.sin(w) / 3
    cross = position.diff(u).cross(position.diff(w))
    return position, velocity, speed, cross / sp.sqrt(cross.dot(cross))


@pytest.fixture(scope="module")
def tensors():
    """Normal, grad v, grad v_c, grad n, v_p, metric-rate strain: arrays at 40 random points."""
    position, velocity, speed, normal = general_surface()
    at = np.random.default_rng(3).uniform([0.4, 0.0], [2.6, 6.0], (40, 2))

    def values(expression):
        function = sp.lambdify((u, w), expression, "numpy", cse=True)
        return np.array([np.array(function(*point), dtype=float) for point in at])

    frame = values(position.jacobian([u, w]))
    inverse = np.linalg.inv(np.swapaxes(frame, 1, 2) @ frame)

    def surface_gradient(field):
        # (grad_s v)_ij = d_i v_j = sum_ab d_a r_i g^ab d_b v_j
        return frame @ inverse @ np.swapaxes(values(field.jacobian([u, w])), 1, 2)

    rate = np.swapaxes(frame, 1, 2) @ values(velocity.jacobian([u, w]))
    strain = frame @ inverse @ (rate + np.swapaxes(rate, 1, 2)) @ inverse
    gradients = [surface_gradient(v) for v in (velocity, velocity - speed * normal, normal)]
    return [
        values(normal)[..., 0], *gradients, values(speed), strain @ np.swapaxes(frame, 1, 2)
    ]  # fmt: skip


def test_strain_tensor_is_the_metric_rate(tensors):
    normal, grad_v, *_, strain = tensors
    assert strain_tensor(grad_v, normal) == pytest.approx(strain, abs=1e-11)


def test_active_stress_makes_one_velocity_equal_to_two(tensors):
    normal, grad_v, grad_v_c, grad_n, v_p, _ = tensors
    two = viscous_stress(grad_v_c, normal, ETA_S, ETA_B)
    one = single_velocity_stress(grad_v, grad_n, normal, v_p, ETA_S, ETA_B)
    assert one == pytest.approx(two, abs=1e-11)
    assert np.abs(active_stress(grad_n, normal, v_p, ETA_S, ETA_B)).max() > 1
    tangential = np.einsum("...ij,...j->...i", one, normal)
    assert np.abs(tangential).max() < 1e-11
    assert one == pytest.approx(np.swapaxes(one, -1, -2), abs=1e-11)


def test_gradient_of_a_normal_velocity_is_its_speed_times_the_curvature(tensors):
    """SI `activestress1` and `activestress2`, with H = div_s n."""
    normal, grad_v, grad_v_c, grad_n, v_p, _ = tensors
    growth = grad_v - grad_v_c  # of v_p n, by its definition
    H = np.trace(grad_n, axis1=-2, axis2=-1)
    assert np.trace(growth, axis1=-2, axis2=-1) == pytest.approx(v_p * H, abs=1e-11)
    projector = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    assert growth @ projector == pytest.approx(v_p[:, None, None] * grad_n, abs=1e-11)
    assert grad_n == pytest.approx(np.swapaxes(grad_n, -1, -2), abs=1e-11)


def axisymmetric_shape():
    return 1 + model.legendre(2) / 4 + model.legendre(3) / 6


def meridian(shape, nodes):
    """Derivatives along theta, from the embedding r = shape(cos theta) e_r."""
    theta = sp.symbols("theta")
    h = shape.subs(model.x, sp.cos(theta))
    r, z = h * sp.sin(theta), h * sp.cos(theta)
    expressions = [r, r.diff(theta), z.diff(theta), r.diff(theta, 2), z.diff(theta, 2)]
    values = [sp.lambdify(theta, e, "numpy")(np.arccos(nodes)) for e in expressions]
    return Meridian(r=values[0], r_x=values[1], z_x=values[2], r_xx=values[3], z_xx=values[4])


def normal_field(shape, speed):
    """speed * n as an increment of the embedding: n = (h e_r - h_theta e_theta)/g."""
    x = model.x
    slope = sp.diff(shape, x)
    g = sp.sqrt(shape**2 + model.s2 * slope**2)
    return model.Vectors(speed * shape / g, -speed * slope / g)


def test_curvatures_are_the_strain_rates_of_a_unit_normal_flow():
    shape = axisymmetric_shape()
    nodes = np.linspace(-0.95, 0.95, 21)
    strains = model.strain_rates(shape, normal_field(shape, sp.Integer(1)))
    expected = [sp.lambdify(model.x, e, "numpy")(nodes) for e in strains]
    assert principal_curvatures(meridian(shape, nodes)) == pytest.approx(np.array(expected))


def test_virtual_power_of_the_active_stress_follows_from_the_dissipation_function():
    """delta D(v_c) = delta D(v) + oint sigma_active : grad delta v, on a deformed cell."""
    shape, speed = axisymmetric_shape(), 1 + model.x / 2
    x = model.x
    full = model.Vectors(x / 3, 1 + x**2)
    treadmilling = normal_field(shape, -speed)
    cortex = model.plus(full, treadmilling)
    nodes, weights = np.polynomial.legendre.leggauss(80)
    values = {model.eta_s: ETA_S, model.eta_b: ETA_B}
    for variation in (model.radial(model.legendre(2)), model.tangential(model.legendre(1))):
        two, one = (
            np.sum(weights * sp.lambdify(x, e.subs(values), "numpy", cse=True)(nodes))
            for e in (
                model.dissipation_variation(shape, field, variation) for field in (cortex, full)
            )
        )
        strains = [sp.lambdify(x, e, "numpy")(nodes) for e in model.strain_rates(shape, variation)]
        v_p = sp.lambdify(x, speed, "numpy")(nodes)
        stresses = principal_active_stresses(meridian(shape, nodes), v_p, ETA_S, ETA_B)
        area = sp.lambdify(x, model.area_density(shape), "numpy")(nodes)
        active = np.sum(weights * area * (stresses[0] * strains[0] + stresses[1] * strains[1]))
        assert two == pytest.approx(one + active, rel=1e-10)
        assert abs(active) > 0.1


def test_sphere_and_cylinder_have_the_printed_active_stress():
    v_p, R0 = 1.7, 2.5
    angle = np.linspace(0.3, 2.8, 5)
    r, z = R0 * np.sin(angle), R0 * np.cos(angle)
    sphere = Meridian(r=r, r_x=z, z_x=-r, r_xx=-r, z_xx=-z)
    expected = -2 * v_p * (ETA_S + ETA_B) / R0
    for stress in principal_active_stresses(sphere, v_p, ETA_S, ETA_B):
        assert stress == pytest.approx(np.full(5, expected))
    cylinder = Meridian(r=R0, r_x=0.0, z_x=-1.0, r_xx=0.0, z_xx=0.0)
    axial, hoop = principal_active_stresses(cylinder, v_p, ETA_S, ETA_B)
    assert hoop == pytest.approx(-v_p * (ETA_B + 2 * ETA_S) / R0)
    assert axial == pytest.approx(-v_p * ETA_B / R0)


def test_poles_and_resting_parameters_are_refused():
    with pytest.raises(InvalidInput, match="r must be > 0"):
        principal_curvatures(Meridian(r=0.0, r_x=1.0, z_x=0.0, r_xx=0.0, z_xx=-1.0))
    with pytest.raises(InvalidInput, match="must not both be 0"):
        principal_curvatures(Meridian(r=1.0, r_x=0.0, z_x=0.0, r_xx=0.0, z_xx=-1.0))
