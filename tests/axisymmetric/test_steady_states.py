"""Steady states: exactness of the equations, reference values, limits, failure."""

import numpy as np
import pytest

from amoeboid.axisymmetric.branches import branch_from_sphere
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import growth_rates
from amoeboid.axisymmetric.steady import (
    SteadySolution,
    homogeneous,
    newton_solution,
    steady_state,
    strong_residual,
)
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.axisymmetric.unknowns import fields_of, resampled
from amoeboid.axisymmetric.window import Window
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput

NONE = np.zeros(0)


def polarized(p: Parameters) -> SteadySolution:
    return steady_solutions(p, degrees=(1,))[-1]


POINTS = [
    Parameters(),
    Parameters(D=0.4, v_p0=6.0, alpha=0.1, delta_P=11.0, R0=1.3, eta_b=0.3, c_r=1.7),
    Parameters(law="inverse", beta=0.0, delta_P=1.0),
    Parameters(law="v_p0/(1 + c/c_r)**2", delta_P=0.0),
]


@pytest.mark.parametrize("p", POINTS)
def test_the_jacobian_is_exact(p):
    system = SteadySystem(p, 12)
    rng = np.random.default_rng(2)
    x = homogeneous(p, 12).x
    x = x + 0.03 * rng.normal(size=x.size) / (1 + np.arange(x.size) % 12) ** 2
    step = 1e-30
    columns = [system.residual(x + 1j * step * e, NONE).imag / step for e in np.eye(x.size)]
    exact = np.array(columns).T
    error = np.abs(system.jacobian(x, NONE) - exact).max()
    assert error < 1e-13 * np.abs(exact).max()


@pytest.mark.parametrize("p", POINTS)
def test_the_strong_residual_is_that_of_the_equations_on_a_finer_grid(p):
    n, m = 12, 36
    rng = np.random.default_rng(2)
    x = homogeneous(p, n).x
    x = x + 0.03 * rng.normal(size=x.size) / (1 + np.arange(x.size) % n) ** 2
    found = SteadySystem(p, n).strong_residual(x, NONE)
    x[-2:] = 0.0  # the slack unknowns do not count
    longer, finer = resampled(x, n, m), SteadySystem(p, m)
    f = fields_of(longer, m)
    u, v_p, c, tau = (np.abs(field).max() for field in (f.u, p.v_p(f.c), f.c, p.tau(f.c)))
    fastest = max(u, v_p, p.D / p.R0 + p.beta * p.R0)
    force = p.delta_P + (p.eta_s + p.eta_b) * fastest / p.R0**2 + tau / p.R0
    area = 4 * np.pi * p.R0**2
    units = np.repeat(
        [force, c * fastest / p.R0, 1.0, area, c * area], [2 * m, m, 1, 1, 1]
    )  # fmt: skip
    expected = np.abs(finer.residual(longer, NONE) * finer.row_scales / units).max()
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("p", POINTS)
def test_the_homogeneous_sphere_solves_the_equations(p):
    state = homogeneous(p)
    assert np.abs(SteadySystem(p, 32).residual(state.x, NONE)).max() < 1e-10
    assert strong_residual(state) < 1e-10
    assert state.max_retrograde_speed == 0.0
    assert state.c_front == state.c_rear == p.c0


# From an independent prototype of the same model (complex-step Jacobians, least squares), all
# digits it printed; half a unit of the last of them is the tolerance.
REFERENCES = [
    (Parameters(D=0.4, v_p0=6.0), "max_retrograde_speed", 1.834173, 5e-7),
    (Parameters(D=0.4, v_p0=6.0), "c_front", 0.774928, 5e-7),
    (Parameters(D=0.4, v_p0=6.0), "c_rear", 13.138030, 5e-7),
    (Parameters(D=0.4, v_p0=6.0), "zeta0", 155.064706, 5e-7),
    (Parameters(D=0.03, v_p0=3.6), "max_retrograde_speed", 0.166174, 5e-7),
    (Parameters(D=0.03, v_p0=3.8), "max_retrograde_speed", 0.341712, 5e-7),
    (Parameters(D=0.4, v_p0=6.0, delta_P=11.0), "max_retrograde_speed", 1.7125, 5e-5),
]


@pytest.mark.parametrize(("p", "name", "value", "tolerance"), REFERENCES)
def test_reference_values_at_two_resolutions(p, name, value, tolerance):
    coarse = polarized(p)
    finer = steady_state(
        p, SteadySolution(p, 2 * coarse.n, resampled(coarse.x, coarse.n, 2 * coarse.n), False, ())
    )
    assert coarse.converged
    assert finer.converged
    assert finer.n == 2 * coarse.n
    assert getattr(coarse, name) == pytest.approx(value, abs=tolerance)
    assert getattr(finer, name) == pytest.approx(value, abs=tolerance)
    assert getattr(finer, name) == pytest.approx(getattr(coarse, name), rel=1e-9)


def test_the_error_falls_geometrically_with_the_number_of_modes():
    p = Parameters(D=0.4, v_p0=6.0)
    exact = polarized(p)
    errors = []
    for n in (12, 16, 20, 24):
        start = SteadySolution(p, n, resampled(exact.x, exact.n, n), False, ())
        system = SteadySystem(p, n)
        found = newton_solution(system, start.x)
        assert found.converged
        errors.append(abs(SteadySolution(p, n, found.x, True, ()).zeta0 - exact.zeta0))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(ratios > 4)


@pytest.mark.parametrize(
    "p",
    [
        Parameters(D=0.03, v_p0=3.8),
        Parameters(D=0.4, v_p0=6.0, alpha=0.1),
        Parameters(D=0.4, v_p0=6.0, delta_P=1.0),
        Parameters(D=0.4, v_p0=2.7, law="inverse"),
        Parameters(D=0.03, v_p0=2.0, law="inverse"),
        Parameters(D=0.03, v_p0=0.18, beta=0.0),
        Parameters(D=0.4, v_p0=30.0, law="v_p0/(1 + c/c_r)**2"),
    ],
)
def test_the_strong_form_is_solved_between_the_points_and_nothing_is_lost(p):
    state = polarized(p)
    assert state.max_retrograde_speed > 0.05
    assert strong_residual(state) < 1e-8
    area = 4 * np.pi * p.R0**2
    shape = state.shape
    c = state.concentration(shape.grid.x)
    assert float(shape.area[0]) == pytest.approx(area, rel=1e-12)
    assert float(shape.surface_integral(c)[0]) == pytest.approx(p.c0 * area, rel=1e-10)
    axial, source = state.defects
    assert abs(axial) < 1e-8 * max(p.delta_P, 1.0)
    assert abs(source) < 1e-8


def test_axial_equilibrium_of_every_cap():
    """2 pi r sigma_1 sin(psi) = delta_P pi r^2: an integral that the solver does not use."""
    from amoeboid.axisymmetric.force_balance import stress

    p = Parameters(D=0.4, v_p0=6.0, delta_P=11.0)
    state = polarized(p)
    s = state.shape
    x = s.grid.x
    c = state.concentration(x)
    balance = stress(s, state.flow(x), -p.v_p(c), c, state.zeta0, p)
    np.testing.assert_allclose(2 * s.kappa_2 * balance.meridian, p.delta_P, rtol=1e-8)


def test_physical_pressure_deforms_the_cell_and_high_pressure_does_not():
    stiff = polarized(Parameters(D=0.4, v_p0=6.0))
    soft = polarized(Parameters(D=0.4, v_p0=6.0, delta_P=11.0))
    assert stiff.deformation < 0.0012
    assert 0.01 < soft.deformation < 0.05


def test_length_and_time_units_do_not_matter():
    p = Parameters(D=0.4, v_p0=6.0)
    length, time, mass, number = 10.0, 7.0, 3.0, 200.0
    scaled = Parameters(
        R0=p.R0 * length,
        delta_P=p.delta_P * mass / (length * time**2),
        eta_s=p.eta_s * mass / time,
        eta_b=p.eta_b * mass / time,
        c0=p.c0 * number / length**2,
        c_r=p.c_r * number / length**2,
        beta=p.beta / time,
        D=p.D * length**2 / time,
        v_p0=p.v_p0 * length / time,
    )
    a, b = polarized(p), polarized(scaled)
    assert b.max_retrograde_speed * time / length == pytest.approx(a.max_retrograde_speed, rel=1e-9)
    assert b.zeta0 / (mass / time**2) == pytest.approx(a.zeta0, rel=1e-9)
    assert b.c_rear / (number / length**2) == pytest.approx(a.c_rear, rel=1e-9)


def test_the_maximum_is_taken_between_the_points_too():
    # sin(x) + sin(2 x) has its maximum where cos(x) = (sqrt(33) - 1)/8
    x = np.arccos((np.sqrt(33) - 1) / 8)
    cell = homogeneous(Parameters()).cell
    at = cell.shape.grid.x
    along = (np.sin(at) + np.sin(2 * at))[:, None] * cell.tangents
    assert cell.max_length(along) == pytest.approx(np.sin(x) + np.sin(2 * x), rel=1e-14)
    assert cell.max_length(0.0 * along) == 0.0


def test_a_hopeless_start_is_reported_not_returned_as_a_solution():
    guess = polarized(Parameters(D=0.4, v_p0=6.0))
    # below the fold at v_p0 = 5.2096 no polarized state exists
    attempt = steady_state(Parameters(D=0.4, v_p0=4.0), guess)
    assert not attempt.converged
    assert "smaller steps" in attempt.message
    assert len(attempt.residuals) >= 2
    assert min(attempt.residuals) > 1e-6
    with pytest.raises(InvalidInput, match="converged"):
        growth_rates(attempt, 0)


def test_a_law_that_is_not_defined_at_the_start_is_no_traceback():
    p = Parameters(law="inverse", v_p0=2.0)
    start = homogeneous(p)
    x = start.x.copy()
    x[2 * start.n] = 2 * p.c0
    attempt = steady_state(p, SteadySolution(p, start.n, x, False, ()))
    assert not attempt.converged
    assert attempt.residuals == (np.inf,)


def test_a_state_that_the_modes_cannot_resolve_is_not_a_solution(monkeypatch):
    p = Parameters(D=0.4, v_p0=6.0)
    exact = polarized(p)
    monkeypatch.setattr("amoeboid.axisymmetric.system.MAX_MODES", 16)
    start = SteadySolution(p, 16, resampled(exact.x, exact.n, 16), False, ())
    attempt = steady_state(p, start)
    assert not attempt.converged
    assert "16 modes" in attempt.message
    # the discrete equations were solved: it is the continuous ones that are not
    assert attempt.residuals[-1] < 1e-9 < strong_residual(attempt)


def test_without_an_instability_only_the_sphere_is_found():
    rising = Parameters(law="v_p0*(1 + c/c_r)")
    assert [s.max_retrograde_speed for s in steady_solutions(rising)] == [0.0]
    assert branch_from_sphere(rising, "v_p0", Window(0.0, 8.0)) is None
