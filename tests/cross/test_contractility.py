"""An isotropic active stress, declared by a user, in theory, axisymmetric solver and 3D.

Contractility tau = +chi c is what alpha = -chi would be. The growth rate of a polarization is

    lambda_1 = -2 c0 w_1/R0 - 2 D/R0^2 - beta,   w_1 = v_p'(c0) - chi R0/(2 (eta_s + eta_b)),

so that the threshold of the paper's exponential law is

    v_p^c = (c_r/c0) exp(c0/c_r) [ D/R0 + beta R0/2 - chi c0 R0/(2 (eta_s + eta_b)) ].
"""

from dataclasses import dataclass

import numpy as np
import pytest

from amoeboid import steady_states
from amoeboid.axisymmetric.onset import onset_speed, onset_speeds, onsets
from amoeboid.axisymmetric.stability import growth_rates
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.closed_forms.amplitude import at_threshold
from amoeboid.closed_forms.branch import branch
from amoeboid.closed_forms.linear import (
    base_tension,
    critical_speed,
    first_mode,
    growth_rate,
    mode_onsets,
    thresholds,
)
from amoeboid.closed_forms.phase_boundary import phase_boundary
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.closed_forms.summary import summary
from amoeboid.model.parameters import Parameters, parameters_from
from amoeboid.model.stress import Stress
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.initial import sphere
from amoeboid.surface.stability import leading_growth_rate
from amoeboid.validation import InvalidInput
from cross.test_theory_against_axisymmetric import measured_branch
from surface.shapes import observed_orders
from surface.test_growth import extrapolated_growth_rate


@dataclass(frozen=True)
class Myosin(Stress):
    chi: float
    name = "myosin"

    def value(self, c, c_r):
        return self.chi * c


def myosin(c, c_r, chi):
    return chi * c


def contractile(chi, **changes):
    given = {"stress": "chi*c", "stress.chi": chi, "v_p0": 2.5}
    return parameters_from(given | changes)


def derived_threshold(p, chi):
    opposed = p.D / p.R0 + p.beta * p.R0 / 2 - chi * p.c0 * p.R0 / (2 * (p.eta_s + p.eta_b))
    return p.c_r / p.c0 * np.exp(p.c0 / p.c_r) * opposed


@pytest.mark.parametrize(("chi", "rounded"), [(0.3, 2.04203), (0.6, 0.53561)])
def test_contractility_lowers_the_threshold_in_theory_and_axisymmetric_solver(chi, rounded):
    table = Parameters()
    exact = derived_threshold(table, chi)
    assert exact == pytest.approx(rounded, abs=5e-6)
    ways = [
        contractile(chi),
        Parameters(stress=Myosin(chi)),
        Parameters(stress=lambda c, c_r: chi * c),
        Parameters(chi=chi),
        parameters_from({"stress": "saturating", "stress.chi": chi, "stress.c_s": 1e16}),
    ]
    for p in ways:
        assert critical_speed(p) == pytest.approx(exact, rel=1e-13)
    assert onset_speed(ways[1]) == pytest.approx(exact, rel=1e-12)


def test_myosin_alone_polarizes_from_the_chi_that_balances_diffusion_and_turnover():
    """chi = (D/R0 + beta R0/2) 2 (eta_s + eta_b)/(c0 R0) = 0.70667, without polymerization."""
    p = contractile(0.5, v_p0=0.0)
    exact = (p.D / p.R0 + p.beta * p.R0 / 2) * 2 * (p.eta_s + p.eta_b) / (p.c0 * p.R0)
    assert exact == pytest.approx(0.70667, abs=5e-6)
    assert onsets(p, "stress.chi", 0.1, 2.0) == (pytest.approx(exact, rel=1e-12),)
    rates = growth_rate(points(p, **{"stress.chi": [exact - 0.01, exact, exact + 0.01]}), 1)
    assert rates == pytest.approx([-0.015, 0.0, 0.015], abs=1e-14)


def test_a_cell_that_myosin_polarizes_alone_has_no_threshold():
    p = contractile(0.71)
    found = thresholds(p)
    assert found.reason == "the isotropic stress by itself polarizes the cell at every v_p0"
    with pytest.raises(
        InvalidInput, match="no threshold: the isotropic stress by itself polarizes"
    ):
        critical_speed(points(p, D=[0.1, 0.01]))
    assert first_mode(p).v_p0 == 0
    assert first_mode(p).l == mode_onsets(p)[1] + 1 == 1
    assert onset_speeds(p) == ()
    told = summary(p)
    assert told.max_retrograde_speed is None
    assert any("the isotropic stress by itself polarizes" in note for note in told.notes)


def test_polymerization_that_grows_with_c_stabilizes_what_myosin_polarizes():
    """The one threshold is where stability is regained."""
    p = contractile(0.8, law="v_p0*(1 + c/c_r)/10")
    found = thresholds(p)
    assert found.v_p0 == pytest.approx([10 * p.c_r * (0.8 * 0.25 - 0.53 / 3)])
    assert not found.onset[0]
    assert growth_rate(p.replace(v_p0=0.9 * found.v_p0[0]), 1) > 0
    assert growth_rate(p.replace(v_p0=1.1 * found.v_p0[0]), 1) < 0


def test_the_phase_boundary_is_found_where_myosin_alone_polarizes_at_small_diffusion():
    p = contractile(0.75, delta_P=8.0)
    curve = phase_boundary(p, [3.0])
    for D, v_p0 in zip(curve.D, curve.v_p0, strict=True):
        at = p.replace(D=float(D))
        assert critical_speed(at) == pytest.approx(float(v_p0), rel=1e-9)
        below, above = (at_threshold(p.replace(D=float(D) * k)).nu for k in (1 - 1e-6, 1 + 1e-6))
        assert below * above < 0
    assert curve.D.size


def resting(p, subdivisions):
    model, state = sphere(p, subdivisions)
    return model, state, flow_of(model, state, 1e-2)


@pytest.mark.parametrize("chi", [0.25, 0.4])
def test_growth_rates_of_a_contractile_cell_converge_on_meshes(chi):
    """At v_p0 = 1.8 the polarization decays for the smaller chi and grows for the larger."""
    p = contractile(chi, v_p0=1.8)
    exact = float(growth_rate(p, 1))
    assert exact * (chi - 0.3) > 0
    assert max(growth_rates(homogeneous(p, 8), 0).real) == pytest.approx(exact, rel=1e-9)
    found = [leading_growth_rate(*resting(p, n), 1.0, 1e-6, 1e-4).rate for n in (1, 2)]
    assert np.all(np.sign(found) == np.sign(exact))
    print(chi, exact, found)


@pytest.mark.slow
@pytest.mark.parametrize(
    "p",
    [
        contractile(0.25, v_p0=1.8),
        contractile(0.4, v_p0=1.8),
        contractile(0.65, v_p0=0.0),  # nearer to the threshold the error changes its sign
        contractile(0.73, v_p0=0.0),
        contractile(1.0, stress="chi*c/(1 + (c/c_r)**2)", v_p0=4.0, alpha=0.05),
    ],
)
def test_growth_of_a_contractile_cell_is_second_order_in_the_mesh(p):
    exact = float(growth_rate(p, 1))
    found = [extrapolated_growth_rate(p, 1, n) for n in (2, 3)]
    errors = np.array(found) - exact
    print(p.stress, p.v_p0, exact, found)
    assert np.all(np.abs(observed_orders((162, 642), errors) - 2) < 0.2), errors
    assert np.sign(found[-1]) == np.sign(exact)


@pytest.mark.slow
@pytest.mark.parametrize("chi", [0.69, 0.72])
def test_myosin_alone_polarizes_the_cell_on_a_mesh_too(chi):
    """Beside chi = 0.70667, within the error of 642 nodes: 3e-4 at chi = 0.73."""
    p = contractile(chi, v_p0=0.0)
    found = extrapolated_growth_rate(p, 1, 3)
    assert found == pytest.approx(float(growth_rate(p, 1)), abs=5e-4)
    assert found * (chi - 0.70667) > 0


NONLINEAR = [
    parameters_from(
        {"stress": "chi*c/(1 + (c/k)**2)", "stress.chi": 0.5, "stress.k": 2.5, "delta_P": 5.0}
    ),
    parameters_from(
        {
            "stress": "chi*c_r*(1 - exp(-c/k))", "stress.chi": 0.4, "stress.k": 2.0,
            "law": "inverse", "delta_P": 11.0, "alpha": 0.1, "eta_b": 0.4, "R0": 1.2,
        }
    ),
]  # fmt: skip


@pytest.mark.parametrize("p", NONLINEAR)
def test_the_polarized_branch_under_a_nonlinear_stress_is_that_of_the_theory(p):
    """v_2 to six digits and v_4, of free shapes: the derivatives of tau to fifth order."""
    found = branch(p)
    v_2, v_4 = measured_branch(p)
    assert found.v_2 == pytest.approx(v_2, rel=1e-6)
    m_3 = float(at_threshold(p).m_3)
    assert found.v_4 - 2 * found.v_2 * m_3 == pytest.approx(v_4, rel=1e-4)


def test_tension_at_rest_is_that_of_the_axisymmetric_sphere():
    for p in NONLINEAR:
        assert base_tension(p) == pytest.approx(homogeneous(p).zeta0, rel=1e-14)


def test_a_rigid_cell_depends_on_stress_and_law_through_one_function_alone():
    """v_p of one cell is w of the other: at infinite pressure the theory cannot tell them apart."""
    law = "v_p0*exp(-c/c_r) + chi/4*c_r/(1 + c/c_r)"
    stressed = parameters_from({"stress": "-chi*c_r/(1 + c/c_r)", "stress.chi": 0.3})
    grown = parameters_from({"law": law, "law.chi": 0.3})
    one, other = (at_threshold(infinite_pressure(p)) for p in (stressed, grown))
    for name in ("v_p0", "m_2", "m_3", "m_4", "nu", "nu_5"):
        assert getattr(one, name) == pytest.approx(float(getattr(other, name)), rel=1e-12)


def test_steady_states_without_a_threshold_are_found_in_time_and_said_to_be_incomplete():
    """tau'(c0) = 0.9 exceeds the 0.8 from which on this cell polarizes at v_p0 = 0."""
    given = {"stress": "chi*c/(1 + (c/k)**2)", "stress.chi": 2.6, "stress.k": 5.0}
    found = steady_states(parameters_from(given | {"v_p0": 0.5, "D": 0.1}))
    assert not found.complete
    assert "the sphere polarizes without polymerization" in found.problems[0]
    sphere_, polarized = found
    assert sphere_.max_retrograde_speed == 0
    assert polarized.c_rear > 3 * polarized.c_front
    assert polarized.stable
