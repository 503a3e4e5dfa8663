"""Flow, potential, velocities and shape against the force balance and the model."""

import numpy as np
import pytest

from amoeboid.closed_forms.flow import (
    Harmonics,
    flow_potential,
    flow_profile,
    max_retrograde_speed,
    rho_2,
    rho_2_at_high_pressure,
    sphere_velocities,
)
from amoeboid.closed_forms.linear import driving_slope, finite_pressure_matrix
from amoeboid.closed_forms.points import points
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput
from theory.rigid_sphere import rigid_sphere
from theory.sample_points import sample_points

POINTS = sample_points()
THETA = np.linspace(0, np.pi, 41)


def _exact_flow(p, a, b, d):
    system = rigid_sphere(p, 10)
    modes = np.zeros(10)
    modes[:3] = a, b, d
    c = system.concentration(modes)
    slopes = system.flow_slopes(c) @ system.slope
    return system.x, -np.sqrt(1 - system.x**2) * slopes


@pytest.mark.parametrize("p", POINTS[:4], ids=lambda p: str(p.law)[:12])
def test_profile_solves_the_force_balance_to_third_order(p):
    errors = []
    for size in (0.1, 0.05):
        a, b, d = size * p.c0, 0.4 * size**2 * p.c0, 0.3 * size**3 * p.c0
        x, exact = _exact_flow(p, a, b, d)
        found = flow_profile(p, Harmonics(a=a, b=b, d=d), np.arccos(x))
        errors.append(np.abs(found - exact).max())
    # What is left out is of fourth order.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.25)


def test_flow_is_the_surface_gradient_of_its_potential():
    p, c = POINTS[1], Harmonics(a=0.2, b=0.05, d=0.01)
    h = 1e-3
    psi = {k: flow_potential(p, c, THETA + k * h) for k in (-2, -1, 1, 2)}
    slope = (psi[-2] - 8 * psi[-1] + 8 * psi[1] - psi[2]) / (12 * h * p.R0)
    assert flow_profile(p, c, THETA) == pytest.approx(slope, abs=1e-11)


def test_retrograde_flow_goes_from_the_front_to_the_rear():
    # a > 0: the rear, of high concentration, is the pole theta = 0; the flow runs towards it.
    flow = flow_profile(Parameters(), Harmonics(a=0.1), THETA[1:-1])
    assert np.all(flow < 0)


def test_max_speed_is_the_maximum_of_the_profile_and_broadcasts():
    p = Parameters()
    c = Harmonics(a=[0.5, 1.0], b=[0.1, 0.4], d=0.0)
    fine = np.linspace(0, np.pi, 20001)
    found = max_retrograde_speed(p, c)
    for i, (a, b) in enumerate([(0.5, 0.1), (1.0, 0.4)]):
        exact = np.abs(flow_profile(p, Harmonics(a=a, b=b), fine)).max()
        assert found[i] == pytest.approx(exact, rel=1e-7)
    many = points(p, eta_b=np.linspace(0.1, 1, 3)[:, None], v_p0=[3.0, 4.0])
    assert max_retrograde_speed(many, Harmonics(a=0.1)).shape == (3, 2)


def test_velocities_of_figure_2B_cancel_in_the_normal_direction():
    p = Parameters()
    found = sphere_velocities(p, 0.3, THETA)
    assert np.abs(found.v[:, 0]).max() < 1e-15
    assert found.v == pytest.approx(found.v_p + found.v_c)
    assert np.abs(found.v_p[:, 1]).max() == 0
    # Without elastic resistance the cortex moves as a whole: -migration along z everywhere.
    along_z = found.v_c[:, 0] * np.cos(THETA) - found.v_c[:, 1] * np.sin(THETA)
    across = found.v_c[:, 0] * np.sin(THETA) + found.v_c[:, 1] * np.cos(THETA)
    assert along_z == pytest.approx(np.full(41, -float(found.migration)))
    assert np.abs(across).max() < 1e-15
    # The front, of low concentration, is at theta = pi: the cell migrates towards -z.
    assert found.migration < 0


def test_deformation_is_the_rest_of_the_shape_equation():
    for p in POINTS:
        c = Harmonics(a=0.2, b=0.07)
        M21, M22 = finite_pressure_matrix(p, 2)[1]
        f2 = float(p.v_p_derivatives(p.c0, 2)[2])
        # d rho_2/dt = 0, with the quadratic part of v_p beside its linear one.
        source = M21 * 0.07 + f2 * 0.2**2 / (3 * p.R0)
        assert rho_2(p, c) == pytest.approx(-source / M22, rel=1e-12)
        assert pytest.approx(float(driving_slope(p)) / p.R0) == M21


def test_printed_deformation_is_the_limit_of_high_pressure():
    p, c = Parameters(), Harmonics(a=0.5, b=0.1)
    gaps = []
    for pressure in (1e3, 1e4, 1e5):
        at = p.replace(delta_P=pressure)
        gaps.append(abs(rho_2_at_high_pressure(at, c) / rho_2(at, c) - 1))
    assert np.log10(gaps[0] / gaps[1]) == pytest.approx(1, abs=0.02)
    assert np.log10(gaps[1] / gaps[2]) == pytest.approx(1, abs=0.02)


def test_a_shape_that_nothing_holds_is_refused():
    soft = Parameters(delta_P=0.0)
    assert np.isfinite(rho_2(soft, Harmonics(a=0.1)))
    with pytest.raises(InvalidInput, match="nothing holds the shape"):
        rho_2(soft.replace(v_p0=0.0), Harmonics(a=0.1))
    with pytest.raises(InvalidInput, match="delta_P must be > 0"):
        rho_2_at_high_pressure(soft, Harmonics(a=0.1))
