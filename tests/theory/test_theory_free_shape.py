"""Theory at the pressure of the cell: derived on the deformed sphere, and its two limits."""

import numpy as np
import pytest

from amoeboid.closed_forms.amplitude import (
    at_threshold,
    bifurcation,
    cubic_coefficient,
    eliminated,
    normal_form_at_infinite_pressure,
    second_harmonic,
)
from amoeboid.closed_forms.branch import branch, harmonics, prediction
from amoeboid.closed_forms.coupling import SHAPE_SQUARED, cubic_equations, fifth_order
from amoeboid.closed_forms.flow import Harmonics, flow_modes, flow_potential, flow_profile, rho_2
from amoeboid.closed_forms.linear import (
    critical_pressure,
    critical_speed,
    driving_slope,
    finite_pressure_matrix,
    finite_pressure_rates,
    flow_response,
    growth_rate,
    shape_response,
    slowest_rate,
    stress_derivatives,
)
from amoeboid.closed_forms.phase_boundary import phase_boundary
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput
from theory import free_shape
from theory.sample_points import LAWS, sample_points

# every derivative of the stress is a number of its own in two of three points
STRESSES = ({}, {"stress": "chi*c/(1 + (c/k)**2)", "stress.k": 1.3, "stress.chi": 0.08},
            {"stress": "chi*c_r*(exp(-c/k) - 1)", "stress.k": 0.9, "stress.chi": 0.1})  # fmt: skip
POINTS = [p.replace(**STRESSES[i % 3]) for i, p in enumerate(sample_points())]
# Which rate each coefficient belongs to, and the powers of a, b, d, rho_2, rho_3.
RATES = {
    "lambda_1": (1, (1, 0, 0, 0, 0)), "A3": (1, (3, 0, 0, 0, 0)), "A11": (1, (1, 1, 0, 0, 0)),
    "A1r": (1, (1, 0, 0, 1, 0)), "A5": (1, (5, 0, 0, 0, 0)), "A31": (1, (3, 1, 0, 0, 0)),
    "A12": (1, (1, 2, 0, 0, 0)), "A201": (1, (2, 0, 1, 0, 0)), "A011": (1, (0, 1, 1, 0, 0)),
    "A3r": (1, (3, 0, 0, 1, 0)), "A11r": (1, (1, 1, 0, 1, 0)), "A1rr": (1, (1, 0, 0, 2, 0)),
    "A2s": (1, (2, 0, 0, 0, 1)), "A01s": (1, (0, 1, 0, 0, 1)), "A001r": (1, (0, 0, 1, 1, 0)),
    "Ars": (1, (0, 0, 0, 1, 1)),
    "lambda_2": (2, (0, 1, 0, 0, 0)), "Br": (2, (0, 0, 0, 1, 0)), "B2": (2, (2, 0, 0, 0, 0)),
    "B4": (2, (4, 0, 0, 0, 0)), "B21": (2, (2, 1, 0, 0, 0)), "B02": (2, (0, 2, 0, 0, 0)),
    "B101": (2, (1, 0, 1, 0, 0)), "B2r": (2, (2, 0, 0, 1, 0)), "B01r": (2, (0, 1, 0, 1, 0)),
    "Brr": (2, (0, 0, 0, 2, 0)), "B1s": (2, (1, 0, 0, 0, 1)),
    "lambda_3": (3, (0, 0, 1, 0, 0)), "Ds": (3, (0, 0, 0, 0, 1)), "D3": (3, (3, 0, 0, 0, 0)),
    "D11": (3, (1, 1, 0, 0, 0)), "D1r": (3, (1, 0, 0, 1, 0)),
}  # fmt: skip
# The same for what drives the shape.
DRIVES = {
    "w_1": (2, (0, 1, 0, 0, 0)), "Q2": (2, (2, 0, 0, 0, 0)), "Q4": (2, (4, 0, 0, 0, 0)),
    "Q21": (2, (2, 1, 0, 0, 0)), "Q02": (2, (0, 2, 0, 0, 0)), "Q101": (2, (1, 0, 1, 0, 0)),
    "Q2r": (2, (2, 0, 0, 1, 0)), "Q01r": (2, (0, 1, 0, 1, 0)), "Q1s": (2, (1, 0, 0, 0, 1)),
    "S3": (3, (3, 0, 0, 0, 0)), "S11": (3, (1, 1, 0, 0, 0)), "S1r": (3, (1, 0, 0, 1, 0)),
}  # fmt: skip
BY_SHAPE = {2: (0, 0, 0, 1, 0), 3: (0, 0, 0, 0, 1)}
SQUARED, THIRD = (0, 0, 0, 2, 0), (0, 0, 1, 0, 0)
ORDERS = {1: (1, 3, 5), 2: (2, 4), 3: (3,)}


@pytest.fixture(scope="module")
def steady():
    return free_shape.Steady()


def _terms(series, l):
    """{powers: function of the numbers} of a series, to the order that is needed of mode l."""
    return {
        powers: free_shape.function(coefficient)
        for order in ORDERS[l]
        for powers, coefficient in free_shape.coefficients(series[order]).items()
    }


@pytest.fixture(scope="module")
def rates(steady):
    return {l: _terms(steady.transport(l), l) for l in (1, 2, 3)}


@pytest.fixture(scope="module")
def forces(steady):
    return {l: _terms(steady.normal_force(l), l) for l in (2, 3)}


def numbers(p):
    """The values of the variables of the ring, in units of R0 and of eta_s + eta_b."""
    S = p.eta_s + p.eta_b
    scaled = {f"f{k}": float(v) / p.R0 for k, v in enumerate(p.v_p_derivatives(p.c0, 5))}
    return scaled | {
        "c0": p.c0, "D": p.D / p.R0**2, "beta": p.beta, "y": p.eta_s / S, "P": p.delta_P * p.R0 / S,
        **{f"K{k}": float(v) / p.R0 for k, v in enumerate(stress_derivatives(points(p), 5)) if k},
        "G2": float(flow_response(p, 2)), "G3": float(flow_response(p, 3)),
    }  # fmt: skip


def _coded(p, name):
    equations = cubic_equations(p)
    return float(getattr(equations if hasattr(equations, name) else fifth_order(p), name))


@pytest.mark.parametrize("name", RATES)
def test_rates_of_the_harmonics_are_derived_on_the_deformed_sphere(rates, name):
    l, powers = RATES[name]
    for p in POINTS:
        derived = rates[l][powers](numbers(p))
        assert _coded(p, name) == pytest.approx(derived, rel=1e-11, abs=1e-13)


def _pull(p, l):
    """What the normal force of mode l is per driving speed, in units of 1/R0."""
    L = l * (l + 1)
    return 4 - 2 * L * float(flow_response(p, l))


@pytest.mark.parametrize("name", DRIVES)
def test_drives_of_the_shape_are_derived_from_the_normal_force(forces, name):
    l, powers = DRIVES[name]
    for p in POINTS:
        derived = forces[l][powers](numbers(p)) / _pull(p, l)
        assert _coded(p, name) / p.R0 == pytest.approx(derived, rel=1e-11)


def test_response_of_the_shape_is_derived_from_the_normal_force(forces):
    for p in POINTS:
        for l, powers in BY_SHAPE.items():
            derived = -_pull(p, l) / forces[l][powers](numbers(p))
            assert shape_response(p, l) * p.R0 == pytest.approx(derived, rel=1e-11)
        squared = forces[2][SQUARED](numbers(p)) / _pull(p, 2)
        kappa_2 = float(shape_response(p, 2)) * p.R0
        coded = _coded(p, "Qrr") / p.R0 + SHAPE_SQUARED / kappa_2
        assert coded == pytest.approx(squared, rel=1e-11)
        third = forces[3][THIRD](numbers(p)) / _pull(p, 3)
        assert driving_slope(p) / p.R0 == pytest.approx(third, rel=1e-11)


def test_no_term_of_the_equations_is_left_out(rates, forces):
    named = set(RATES.values())
    assert {(l, powers) for l, terms in rates.items() for powers in terms} == named
    named = {*DRIVES.values(), *BY_SHAPE.items(), (2, SQUARED), (3, THIRD)}
    assert {(l, powers) for l, terms in forces.items() for powers in terms} == named


def test_the_axial_force_vanishes_and_the_tension_balances_mode_0(steady):
    # The residuals of modes 2 and 3 would enter mode 1 at fifth order, multiplied.
    assert not any(steady.normal_force(1)[:5])
    assert not any(steady.normal_force(0)[:3])


def test_flow_on_the_deformed_sphere_is_derived_from_the_force_balance(steady):
    speed = [free_shape.function(k) for k in steady.flow_speed()[:4]]
    theta = np.linspace(0.1, 3, 7)
    for p in POINTS[:6]:
        c = Harmonics(a=0.2, b=0.07, d=-0.03, rho_2=0.11, rho_3=0.05)
        values = numbers(p) | {
            "a": c.a, "b": c.b, "d": c.d, "rho": c.rho_2, "sigma": c.rho_3,
        }  # fmt: skip
        derived = [
            p.R0 * np.sin(t) * sum(k(values | {"x": np.cos(t)}) for k in speed) for t in theta
        ]
        assert flow_profile(p, c, theta) == pytest.approx(derived, rel=1e-11)
        assert flow_modes(p, c).shape == (3,)


def test_flow_on_the_deformed_sphere_is_the_surface_gradient_of_its_potential():
    p, h = POINTS[1], 1e-4
    theta = np.linspace(0.2, 3, 9)
    errors = []
    for size in (0.1, 0.05):
        c = Harmonics(a=size, b=0.4 * size**2, d=0.3 * size**3, rho_2=size**2, rho_3=size**3)
        ahead, behind = (flow_potential(p, c, theta + k * h) for k in (1, -1))
        x, s = np.cos(theta), np.sin(theta)
        r = 1 + c.rho_2 * (3 * x**2 - 1) / 2 + c.rho_3 * (5 * x**3 - 3 * x) / 2
        r_theta = -s * (3 * c.rho_2 * x + c.rho_3 * (15 * x**2 - 3) / 2)
        gradient = (ahead - behind) / (2 * h) / (p.R0 * np.hypot(r, r_theta))
        errors.append(np.abs(gradient - flow_profile(p, c, theta)).max())
    # Flow and potential are of third order: they differ at the fourth.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.3)


@pytest.mark.parametrize("l", [2, 3, 5])
def test_shape_response_is_the_rest_of_the_linear_shape_equation(l):
    for p in POINTS:
        M = finite_pressure_matrix(p, l)
        at_rest = -M[1, 0] / M[1, 1]
        assert shape_response(p, l) * driving_slope(p) == pytest.approx(float(at_rest), rel=1e-12)


def test_the_second_harmonic_is_neutral_where_linear_theory_says_so():
    for p in POINTS:
        M = finite_pressure_matrix(p, 2)
        expected = float(np.linalg.det(M) / M[1, 1])
        assert second_harmonic(p).rate_at_rest == pytest.approx(expected, rel=1e-9)
        star = p.replace(delta_P=float(critical_pressure(p)), v_p0=float(critical_speed(p)))
        assert abs(second_harmonic(star).rate_at_rest) < 1e-10 * abs(growth_rate(star, 2))


def test_deformation_is_that_of_the_eliminated_second_harmonic():
    for p in POINTS:
        at = p.replace(v_p0=float(critical_speed(p)))
        c = harmonics(at, 0.1)
        assert rho_2(at, c) == pytest.approx(float(c.rho_2), rel=1e-12)


def test_infinite_pressure_is_the_limit_of_high_pressure():
    for p in POINTS[:3]:
        rigid = infinite_pressure(p)
        gaps = []
        for pressure in (1e4, 1e5):
            at = p.replace(delta_P=pressure)
            gaps.append(
                [
                    abs(cubic_coefficient(at) / cubic_coefficient(rigid) - 1),
                    abs(branch(at).v_4 / branch(rigid).v_4 - 1),
                ]
            )
        # First order in 1/delta_P.
        assert np.log10(np.divide(*gaps)) == pytest.approx(1, abs=0.05)
        form = at_threshold(rigid)
        assert form.r_2 == form.r_3 == form.r_4 == 0
        assert normal_form_at_infinite_pressure(p).nu == form.nu


def test_points_of_finite_and_infinite_pressure_broadcast_together():
    p = points(Parameters()).at_pressure(np.array([5.0, 300.0, np.inf]))
    nu = cubic_coefficient(p)
    assert nu[0] > 0 > nu[1] > nu[2]
    assert bifurcation(p).tolist() == ["subcritical", "supercritical", "supercritical"]
    assert prediction(p).state.exists.tolist() == [False, True, True]
    assert slowest_rate(p, 2)[2] == growth_rate(p, 2)
    assert slowest_rate(p, [2, 1, 2])[1] == growth_rate(p, 1)
    soft = Parameters(delta_P=5.0)
    assert slowest_rate(p, 2)[0] == pytest.approx(finite_pressure_rates(soft, 2)[0].real)


def test_soft_cells_are_subcritical_where_rigid_ones_are_not():
    """The cell of D = 0.03 at delta_P = 5: nu = +0.0026, and -0.0130 for delta_P -> infinity."""
    p = Parameters(delta_P=5.0, D=0.03, v_p0=3.56)
    assert cubic_coefficient(p) == pytest.approx(0.002614341934723732, rel=1e-12)
    assert bifurcation(p) == "subcritical"
    assert bifurcation(infinite_pressure(p)) == "supercritical"


@pytest.mark.parametrize(
    ("delta_P", "D"), [(11.0, 0.0366), (5.0, 0.0279), (3.0, 0.0192), (300.0, 0.0451)]
)
def test_boundary_between_the_two_bifurcations_depends_on_the_pressure(delta_P, D):
    """D where the steady branch of the axisymmetric solver changes its direction."""
    curve = phase_boundary(Parameters(delta_P=delta_P), [3.0])
    assert curve.D.size == 1
    assert curve.D[0] == pytest.approx(D, abs=5e-5)


def test_boundary_of_a_rigid_cell_is_that_of_the_paper():
    curve = phase_boundary(infinite_pressure(Parameters()), [3.0])
    assert pytest.approx(1 / 22, rel=1e-10) == curve.D


@pytest.mark.parametrize("law", LAWS[1:3])
def test_phase_boundary_of_a_soft_cell_is_where_nu_vanishes(law):
    p = Parameters(law=law, delta_P=8.0, eta_b=0.3, alpha=0.05, beta=0.6, R0=1.4)
    curve = phase_boundary(p, np.linspace(0.5, 6, 4))
    on = points(p, c0=curve.c0, D=curve.D)
    beside = [cubic_coefficient(points(on, D=on.D * k)) for k in (1 - 1e-6, 1 + 1e-6)]
    assert np.all(beside[0] * beside[1] < 0)


def test_a_shape_that_nothing_holds_has_no_amplitude_equation():
    still = Parameters(delta_P=0.0, v_p0=0.0)
    with pytest.raises(InvalidInput, match="nothing holds the shape"):
        eliminated(still)
    # At the threshold polymerization itself holds it.
    assert np.isfinite(cubic_coefficient(still))
