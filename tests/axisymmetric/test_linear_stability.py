"""Spectra: on the sphere against the theory, elsewhere against invariances and the dynamics."""

import numpy as np
import pytest

from amoeboid.axisymmetric.evolution import Dynamics, state_of
from amoeboid.axisymmetric.harmonics import harmonics
from amoeboid.axisymmetric.onset import onset_speeds, onsets
from amoeboid.axisymmetric.phase_diagram import _resting
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import (
    growth_rates,
    is_stable,
    reduced_matrix,
    spectrum,
    sphere_block,
    unstable_modes,
)
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.closed_forms.linear import (
    critical_speed,
    finite_pressure_matrix,
    finite_pressure_rates,
    growth_rate,
)
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput

SPHERES = [
    Parameters(),
    Parameters(D=0.4, v_p0=6.0, alpha=0.1, delta_P=11.0, R0=1.3, eta_b=0.3, c_r=1.7),
    Parameters(law="inverse", delta_P=1.0, beta=0.0),
    Parameters(law="v_p0/(1 + c/c_r)**2", delta_P=0.0, eta_s=0.4),
]


@pytest.mark.parametrize("m", range(4))
@pytest.mark.parametrize("p", SPHERES)
def test_eigenvalues_about_the_sphere_are_those_of_the_theory(p, m):
    found = growth_rates(homogeneous(p), m, degree=9)
    for l in range(max(m, 1), 7):
        exact = (
            np.linalg.eigvals(finite_pressure_matrix(p, l))
            if l > 1
            else np.array([growth_rate(p, 1)])
        )
        for rate in exact:
            assert np.abs(found - rate).min() < 1e-9 * max(1.0, abs(rate))


def test_the_spectrum_on_the_sphere_holds_nothing_else():
    # m = 0, degrees 0..6: c_0; c_1; (rho_l, c_l) for l = 2..6
    assert growth_rates(homogeneous(Parameters()), 0, 6).size == 12
    # m = 1: without l = 0; translations removed
    assert growth_rates(homogeneous(Parameters()), 1, 6).size == 11
    assert growth_rates(homogeneous(Parameters()), 2, 6).size == 10


def test_the_block_of_one_degree():
    p = Parameters(D=0.4, v_p0=6.0, delta_P=11.0)
    swapped = finite_pressure_matrix(p, 3)[::-1, ::-1]
    # columns are (h, c) here and (rho, c) = (h / R0, c) in the theory; R0 = 1
    np.testing.assert_allclose(
        np.linalg.eigvals(sphere_block(p, 3)), np.linalg.eigvals(swapped), rtol=1e-11
    )
    assert sphere_block(p, 1)[0, 0] == pytest.approx(float(growth_rate(p, 1)), rel=1e-11)


@pytest.mark.parametrize("m", range(4))
def test_harmonics_are_orthonormal_and_their_slopes_integrate_to_the_laplacian(m):
    basis = harmonics(m, 12, 20)
    weights = basis.weights[:, None]
    np.testing.assert_allclose(
        basis.values.T @ (weights * basis.values), np.eye(13 - m), atol=1e-13
    )
    dirichlet = basis.slopes.T @ (weights * basis.slopes)
    dirichlet += basis.over_sine.T @ (weights * basis.over_sine)
    degrees = basis.degrees * (basis.degrees + 1.0)
    np.testing.assert_allclose(dirichlet, np.diag(degrees), atol=1e-10)


DEFORMED = [
    Parameters(D=0.4, v_p0=6.0, delta_P=11.0),
    Parameters(D=0.4, v_p0=5.5, alpha=0.02, delta_P=30.0, eta_b=0.5),
]


@pytest.mark.parametrize("p", DEFORMED)
def test_translations_and_rotations_of_a_deformed_cell_are_neutral(p):
    """A moved cell stays a moved cell: A maps the span of these modes to itself (m = 1).

    How it moves within that span is a choice of frame.
    """
    state = steady_solutions(p, degrees=(1,))[-1]
    rates, removed, _ = reduced_matrix(state, 1, 30)
    assert removed.shape[1] == 2
    image = rates @ removed
    assert np.linalg.norm(image) > 0.1
    outside = image - removed @ np.linalg.lstsq(removed, image, rcond=None)[0]
    assert np.linalg.norm(outside) < 1e-8


@pytest.mark.parametrize("p", DEFORMED)
def test_axisymmetric_rates_are_those_of_the_nonlinear_dynamics(p):
    """Two derivations that share nothing but the steady state: weak and covariant, strong."""
    state = steady_solutions(p, degrees=(1,))[-1]
    dynamics = np.linalg.eigvals(Dynamics(p, state.n).jacobian(state_of(state)))
    for rate in growth_rates(state, 0, 30)[:6]:
        assert np.abs(dynamics - rate).min() < 1e-7 * abs(rate)


def test_growth_rates_do_not_depend_on_the_number_of_harmonics():
    state = steady_solutions(DEFORMED[0], degrees=(1,))[-1]
    for m in range(4):
        coarse, fine = growth_rates(state, m, 26)[:3], growth_rates(state, m, 32)[:3]
        np.testing.assert_allclose(coarse, fine, rtol=1e-7)


def test_modes_solve_their_eigenvalue_problem():
    p = Parameters(D=0.4, v_p0=6.0)
    found = spectrum(homogeneous(p), 2, 8)
    matrix_, _, _ = reduced_matrix(homogeneous(p), 2, 8)
    np.testing.assert_allclose(matrix_ @ found.modes, found.modes * found.rates, atol=1e-9)


def test_the_sphere_loses_stability_at_the_threshold_for_m_0_and_1_only():
    p = Parameters()
    below, above = (unstable_modes(homogeneous(p.replace(v_p0=v))) for v in (3.54, 3.56))
    assert below == {0: 0, 1: 0, 2: 0, 3: 0}
    assert above == {0: 1, 1: 1, 2: 0, 3: 0}


def test_at_low_pressure_the_sphere_deforms_before_it_polarizes():
    # delta_P* of the theory: below it l = 2 grows first
    p = Parameters()
    p = p.replace(v_p0=float(critical_speed(p)))
    f0 = float(p.v_p(p.c0))
    S = p.eta_s + p.eta_b
    limit = (
        4
        * p.beta
        * p.eta_s
        * S
        * f0
        / (6 * p.D * (2 * p.eta_s + p.eta_b) + p.R0**2 * p.beta * p.eta_s)
    )
    for factor, grows in ((0.99, True), (1.01, False)):
        fastest = growth_rates(homogeneous(p.replace(delta_P=factor * limit)), 2, 8)[0].real
        assert (fastest > 0) == grows


PRESSURES = (300.0, 1e4, 1e6, 1e8, 1e10)


@pytest.mark.parametrize("delta_P", PRESSURES)
@pytest.mark.parametrize("factor", [0.99, 1.01, 1.7])
def test_growing_modes_of_the_sphere_are_those_of_the_theory_at_any_pressure(delta_P, factor):
    p = Parameters(delta_P=delta_P)
    p = p.replace(v_p0=factor * float(critical_speed(p)))
    rates = [growth_rate(p, 1), *(finite_pressure_rates(p, l)[0].real for l in range(2, 8))]
    exact = {m: sum(float(rate) > 0 for rate in rates[max(m - 1, 0) :]) for m in range(4)}
    assert unstable_modes(homogeneous(p)) == exact
    assert exact[0] == {0.99: 0, 1.01: 1, 1.7: 2}[factor]


def test_growing_modes_of_a_polarized_cell_do_not_depend_on_a_high_pressure():
    """The state between fold and threshold grows slowly, at a rate of 0.015."""
    counts = []
    for delta_P in (300.0, 1e6):
        states = steady_solutions(Parameters(D=0.4, v_p0=6.0, delta_P=delta_P), degrees=(1,))
        assert len(states) == 3
        counts.append([unstable_modes(state) for state in states])
        rates = growth_rates(states[1], 0)
        assert 0 < rates[0].real < 0.05
    assert counts[0] == counts[1]
    assert counts[0][1][0] == 1


@pytest.mark.parametrize(
    "p", [Parameters(D=0.001, v_p0=6.0), Parameters(law="inverse", v_p0=12.0, D=0.002)]
)
def test_every_mode_of_the_sphere_that_grows_is_counted(p):
    """13 and 47 modes: more than the harmonics that the sphere itself needs."""
    l = np.arange(2, 100)
    growing = np.append(growth_rate(p, 1) > 0, finite_pressure_rates(p, l)[:, 0].real > 0)
    assert growing.sum() > 12
    found = unstable_modes(homogeneous(p))
    assert [found[m] for m in range(4)] == [growing[max(m, 1) - 1 :].sum() for m in range(4)]


def test_that_not_all_growing_modes_are_counted_is_said():
    found = steady_solutions(Parameters(D=0.0, beta=0.0), (1,))
    assert any("lower bounds" in problem for problem in found.problems)


@pytest.mark.parametrize("change", [{"v_p0": 1e300}, {"R0": 1e-100}, {"D": 1e300}, {"R0": 1e-300}])
def test_cells_beyond_double_precision_are_rejected(change):
    with pytest.raises(InvalidInput, match=r"must be|exceeds double precision"):
        steady_solutions(Parameters(**change), (1,))


@pytest.mark.parametrize(
    "p",
    [
        Parameters(),
        Parameters(D=0.4, c0=1.7, alpha=0.3, R0=2.0),
        Parameters(law="inverse", beta=0.0),
        Parameters(law="v_p0/(1 + (c/c_r)**2)", stress="-c/(1 + c)"),
    ],
)
def test_thresholds_of_l_1_in_closed_form_are_the_roots_of_the_linearization(p):
    found = onset_speeds(p)
    assert found
    for threshold in found:
        low, high = 0.97 * threshold, 1.02 * threshold
        assert onsets(p, "v_p0", low, high) == pytest.approx((threshold,), rel=1e-13)


@pytest.mark.parametrize("p", [Parameters(D=0.4), Parameters(D=0.4, delta_P=1.0, law="inverse")])
def test_the_sphere_rests_where_its_spectrum_says_so(p):
    threshold = onset_speeds(p)[0]
    speeds = threshold * np.array([0.3, 1 - 1e-9, 1 + 1e-9, 1.7])
    spheres = [homogeneous(p.replace(v_p0=float(v))) for v in speeds]
    expected = [growth_rates(sphere, 0, 8).real.max() < 0 for sphere in spheres]
    assert _resting(p, speeds).tolist() == expected
    assert {is_stable(spheres[0]), is_stable(spheres[3])} == {True, False}
