"""Printed equations that are steps of a derivation or plain identities, each shown to hold.

The formulas that the code implements are in `test_paper_formulas`. Names in backquotes are LaTeX
labels. Symbolic where both sides are expressions.
"""

import numpy as np
import pytest
import sympy as sp

from amoeboid.closed_forms.dimensionless import dimensionless
from amoeboid.closed_forms.flow import Harmonics, flow_potential, flow_profile, sphere_velocities
from amoeboid.closed_forms.linear import critical_speed, flow_response, growth_rate
from amoeboid.closed_forms.monomers import ExponentialDecay, monomers
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.closed_forms.thick_cortex import Cortex, cylinder_velocity
from amoeboid.model.parameters import Parameters

EXPONENTIAL = Parameters(
    R0=1.7, c0=1.9, c_r=0.8, D=0.3, beta=0.6, eta_s=1.3, eta_b=0.7, v_p0=2.1, delta_P=1e9
)
INVERSE = EXPONENTIAL.replace(law="inverse")

theta, R, t = sp.symbols("theta R t", positive=True)


def gradient(f):
    """The component along e_theta of the surface gradient on a sphere of radius R."""
    return sp.diff(f, theta) / R


def divergence(u):
    """Surface divergence of u e_theta."""
    return sp.diff(sp.sin(theta) * u, theta) / (R * sp.sin(theta))


def laplacian(f):
    return divergence(gradient(f))


def test_lagrangian_and_eulerian_form_differ_by_the_advection():
    # `cdot` follows a filament, `cdot_advective` stays where it is.
    c, u = sp.Function("c")(theta, t), sp.Function("u")(theta)
    eulerian = sp.diff(c, t) + divergence(u * c)
    following = sp.diff(c, t) + sp.diff(c, theta) * u / R  # a filament moves by dtheta/dt = u/R
    assert sp.simplify(following + divergence(u) * c - eulerian) == 0


def test_advection_by_a_potential_flow_is_a_sum_of_laplacians():
    # `eq_advection_term_flow_potential`
    c, psi = sp.Function("c")(theta), sp.Function("psi")(theta)
    printed = (laplacian(c * psi) + c * laplacian(psi) - psi * laplacian(c)) / 2
    assert sp.simplify(printed - divergence(gradient(psi) * c)) == 0


def test_transport_on_the_sphere_keeps_the_mean_concentration():
    # `eq_coeff_cdot_actin_non_linear_0_inv`: advection and diffusion integrate to 0, and so does
    # the turnover of c with the mean c0.
    x = sp.cos(theta)
    c = 2 + x + sp.Rational(1, 3) * (3 * x**2 - 1)
    psi = x + sp.Rational(2, 5) * (3 * x**2 - 1) + x**3
    change = -divergence(gradient(psi) * c) + laplacian(c) + (2 - c)
    assert sp.integrate(sp.expand(sp.simplify(change * sp.sin(theta))), (theta, 0, sp.pi)) == 0


def test_cortex_velocity_of_second_order_in_vector_harmonics():
    """`eq_v_cortex_coeffs_second_order` without its factor R0, in `eq_vector_spherical_harmonics`.

    The normal part takes up the growth, the tangential one is `eq_full_velocity_comoving`.
    """
    es, eb, v, X = sp.symbols("eta_s eta_b v X", positive=True)
    x, Y = sp.cos(theta), sp.sqrt(5 / (4 * sp.pi)) * (3 * sp.cos(theta) ** 2 - 1) / 2
    common = sp.sqrt(5 * sp.pi) / (75 * (5 * es + 3 * eb)) * v * X
    first, second = 2 * (3 * es + eb) * common, -4 * (4 * es + 3 * eb) * common
    slope = sp.diff(Y, theta)  # R0 grad_s
    tangential = (first + second) * slope
    normal = (-3 * first + 2 * second) * Y
    flow = v * (es + eb) / (5 * es + 3 * eb) * X * x * sp.sin(theta)
    assert sp.simplify(tangential - flow) == 0
    # The P_2 part of v_p of second order, (X x^2 + dc_2)/2 times v: X/3.
    assert sp.simplify(normal + v * X / 3 * (3 * x**2 - 1) / 2) == 0


@pytest.mark.parametrize(("lam", "mu", "h"), [(1.3, 0.7, 0.4), (0.0, 1.0, 0.1), (-0.2, 2.0, 1.1)])
def test_velocity_in_a_thick_cylinder_as_printed(lam, mu, h):
    cortex = Cortex(R0=1.6, h=h, lambda_3d=lam, mu_3d=mu, v_p=0.9)
    r = np.linspace(1.6 - h, 1.6, 7)
    inner = (lam + mu) * (1.6 - h) ** 2  # `eqvR`
    printed = -0.9 * 1.6 * (inner + mu * r**2) / (r * (inner + mu * 1.6**2))
    assert cylinder_velocity(cortex, r) == pytest.approx(printed, rel=1e-13)
    # `eqCauchyEuler`, divided by lambda + 2 mu: r and 1/r are its solutions.
    s, A, B = sp.symbols("s A B")
    u = A * s + B / s
    assert sp.simplify(sp.diff(u, s, 2) + sp.diff(u, s) / s - u / s**2) == 0
    basis = np.stack([r, 1 / r], axis=1)
    _, rest, *_ = np.linalg.lstsq(basis, cylinder_velocity(cortex, r), rcond=None)
    assert rest == pytest.approx(0, abs=1e-25)


def test_first_order_velocities_of_both_laws_as_printed():
    angles, a = np.linspace(0, np.pi, 9), 0.1
    for p in (EXPONENTIAL, INVERSE):
        slope = {
            "exponential": np.exp(-p.c0 / p.c_r) / p.c_r,  # `eq_v0_epsilon`
            "inverse": p.c_r / p.c0**2,  # `eq_vc_inv`
        }[str(p.law)]
        size = p.v_p0 * slope * a
        found = sphere_velocities(p, a, angles)
        axial = np.stack([np.cos(angles), -np.sin(angles)], axis=-1)  # e_z along e_r and e_theta
        assert found.v_c == pytest.approx(size * axial, rel=1e-12, abs=1e-15)
        assert np.sum(found.v * axial, axis=-1) == pytest.approx(size * np.sin(angles) ** 2)
        assert found.migration == pytest.approx(-size, rel=1e-12)


def test_flow_potential_as_printed_up_to_a_constant_and_the_third_harmonic():
    p, a, b = infinite_pressure(EXPONENTIAL), 0.2, 0.05
    c = p.c_r
    A, B, S, G = a / c, b / c, p.eta_s + p.eta_b, 30 * p.eta_b + 50 * p.eta_s
    x, weights = np.polynomial.legendre.leggauss(12)
    bent = -5 / 3 * x * S * (A**2 - 3 * B)
    bent += A * (p.eta_b + 5 / 3 * p.eta_s) * (A**2 - 4 * B + 10)
    printed = 3 * x * p.v_p0 * p.R0 * np.exp(-p.c0 / c) / G * bent
    left = flow_potential(p, Harmonics(a=a, b=b), np.arccos(x)) - printed
    first, second, third = (
        weights @ (left * np.polynomial.legendre.Legendre.basis(l)(x)) for l in (1, 2, 3)
    )
    assert (first, second) == pytest.approx((0, 0), abs=1e-15)
    assert abs(third) > 1e-6
    flow = flow_profile(p, Harmonics(a=a, b=b), np.arccos(x))
    assert np.abs(flow).max() > 1e-2


def test_growth_rate_over_the_distance_from_the_threshold_as_printed():
    p = EXPONENTIAL
    bars, at_threshold = dimensionless(p), dimensionless(p.replace(v_p0=float(critical_speed(p))))
    assert at_threshold.v_p == pytest.approx((2 * bars.D + 1) / (2 * bars.c0))  # `eq_vpoly_crit`
    printed = 2 * bars.c0 * (bars.v_p - at_threshold.v_p)
    assert growth_rate(p, 1) / p.beta == pytest.approx(printed, rel=1e-12)


def test_growth_rates_of_the_inverse_law_as_printed():
    p = INVERSE
    drive, S, G = p.v_p0 * p.c_r / (p.R0 * p.c0), p.eta_s + p.eta_b, 5 * p.eta_s + 3 * p.eta_b
    diffusion = p.D / p.R0**2  # `eq_linear_growth_rate_inv`
    assert growth_rate(p, 1) == pytest.approx(2 * drive - 2 * diffusion - p.beta, rel=1e-12)
    assert growth_rate(p, 2) == pytest.approx(6 * drive * S / G - 6 * diffusion - p.beta, rel=1e-12)
    printed = 2 * p.c_r / (p.R0 * p.c0) * (p.v_p0 - critical_speed(p))
    assert growth_rate(p, 1) == pytest.approx(printed, rel=1e-12)  # first term of the amplitude eq.


def test_drive_of_the_growth_rate_falls_with_the_degree():
    l = np.arange(1, 40)
    for changes in ({}, {"eta_s": 0.1}, {"eta_b": 0.0}):
        response = l * (l + 1) * flow_response(EXPONENTIAL.replace(**changes), l)
        assert np.all(np.diff(response) < 0)


def test_threshold_grows_with_radius_and_turnover():
    p = EXPONENTIAL
    large = critical_speed(points(p, R0=[1e2, 1e3, 1e4]))
    assert large[1:] / large[:-1] == pytest.approx(10, rel=1e-3)  # without bound
    assert np.all(np.diff(critical_speed(points(p, beta=np.linspace(0, 3, 7)))) > 0)


def test_monomers_decay_exponentially_as_printed():
    decay, at = ExponentialDecay(B=1.7, C=0.6, mu_0=2.5), np.linspace(0, 9, 7)
    assert monomers(decay, at) == pytest.approx(2.5 * np.exp(-0.6 * at))  # `eq_cmono_lit2`
