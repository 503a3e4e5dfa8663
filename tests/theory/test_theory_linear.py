"""Linear theory: derived from the weak form of the shell, then thresholds and refusals."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import theory.shell_equations as model
from amoeboid.closed_forms.linear import (
    base_tension,
    critical_pressure,
    critical_speed,
    driving_slope,
    finite_pressure_matrix,
    finite_pressure_rates,
    first_mode,
    flow_response,
    growth_rate,
    mode_onsets,
    stress_slope,
    thresholds,
)
from amoeboid.closed_forms.points import points
from amoeboid.closed_forms.roots import roots_about
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput
from theory.sample_points import LAWS, sample_points, symbol_values

POINTS = sample_points()


def test_base_tension_follows_from_dissipation_and_energy():
    derived = model.tension_of_the_sphere()
    for p in POINTS:
        assert base_tension(p) == pytest.approx(float(derived.subs(symbol_values(p))), rel=1e-13)


def test_energy_variation_is_tension_times_curvature_minus_pressure():
    # delta E = oint delta_r . (zeta_0 H - delta_P) n dA; H = div n from the normal itself.
    shape = 1 + sp.Rational(1, 5) * model.legendre(2) + sp.Rational(1, 7) * model.legendre(3)
    variation = model.radial(model.legendre(2))
    energy = model.energy_variation(shape, variation)
    x = model.x
    # Normal (h e_r + s h' e_theta)/g; H is the sum of the two principal curvatures of the meridian.
    h, slope = shape, sp.diff(shape, x)
    g = sp.sqrt(h**2 + model.s2 * slope**2)
    n_r, n_slope = h / g, -slope / g
    m, a = model.strain_rates(shape, model.Vectors(n_r, n_slope))
    force = model.zeta_0 * (m + a) - model.delta_P
    density = force * n_r * model.legendre(2) * model.area_density(shape)
    values = {model.zeta_0: 1.7, model.delta_P: 2.3}
    nodes, weights = np.polynomial.legendre.leggauss(60)
    both = [
        np.sum(weights * sp.lambdify(x, side.subs(values), "numpy")(nodes))
        for side in (energy, density)
    ]
    assert both[0] == pytest.approx(both[1], rel=1e-12)
    assert abs(both[0]) > 0.1


@pytest.mark.parametrize("l", [1, 2, *(pytest.param(l, marks=pytest.mark.slow) for l in (3, 4, 5))])
def test_growth_rate_is_derived_from_the_tangential_force_balance(l):
    psi, w, q = model.flow_potential_of_mode(l)
    L = l * (l + 1)
    slope = psi.subs({w: model.f[1], q: 1})
    derived = model.c0 * L / model.R0**2 * slope - L * model.D / model.R0**2 - model.beta
    for p in POINTS:
        values = symbol_values(p)
        assert growth_rate(p, l) == pytest.approx(float(derived.subs(values)), rel=1e-12)
        response = float((-sp.diff(psi, w) / model.R0).subs(values))
        assert flow_response(p, l) == pytest.approx(response, rel=1e-13)
        # alpha enters as a slope added to the law's, and in no other way.
        assert stress_slope(p) == pytest.approx(
            float((sp.diff(psi, q) / sp.diff(psi, w)).subs(values)), rel=1e-12
        )


@pytest.mark.slow  # test_forces.py derives it, with friction, in another way
@pytest.mark.parametrize("l", [2, 3, 4])
def test_finite_pressure_matrix_is_derived_on_the_deformed_sphere(l):
    derived = model.linear_dynamics(l)
    for p in POINTS:
        expected = np.array(derived.subs(symbol_values(p)).tolist(), dtype=float)
        assert finite_pressure_matrix(p, l) == pytest.approx(expected, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("l", [2, 3, 6])
def test_finite_pressure_rates_are_eigenvalues_and_tend_to_the_rigid_sphere(l):
    for p in POINTS:
        matrix = finite_pressure_matrix(p, l)
        expected = sorted(np.linalg.eigvals(matrix).astype(complex), key=lambda z: -z.real)
        found = finite_pressure_rates(p, l)
        assert sorted(found, key=lambda z: (-z.real, z.imag)) == pytest.approx(
            sorted(expected, key=lambda z: (-z.real, z.imag)), rel=1e-9
        )
    p = POINTS[0]
    gaps = [
        abs(finite_pressure_rates(p.replace(delta_P=10.0**k), l)[0].real - growth_rate(p, l))
        for k in (4, 5, 6)
    ]
    # First order in 1/delta_P.
    assert np.log10(gaps[0] / gaps[1]) == pytest.approx(1, abs=0.05)
    assert np.log10(gaps[1] / gaps[2]) == pytest.approx(1, abs=0.05)


def test_complex_pairs_are_conjugate_and_keep_trace_and_determinant():
    p = points(Parameters(), v_p0=np.linspace(0, 60, 400), delta_P=60.0, beta=60.0)
    rates, M = finite_pressure_rates(p, 2), finite_pressure_matrix(p, 2)
    assert np.any(np.abs(rates.imag) > 0.1)
    assert rates.sum(axis=-1) == pytest.approx(np.trace(M, axis1=-2, axis2=-1), rel=1e-12)
    assert rates.prod(axis=-1) == pytest.approx(np.linalg.det(M), rel=1e-9)
    assert np.all(rates[..., 0].real >= rates[..., 1].real)


def test_critical_pressure_is_where_modes_1_and_2_share_a_threshold():
    for p in POINTS:
        at = p.replace(delta_P=float(critical_pressure(p)), v_p0=float(critical_speed(p)))
        scale = abs(growth_rate(at.replace(v_p0=0.0), 2))
        assert abs(finite_pressure_rates(at, 2)[0]) < 1e-10 * scale
        assert abs(growth_rate(at, 1)) < 1e-12 * scale


@pytest.mark.parametrize(("factor", "leader"), [(1.2, 1), (0.8, 2)])
def test_mode_2_leads_below_the_critical_pressure(factor, leader):
    p = Parameters(D=0.4, beta=2.0)
    found = first_mode(p.replace(delta_P=factor * float(critical_pressure(p))), l_max=2)
    assert found is not None
    assert found.l == leader


def test_mode_onsets_are_marginal():
    p = Parameters(delta_P=2.0)
    for l, v in mode_onsets(p, 5).items():
        rate = growth_rate if l == 1 else lambda p, l: finite_pressure_rates(p, l)[0].real
        below, above = (rate(p.replace(v_p0=v * (1 + k)), l) for k in (-1e-4, 1e-4))
        assert below < 0 < above


@pytest.mark.parametrize("law", LAWS)
def test_threshold_annihilates_the_growth_rate(law):
    for p in (q.replace(law=law) for q in POINTS):
        found = thresholds(p)
        assert found.reason == ""
        assert found.onset.all()
        at = p.replace(v_p0=float(found.v_p0[0]))
        assert abs(growth_rate(at, 1)) < 1e-12 * (p.beta + 2 * p.D / p.R0**2)
        assert critical_speed(p) == found.v_p0[0]


@given(D=st.floats(1e-3, 10), beta=st.floats(0, 10), alpha=st.floats(0, 5), R0=st.floats(0.1, 10))
@settings(max_examples=50, deadline=None)
def test_scanning_finds_the_threshold_of_the_closed_form(D, beta, alpha, R0):
    p = Parameters(D=D, beta=beta, alpha=alpha, R0=R0)
    # Not proportional to v_p0 as written, yet the same law for every v_p0 > 0.
    same = p.replace(law="exp(log(v_p0) - c/c_r)")
    bent = p.replace(law="v_p0**2*exp(-c/c_r)")
    assert thresholds(same).v_p0 == pytest.approx(thresholds(p).v_p0, rel=1e-10)
    assert thresholds(bent).v_p0 == pytest.approx(np.sqrt(thresholds(p).v_p0), rel=1e-10)


def test_every_threshold_is_found_not_just_the_first():
    # v_p0 (1 - v_p0/10) e^{-c}: lambda_1 rises, then falls; two thresholds that solve a quadratic.
    p = Parameters(law="v_p0*(1 - v_p0/40)*exp(-c/c_r)")
    closed = Parameters()
    needed = float(critical_speed(closed))
    expected = np.roots([-1 / 40, 1, -needed])
    found = thresholds(p)
    assert found.v_p0 == pytest.approx(np.sort(expected.real), rel=1e-10)
    assert found.onset.tolist() == [True, False]


def test_two_thresholds_closer_than_the_scan_are_both_found():
    needed = float(critical_speed(Parameters()))
    # Maximum of v (1 - v/k) is k/4, just above what is needed.
    k = 4 * needed * (1 + 1e-7)
    found = thresholds(Parameters(law=f"v_p0*(1 - v_p0/{k!r})*exp(-c/c_r)"))
    assert found.v_p0 == pytest.approx(np.sort(np.roots([-1 / k, 1, -needed]).real), rel=1e-7)
    assert found.v_p0[1] / found.v_p0[0] < 1.002


def test_a_pole_is_no_threshold():
    # The slope jumps from - to + infinity at v_p0 = 5 and would pass for a sign change.
    p = Parameters(law="v_p0*c/c_r/(v_p0 - 5)", c0=1.0)
    found = thresholds(p)
    for v in found.v_p0:
        assert abs(growth_rate(p.replace(v_p0=v), 1)) < 1e-8
    assert not np.any(np.isclose(found.v_p0, 5))


def test_thresholds_of_a_law_that_is_not_defined_everywhere():
    # Defined for v_p0 < 10 only; the slope log(10 - v_p0) falls through the critical one.
    p = Parameters(law="log(10 - v_p0)*c")
    expected = 10 - np.exp(-(2 * p.D / p.R0 + p.beta * p.R0) / (2 * p.c0))
    found = thresholds(p)
    assert found.v_p0 == pytest.approx([expected], rel=1e-12)
    assert found.onset.tolist() == [True]


def test_thresholds_of_a_law_that_wiggles_forever():
    p = Parameters(law="(2 + sin(v_p0))*exp(-c)")
    needed = float(critical_speed(Parameters()))
    assert needed > 3
    assert thresholds(p).reason.startswith("lambda is never 0")
    found = thresholds(p.replace(law="(3 + sin(v_p0))*exp(-c)"))
    rising = np.arcsin(needed - 3)
    assert found.v_p0[:4] == pytest.approx(
        [rising, np.pi - rising, rising + 2 * np.pi, 3 * np.pi - rising], rel=1e-9
    )
    assert found.onset[:4].tolist() == [True, False, True, False]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"c0": 0.0}, "c0 = 0"),
        ({"law": "v_p0*c/c_r"}, "does not decrease"),
        ({"law": "v_p0*exp(-(c - 3)**2)"}, "does not decrease"),
        ({"D": 0.0, "beta": 0.0}, "nothing opposes"),
        ({"law": "(1 - exp(-v_p0))*exp(-c)/100"}, "never 0"),
        ({"c0": 2000.0}, "does not decrease"),
    ],
)
def test_no_threshold_says_why(changes, words):
    p = Parameters(**changes)
    found = thresholds(p)
    assert found.v_p0.size == 0
    assert words in found.reason
    with pytest.raises(InvalidInput, match=r"no threshold: .*|c0 must be > 0"):
        critical_speed(p)


@pytest.mark.parametrize("l", [0, -1, 1.5, True, [1, 0], "2", None])
def test_growth_rate_refuses_what_is_no_degree(l):
    with pytest.raises(InvalidInput, match="l must be a whole number >= 1"):
        growth_rate(Parameters(), l)


@pytest.mark.parametrize("l", [0, 1])
def test_the_matrix_needs_a_degree_of_2(l):
    with pytest.raises(InvalidInput, match="l must be a whole number >= 2"):
        finite_pressure_matrix(Parameters(), l)


def test_inverse_law_refuses_c0_zero():
    with pytest.raises(InvalidInput, match="inverse law needs c > 0"):
        growth_rate(Parameters(c0=0.0, law="inverse"), 1)
    with pytest.raises(InvalidInput, match="inverse law needs c > 0"):
        thresholds(Parameters(c0=0.0, law="inverse"))


def test_overflow_is_refused():
    with pytest.raises(InvalidInput, match="exceeds double precision"):
        growth_rate(Parameters(R0=1e-200), 1)
    with pytest.raises(InvalidInput, match="exceeds double precision"):
        critical_speed(Parameters(c0=705.0, D=1e10))


def test_arrays_give_what_single_points_give():
    names = ("R0", "delta_P", "eta_s", "eta_b", "c0", "c_r", "beta", "D", "v_p0", "alpha")
    for law in LAWS:
        columns = {name: [getattr(p, name) for p in POINTS] for name in names}
        many = points(Parameters(), **columns, law=law)
        singles = [p.replace(law=law) for p in POINTS]
        for function in (critical_speed, critical_pressure, driving_slope, base_tension):
            expected = [float(function(p)) for p in singles]
            assert function(many) == pytest.approx(expected, rel=1e-13)
        rates = growth_rate(points(many, D=np.array([[0.1], [0.2]])), [1] * len(POINTS))
        assert rates.shape == (2, len(POINTS))


@pytest.mark.parametrize(
    ("function", "roots", "most"),
    [
        (lambda x: np.where(x < 6.0, np.cos(x), 1.0), [np.pi / 2, 3 * np.pi / 2], 6),
        (lambda x: np.arctan(50 * (x - 2.0)), [2.0], 6),
        (lambda x: np.where(x < 3.0, 1.0 - x, x - 5.0), [1.0, 5.0], 6),
        (lambda x: (x - 0.7) ** 3, [0.7], 20),
        (lambda x: 1.0 / (x - 2.0), [], 20),
    ],
)
def test_roots_are_met_in_few_calls_and_poles_are_none(function, roots, most):
    calls = []

    def counted(x):
        calls.append(np.size(x))
        return function(x)

    assert list(roots_about(counted, 1.0)) == pytest.approx(roots, rel=1e-13)
    assert len(calls) <= 1 + most * max(len(roots), 1)


def test_a_root_is_kept_whose_value_has_another_sign_among_other_points():
    # functions of NumPy may round differently in arrays of other lengths
    def rounded(x):
        return x - 1.0 + (1e-15 if np.size(x) > 100 else -1e-15)

    assert list(roots_about(rounded, 1.0)) == pytest.approx([1.0], rel=1e-12)
