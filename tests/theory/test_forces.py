"""Friction, contractility and bending in the closed forms: derived here from the strong form.

Units R0 = 1 and eta_s + eta_b = 1, as in `free_shape`; y = eta_s. All fields are polynomials in
x = cos(theta), to first order in a perturbation (`linear`), or bilinear in the polarization a and
the shape rho_2 (`bilinear`).
"""

import numpy as np
import pytest
import sympy as sp

import amoeboid as am
from amoeboid.closed_forms.amplitude import cubic_coefficient, normal_form_at_infinite_pressure
from amoeboid.closed_forms.branch import flow_speed_at_threshold, steady_amplitude
from amoeboid.closed_forms.coupling import cubic_equations
from amoeboid.closed_forms.flow import Harmonics, flow_modes, sphere_velocities
from amoeboid.closed_forms.linear import (
    critical_pressure,
    critical_speed,
    finite_pressure_matrix,
    finite_pressure_rates,
    first_mode,
    flow_response,
    growth_rate,
    shape_response,
    stress_slope,
)
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.validation import InvalidInput

x, a, s = sp.symbols("x a s")
SQUARED = 1 - x**2
FRICTION = ("gamma_t", "gamma_n", "gamma_c", "gamma_share")


def random_cells(count=6, seed=3, **fixed):
    rng = np.random.default_rng(seed)
    high = {"delta_P": 20.0, "chi": 0.1, "kappa": 0.3, "D": 0.4, "gamma_share": 0.5}
    names = ("R0", "delta_P", "eta_s", "eta_b", "c0", "c_r", "beta", "D", "v_p0", "chi", "kappa")
    for i in range(count):
        values = {n: rng.uniform(0.3, 1.0) * high.get(n, 2.0) for n in (*names, *FRICTION)}
        law = ("exponential", "inverse")[i % 2]
        yield am.Parameters(**(values | fixed), law=law)


def truncated(element, order):
    terms = sp.Poly(sp.expand(element), a, s).terms()
    return sum(k * a**i * s**j for (i, j), k in terms if (i, j) in order)


class Strong:
    """Tangential and normal force of a cell r = h with c - c0 = `c`, flow q, membrane speed V.

    theta' = -sin(theta) q as in `free_shape`; `U` is the velocity of the cell along the axis.
    """

    def __init__(self, p, h, c, q, V, U, keep):
        def cut(element):
            return truncated(element, keep)

        half = sp.Rational(1, 2)

        def power(element, exponent):
            """element**exponent of what is 1 at a = s = 0; no third power of the rest is kept."""
            rest = cut(element - 1)
            squared = exponent * (exponent - 1) * half * rest**2
            return cut(1 + exponent * rest + squared)

        S = p.eta_s + p.eta_b
        y = p.eta_s / S
        f0, f1 = (float(v) / p.R0 for v in p.v_p_derivatives(p.c0, 1))
        K1, P = float(stress_slope(p)) / p.R0, p.delta_P * p.R0 / S
        gt, gn, gc = (getattr(p, n) * p.R0**2 / S for n in ("gamma_t", "gamma_n", "gamma_c"))
        kappa = p.kappa / (S * p.R0**2)
        h_x = sp.diff(h, x)
        squared = cut(h**2 + SQUARED * h_x**2)
        self.g, over_g, over_h = power(squared, half), power(squared, -half), power(h, -1)
        h_tt = SQUARED * sp.diff(h_x, x) - x * h_x
        k1 = cut((h**2 + 2 * SQUARED * h_x**2 - h * h_tt) * over_g**3)
        k2 = cut((h + x * h_x) * over_h * over_g)
        log_h, log_g = cut(h_x * over_h), cut(sp.diff(squared, x) / 2 * over_g**2)
        w = cut(V - (f0 + f1 * c))
        along = cut(sp.diff(q, x) + q * log_g)
        first_stretch = cut(-x * q + SQUARED * along + k1 * w)
        second_stretch = cut(-x * q + SQUARED * q * log_h + k2 * w)
        over_sine = sp.expand(sp.cancel(cut(k1 - k2) / SQUARED))
        shear = cut(2 * y * (along - q * log_h + over_sine * w))
        first = cut((1 - y) * (first_stretch + second_stretch) - 2 * K1 * c + 2 * y * first_stretch)
        second = cut(first - SQUARED * shear)
        cosine = cut(x - SQUARED * log_h)
        # e_z along the meridian, per -sin(theta), and along the normal
        self.leaning, self.upright = (
            cut((x * h_x + h) * over_g),
            cut((x * h - SQUARED * h_x) * over_g),
        )
        m = 1 + p.gamma_share * c / p.c0
        moving = cut(self.g * q + U * self.leaning)
        self.tangential = cut(-sp.diff(first, x) + cosine * shear + m * (gt + gc) * self.g * moving)
        H = cut(k1 + k2)
        spread = cut(sp.diff(cut(SQUARED * h * over_g * sp.diff(H, x)), x) * over_h * over_g)
        tension = (P + gc * f0) / 2 + 2 * f0
        self.normal = cut(
            P - k1 * (first + tension) - k2 * (second + tension) + kappa * spread
            - m * (gn * (V + U * self.upright) + gc * (w + U * self.upright))
        )  # fmt: skip
        across = -m * (gn * (V + U * self.upright) + gc * (w + U * self.upright))
        along = -m * (gt + gc) * SQUARED * self.leaning * moving
        self.axial = cut((along + self.upright * across) * h * self.g)
        self.cut, self.power, self.over_g = cut, power, over_g


def integral(element):
    return sp.integrate(sp.expand(element), (x, -1, 1))


def mode(element, l):
    return integral(element * sp.legendre(l, x)) * sp.Rational(2 * l + 1, 2)


def slope_mode(element, l):
    return integral(element * SQUARED * sp.diff(sp.legendre(l, x), x)) * sp.Rational(
        2 * l + 1, 2 * l * (l + 1)
    )


FIRST = {(0, 0), (1, 0)}
BILINEAR = {(0, 0), (1, 0), (0, 1), (1, 1)}


@pytest.mark.parametrize("l", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (3, 5))])
def test_linear_dynamics_of_concentration_and_shape_are_derived(l):
    """Force balance of r = 1 + a rho P_l with c = c0 + a c_l P_l and flow and growth of mode l."""
    rho, c, q, growth = sp.symbols("rho c q growth")
    P = sp.legendre(l, x)
    for p in random_cells(2):
        here = Strong(
            p, 1 + a * rho * P, a * c * P, a * q * sp.diff(P, x), a * growth * P, 0, FIRST
        )
        along = slope_mode(here.tangential, l).coeff(a)
        across = mode(here.normal, l).coeff(a)
        found = sp.solve([along, across], [q, growth], dict=True)[0]
        # c' + c0 (div u + 2 growth) = ..., u = -sin q P_l', so div u = -L q
        L, c0 = l * (l + 1), p.c0
        rate = c0 * (L * q - 2 * growth) - (L * p.D / p.R0**2 + p.beta) * c
        derived = [[sp.expand(e.subs(found)).coeff(n) for n in (c, rho)] for e in (rate, growth)]
        assert finite_pressure_matrix(p, l) == pytest.approx(np.array(derived, float), rel=1e-9)


def test_growth_of_a_polarization_is_derived_with_the_velocity_of_the_cell():
    q, U = sp.symbols("q U")
    for p in random_cells(2):
        here = Strong(p, sp.Integer(1) + 0 * a, a * x, a * q, sp.Integer(0) * a, a * U, FIRST)
        along = slope_mode(here.tangential, 1).coeff(a)
        force = sp.expand(integral(here.axial)).coeff(a)
        found = sp.solve([along, force], [q, U], dict=True)[0]
        rate = 2 * p.c0 * found[q] - 2 * p.D / p.R0**2 - p.beta
        assert growth_rate(p, 1) == pytest.approx(float(rate), rel=1e-10)
        assert mode(here.normal, 1).coeff(a).subs(found) == pytest.approx(0, abs=1e-10)


@pytest.mark.slow
def test_third_order_is_derived_on_the_deformed_sphere_with_friction():
    """A1r, Br and kappa_2: flow of a polarization a on the shape 1 + s P_2, bilinear in a and s."""
    q = sp.symbols("q0:4")
    U = sp.symbols("U0:2")
    P = [sp.legendre(k, x) for k in range(4)]
    for p in random_cells(2, gamma_c=0.0, gamma_share=0.0):
        flow = a * q[0] * sp.diff(P[1], x) + s * q[1] * sp.diff(P[2], x)
        flow += a * s * (q[2] * sp.diff(P[1], x) + q[3] * sp.diff(P[3], x))
        here = Strong(
            p, 1 + s * P[2], a * x, flow, sp.Integer(0) * a, a * U[0] + a * s * U[1], BILINEAR
        )
        force = sp.expand(integral(here.axial))
        modes = [sp.expand(slope_mode(here.tangential, k)) for k in (1, 2)]
        first = [modes[0].coeff(a).coeff(s, 0), force.coeff(a).coeff(s, 0)]
        found = sp.solve([*first, modes[1].coeff(s).coeff(a, 0)], [q[0], U[0], q[1]], dict=True)[0]
        both = [modes[0].coeff(a).coeff(s), force.coeff(a).coeff(s)]
        found |= sp.solve([e.subs(found) for e in both], [q[2], U[1]], dict=True)[0]
        area = here.cut((1 + s * P[2]) * here.g)
        test = SQUARED * area * (p.c0 + a * x) * flow
        spread = SQUARED * -p.D / p.R0**2 * a * (1 + s * P[2]) * here.over_g
        rate = integral(here.cut(test + spread - p.beta * a * x**2 * area)) * sp.Rational(3, 2)
        mass = integral(x**2 * area) * sp.Rational(3, 2)
        rate = here.cut(rate * here.power(mass, -1))
        e = cubic_equations(p)
        assert float(rate.coeff(a).coeff(s).subs(found).subs(q[3], 0)) == pytest.approx(
            float(e.A1r), rel=1e-9
        )
        assert 6 * p.c0 * float(found[q[1]]) == pytest.approx(float(e.Br), rel=1e-9)


def test_shape_at_rest_follows_the_linear_dynamics():
    for p in random_cells(gamma_c=0.0, gamma_share=0.0):
        for l in (2, 3, 5):
            M = finite_pressure_matrix(p, l)
            w1 = float(am.Parameters.v_p_derivatives(p, p.c0, 1)[1] + stress_slope(p))
            at_rest = float(-M[1, 0] / M[1, 1])
            assert shape_response(p, l) * w1 == pytest.approx(at_rest, rel=1e-11)


def test_slow_motion_of_a_rigid_cell_with_friction_is_that_of_the_galerkin_flow():
    """a^3, a b and a^2 of b' for G_1 < 1, from the products of Legendre polynomials."""
    p = am.Parameters(D=0.3, v_p0=5.0, gamma_t=1.1, gamma_n=0.6, gamma_c=0.4, chi=0.1)
    e = cubic_equations(infinite_pressure(p))
    G2 = float(flow_response(p, 2))
    S, along = p.eta_s + p.eta_b, p.gamma_t + p.gamma_c
    across = p.gamma_n + p.gamma_c
    effective = along * across / (2 * along + across)
    G1 = 1 / (1 + effective / (2 * S))
    push = p.gamma_c * along / (2 * S * (2 * along + across))
    f = [float(v) for v in p.v_p_derivatives(p.c0, 3)]
    w = [f[0], f[1] - p.chi / (2 * S), *f[2:]]
    d = [G1 * (u + push * v) for u, v in zip(w, f, strict=True)]
    assert e.lambda_1 == pytest.approx(-2 * p.c0 * d[1] - 2 * p.D - p.beta, rel=1e-12)
    assert pytest.approx(-(p.c0 * d[3] + 2 * G2 * w[2]) / 5, rel=1e-12) == e.A3
    assert pytest.approx(2 * (d[1] - 3 * G2 * w[1] - 2 * p.c0 * d[2]) / 5, rel=1e-12) == e.A11
    assert pytest.approx(-2 * (d[1] + p.c0 * G2 * w[2]), rel=1e-12) == e.B2


@pytest.mark.parametrize(
    ("friction", "threshold"),
    [
        ({"gamma_t": 1.0, "gamma_n": 1.0}, 6.527800),
        ({"gamma_t": 1.0}, 6.025661),
        ({"gamma_c": 1.0}, 6.025661),
        ({"gamma_t": 3.0, "gamma_n": 3.0}, 7.532076),
    ],
)
def test_threshold_rises_with_drag_along_and_across_the_surface_alone(friction, threshold):
    """Isotropic: 1 + gamma R0^2/(6 S) times; none for drag along the surface or on the cortex."""
    p = am.Parameters(D=0.4, **friction)
    assert critical_speed(p) == pytest.approx(threshold, abs=6e-7)
    if "gamma_n" in friction:
        free = critical_speed(am.Parameters(D=0.4))
        assert critical_speed(p) / free == pytest.approx(1 + p.gamma_n / 12, rel=1e-14)


def test_a_cell_that_is_held_becomes_bipolar_where_it_sticks_to_what_holds_it():
    """gamma_n -> infinity: l = 2 leads from gamma_t = 3.08 on, at infinite pressure."""
    for gamma, leads in ((3.07, False), (3.09, True)):
        held = am.Parameters(D=0.03, gamma_t=gamma, gamma_n=1e9, delta_P=1e6)
        assert (first_mode(held).l == 2) == leads
        first, second = (float(critical_speed(held, l)) for l in (1, 2))
        assert (second < first) == leads
    with pytest.raises(InvalidInput, match="mode 2 goes unstable first at every pressure"):
        critical_pressure(held)


def test_mode_2_is_neutral_at_the_critical_pressure_and_the_threshold():
    found = 0
    for p in random_cells(20, kappa=0.001, gamma_share=0.3):
        star = float(critical_pressure(p))
        at = p.replace(v_p0=float(critical_speed(p)), delta_P=star)
        if star > 0:
            slow, fast = finite_pressure_rates(at, 2)
            assert abs(slow) < 1e-12 * abs(fast)
            found += 1
    assert found > 5


def test_bending_keeps_mode_1_first_without_pressure():
    """From kappa = delta_P* R0^3/12 on."""
    for free in random_cells(4, kappa=0.0, gamma_c=0.0, gamma_t=0.0, gamma_n=0.0):
        kappa = float(critical_pressure(free)) * free.R0**3 / 12
        stiff = free.replace(delta_P=0.0, kappa=kappa * (1 + 1e-6))
        soft = free.replace(delta_P=0.0, kappa=kappa * (1 - 1e-6))
        assert (first_mode(stiff).l, first_mode(soft).l) == (1, 2)
        assert critical_pressure(stiff) == 0.0 < critical_pressure(soft)


def test_what_the_theory_does_not_know_of_friction_is_refused_with_the_reason():
    base = am.Parameters(D=0.4, v_p0=6.5)
    grips = base.replace(gamma_t=1.0, gamma_share=0.5)
    pushes = base.replace(gamma_c=1.0)
    with pytest.raises(InvalidInput, match="needs uniform friction, got gamma_share > 0"):
        cubic_coefficient(grips)
    with pytest.raises(InvalidInput, match="at finite delta_P needs gamma_c = 0"):
        cubic_coefficient(pushes)
    assert np.isfinite(cubic_coefficient(infinite_pressure(pushes)))
    for call in (
        lambda p: normal_form_at_infinite_pressure(p),
        lambda p: am.prediction(p),
        lambda p: flow_modes(p, Harmonics(a=0.1)),
        lambda p: sphere_velocities(p, 0.1, 1.0),
    ):
        for name in ("gamma_t", "gamma_n", "kappa"):
            with pytest.raises(
                InvalidInput, match=rf"only without friction and bending, got {name}"
            ):
                call(base.replace(**{name: 0.5}))


def test_theory_with_friction_says_what_it_knows_and_what_not():
    found = am.theory(am.Parameters(D=0.03, v_p0=3.56, gamma_t=0.5, kappa=0.1))
    assert found.nu < 0
    assert found.amplitude > 0
    assert found.max_retrograde_speed_cubic > 0
    assert found.relative_error is None
    assert found.max_retrograde_speed is None
    assert any("no error estimate: the theory beyond third order" in n for n in found.notes)
    grips = am.theory(am.Parameters(gamma_t=0.5, gamma_share=1.0))
    assert (grips.nu, grips.threshold) == (None, pytest.approx(3.548445, abs=1e-6))


def test_retrograde_flow_at_the_threshold_is_what_carries_the_filaments():
    """u c0 2/R0 = (2 D/R0^2 + beta) a in every surroundings."""
    for p in random_cells(4, gamma_c=0.0, gamma_share=0.0):
        speed = flow_speed_at_threshold(p, 0.2)
        assert speed == pytest.approx((p.D / p.R0 + p.beta * p.R0 / 2) * 0.2 / p.c0, rel=1e-12)


def test_amplitude_broadcasts_over_friction():
    p = points(am.Parameters(D=0.03, v_p0=3.6), gamma_t=[0.0, 0.5], kappa=[[0.0], [0.2]])
    assert steady_amplitude(p).amplitude.shape == (2, 2)


def test_a_cue_polarizes_with_friction_where_the_force_balance_says():
    """Response at first order by the growth rate: a' = lambda_1 a + what e v_p(c) drives."""
    e = 1e-6
    for p in random_cells(4, v_p0=0.1, chi=0.0):
        # v_p (1 + e x) is what v_p(c0 + e f_0/f_1 x) is, as far as flow is concerned
        f0, f1 = (float(v) for v in p.v_p_derivatives(p.c0, 1))
        rate = float(growth_rate(p.replace(gamma_share=0.0), 1))
        drive = rate + 2 * p.D / p.R0**2 + p.beta
        uniform = p.replace(gamma_share=0.0)
        expected = -drive * e * f0 / f1 / rate
        assert am.polarization_by_cue(uniform, e) == pytest.approx(expected, rel=1e-10)
