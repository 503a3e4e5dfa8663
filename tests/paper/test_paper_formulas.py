"""The paper's formulas as they are printed, against the code; errata where they differ.

The right-hand sides are copied from print on purpose: this file is the record of what the paper
says. That the code is right is shown in tests/theory, by derivation.
"""

from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.branch import flow_speed_at_threshold, steady_amplitude
from amoeboid.closed_forms.coupling import cubic_equations
from amoeboid.closed_forms.dimensionless import dimensionless_cubic_coefficient
from amoeboid.closed_forms.flow import (
    Harmonics,
    flow_profile,
    rho_2_at_high_pressure,
    sphere_velocities,
)
from amoeboid.closed_forms.linear import base_tension, critical_speed, growth_rate
from amoeboid.closed_forms.phase_boundary import phase_boundary
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.model.parameters import Parameters

ERRATA = (Path(__file__).parents[2] / "docs" / "errata.md").read_text(encoding="utf-8")
RNG = np.random.default_rng(11)
NAMES = ("R0", "eta_s", "eta_b", "c0", "c_r", "beta", "D", "v_p0", "alpha")
POINTS = [
    Parameters(**dict(zip(NAMES, RNG.uniform(0.4, 2.0, len(NAMES)), strict=True)), delta_P=1e3)
    for _ in range(8)
]


def exponential():
    return [p.replace(alpha=0.0) for p in POINTS]


def inverse():
    return [p.replace(alpha=0.0, law="inverse") for p in POINTS]


def test_thresholds_of_both_laws():
    for p in exponential():  # `vpc`, `polycrit_1`
        printed = p.c_r / p.c0 * (p.D / p.R0 + p.beta * p.R0 / 2) * np.exp(p.c0 / p.c_r)
        assert critical_speed(p) == pytest.approx(printed, rel=1e-13)
    for p in inverse():  # `vpc_inv`
        printed = p.c0 / p.c_r * (p.D / p.R0 + p.beta * p.R0 / 2)
        assert critical_speed(p) == pytest.approx(printed, rel=1e-13)


def test_threshold_with_elastic_resistance_lacks_a_factor_in_print():
    assert "## The threshold with elastic resistance\n" in ERRATA
    for p in POINTS:
        front = p.c_r / p.c0 * np.exp(p.c0 / p.c_r)
        elastic = p.alpha * p.c0 * p.R0 / (p.eta_s + p.eta_b)
        rest = p.D / p.R0 + p.beta * p.R0 / 2
        assert critical_speed(p) == pytest.approx(front * (rest + elastic / 2), rel=1e-13)
        # As printed in `eq_vpc_compress`; there the printed `lambdal_compress` does not vanish.
        printed = front * (rest + elastic)
        assert growth_rate(p.replace(v_p0=float(printed)), 1) > 1e-3


@pytest.mark.parametrize("l", [1, 2, 3, 7])
def test_growth_rates(l):
    for p in POINTS:  # `lambda1`, `lambdal`, `lambdal_compress`
        L = l * (l + 1)
        drive = 2 * L * (p.eta_s + p.eta_b) / ((2 * p.eta_s + p.eta_b) * L - 2 * p.eta_s)
        drive *= p.v_p0 * p.c0 / (p.R0 * p.c_r) * np.exp(-p.c0 / p.c_r)
        elastic = L / 2 / ((l**2 + l - 1) * p.eta_s + L / 2 * p.eta_b) * p.alpha * p.c0
        printed = drive - L * p.D / p.R0**2 - p.beta - elastic
        assert growth_rate(p, l) == pytest.approx(printed, rel=1e-11)


def test_nu_of_the_exponential_law():
    for p in exponential():  # `eq_non_linear_coefficient`
        D, c, eta = p.D / (p.R0**2 * p.beta), p.c0 / p.c_r, p.eta_s / p.eta_b
        square = ((1.5 + 8 * D) * eta + (5 * D + 1)) * c**2
        linear = ((5 + 12 * D) * eta + (3 + 8 * D)) * c
        printed = (2 * D + 1) * (square - linear - (1 + 2 * D) * eta)
        printed /= 5 * c**2 * ((1 + 12 * D) * eta + 6 * D)
        found = dimensionless_cubic_coefficient(infinite_pressure(p))
        assert found == pytest.approx(printed, rel=1e-10)


def test_nu_and_amplitude_equations_of_the_inverse_law():
    for p in inverse():
        R0, c0, D, es, eb = p.R0, p.c0, p.D, p.eta_s, p.eta_b
        turn = p.beta * R0**2
        printed = 2 * (2 * D + turn) * (D * (9 * es + 5 * eb) - turn * (2 * es + eb))
        printed /= 5 * R0**2 * c0**2 * (6 * D * (2 * es + eb) + turn * es)
        assert cubic_coefficient(infinite_pressure(p)) == pytest.approx(printed, rel=1e-11)
        e, v, G = cubic_equations(p), p.v_p0 * p.c_r, 5 * es + 3 * eb  # `eq_nonlinear_inv`
        alpha_1 = 2 * v * (13 * es + 7 * eb) / (5 * R0 * c0**3 * G)
        beta_1 = -4 * v * (11 * es + 6 * eb) / (5 * R0 * c0**2 * G)
        alpha_2 = 2 * v * (3 * es + eb) / (R0 * c0**2 * G)
        assert pytest.approx((alpha_1, beta_1), rel=1e-11) == (e.A3, e.A11)
        assert pytest.approx(alpha_2, rel=1e-11) == e.B2


def test_amplitude_equations_of_the_exponential_law():
    for p in exponential():
        c, S, G = p.c0 / p.c_r, p.eta_s + p.eta_b, 3 * p.eta_b + 5 * p.eta_s
        v = p.v_p0 * np.exp(-c) / (p.R0 * p.beta)
        e = cubic_equations(p)
        scale = p.beta / p.c_r
        a3 = v / (5 * G) * (-2 * S + c * G)
        a11 = -4 * v / (5 * G) * (p.eta_s + c * G)
        b2 = -2 * v / G * (S * c - 3 * p.eta_b - 5 * p.eta_s)
        assert pytest.approx(a3 * scale / p.c_r, rel=1e-11) == e.A3
        assert pytest.approx(a11 * scale, rel=1e-11) == e.A11
        assert pytest.approx(b2 * scale, rel=1e-11) == e.B2


def test_flow_and_deformation_of_second_order():
    theta, a, b = np.linspace(0, np.pi, 15), 1e-4, 0.6e-8
    for p in exponential():  # `eq_full_velocity_comoving`, `eq_rho_2`
        w, S, G = p.v_p0 * np.exp(-p.c0 / p.c_r), p.eta_s + p.eta_b, 5 * p.eta_s + 3 * p.eta_b
        bent = (a / p.c_r) ** 2 - 3 * b / p.c_r
        printed = -w * a / p.c_r * np.sin(theta) + w * S / G * bent * np.cos(theta) * np.sin(theta)
        assert flow_profile(p, Harmonics(a=a, b=b), theta) == pytest.approx(printed, abs=1e-11)
        rho = 4 * w * p.eta_s * S * bent / (3 * p.delta_P * p.R0**2 * G)
        assert rho_2_at_high_pressure(p, Harmonics(a=a, b=b)) == pytest.approx(rho, rel=1e-6)
    for p in inverse():  # `eq_rho_2_inverse`
        S, G = p.eta_s + p.eta_b, 5 * p.eta_s + 3 * p.eta_b
        bent = 2 * (a / p.c0) ** 2 - 3 * b / p.c0
        rho = 4 * p.v_p0 * p.c_r * p.eta_s * S * bent / (3 * p.c0 * p.delta_P * p.R0**2 * G)
        assert rho_2_at_high_pressure(p, Harmonics(a=a, b=b)) == pytest.approx(rho, rel=1e-6)


def test_velocities_of_first_order():
    theta = np.linspace(0, np.pi, 9)
    for p in exponential():  # `deltavp`, `infinitan`
        v_hat = p.v_p0 * np.exp(-p.c0 / p.c_r) * 0.1 / p.c_r
        found = sphere_velocities(p, 0.1, theta)
        assert found.v_p[:, 0] == pytest.approx(-v_hat * np.cos(theta), rel=1e-12)
        assert found.v[:, 1] == pytest.approx(-v_hat * np.sin(theta), rel=1e-12)


def test_migration_speed_of_the_inverse_law():
    for p in inverse():  # `eq_vMig_inv`
        rigid = infinite_pressure(p)
        nu, v_c = float(cubic_coefficient(rigid)), float(critical_speed(p))
        at = rigid.at_speed(v_c * (0.99 if nu > 0 else 1.01))
        root = 2 * p.c_r * (at.v_p0 - v_c) / (-p.R0 * p.c0 * nu)
        printed = v_c * p.c_r / p.c0**2 * np.sqrt(root)
        found = flow_speed_at_threshold(at, steady_amplitude(at).amplitude)
        assert found == pytest.approx(printed, rel=1e-9)


def test_boundary_of_figure_3C_in_closed_form():
    # nu = 0 of the printed nu solved for D, in the bars.
    D, c, eta = sp.symbols("D c eta")
    printed = (
        ((sp.Rational(3, 2) + 8 * D) * eta + 5 * D + 1) * c**2
        - ((5 + 12 * D) * eta + 3 + 8 * D) * c
        - (1 + 2 * D) * eta
    )
    (solution,) = sp.solve(printed, D)
    curve = phase_boundary(infinite_pressure(Parameters(eta_b=0.7)), np.linspace(2.0, 4.0, 9))
    expected = [float(solution.subs({c: x, eta: 1 / 0.7})) for x in curve.c0]
    assert pytest.approx(expected, rel=1e-9) == curve.D
    flat = phase_boundary(infinite_pressure(Parameters(law="inverse", eta_b=0.7)), [1.0, 3.0])
    eta = 1 / 0.7
    assert pytest.approx(np.full(2, (2 * eta + 1) / (9 * eta + 5)), rel=1e-9) == flat.D


def test_expansion_of_the_inverse_law_in_print_is_that_of_the_exponential_one():
    assert "## The expansion of the inverse law\n" in ERRATA
    e, A, B, x = sp.symbols("e A B x")
    second = e**2 / 2 * (B + x**2 * (A**2 - 3 * B))
    printed = 1 - e * A * x + second - e**3 / 6 * A * x * ((A**2 - 9 * B) * x**2 + 3 * B)
    delta = e * A * x + e**2 * B * (3 * x**2 - 1) / 2

    def expanded(law):
        return sp.expand(sp.series(law, e, 0, 4).removeO())

    assert sp.expand(printed - expanded(sp.exp(-delta))) == 0
    corrected = (
        1 - e * A * x + e**2 / 2 * (B + x**2 * (2 * A**2 - 3 * B))
        - e**3 * A * x * ((A**2 - 3 * B) * x**2 + B)
    )  # fmt: skip
    assert sp.expand(corrected - expanded(1 / (1 + delta))) == 0


def test_energy_in_print_has_another_resting_tension():
    assert "## The energy\n" in ERRATA
    # dE/dR = 0 on the sphere without treadmilling, E = zeta A + delta_P oint r.n as printed.
    R, zeta, P = sp.symbols("R zeta P")
    area, r_n = 4 * sp.pi * R**2, 4 * sp.pi * R**3
    (printed,) = sp.solve(sp.diff(zeta * area + P * r_n, R), zeta)
    assert printed == -3 * P * R / 2
    (correct,) = sp.solve(sp.diff(zeta * area - P * r_n / 3, R), zeta)
    p = Parameters(R0=1.3, delta_P=7.0, v_p0=0.0)
    assert base_tension(p) == pytest.approx(float(correct.subs({R: 1.3, P: 7.0})), rel=1e-13)
