"""Cues along the axis of the axisymmetric cell, against the linear response of the sphere."""

import numpy as np
import pytest

from amoeboid.axisymmetric.branches import branch_from_state
from amoeboid.axisymmetric.evolution import (
    Dynamics,
    evolve_to_steady,
    newton_refined,
    perturbed_sphere,
)
from amoeboid.axisymmetric.stability import growth_rates
from amoeboid.axisymmetric.steady import homogeneous, steady_state, strong_residual
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.closed_forms.response import polarization_by_cue
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput

BELOW = Parameters(v_p0=3.0)


@pytest.mark.parametrize(
    "p",
    [
        BELOW,
        BELOW.replace(delta_P=11.0),
        BELOW.replace(delta_P=11.0, alpha=0.05, eta_b=2.0, D=0.2, R0=2.0),
        BELOW.replace(law="inverse", D=1.0),
        BELOW.replace(v_p0=0.1, beta=0.0),
    ],
    ids=["table", "soft", "elastic", "inverse", "no turnover"],
)
def test_response_to_a_weak_cue_is_that_of_linear_theory(p):
    strength = 1e-5
    state = steady_state(p, homogeneous(p), Cue(strength=strength))
    assert state.converged
    poles = state.concentration(np.array([0.0, np.pi]))
    expected = polarization_by_cue(p, strength)
    assert (poles[0] - poles[1]) / 2 == pytest.approx(float(expected), rel=1e-6)
    flow = abs(expected) * (2 * p.D / p.R0 + p.beta * p.R0) / (2 * p.c0)
    assert state.max_retrograde_speed == pytest.approx(float(flow), rel=1e-6)


def test_response_to_the_other_side_is_the_mirror_image():
    cues = Cue(strength=0.3), Cue(strength=0.3, direction=(0, 0, -2.0)), Cue(strength=-0.3)
    one, *others = (steady_state(BELOW, homogeneous(BELOW), cue) for cue in cues)
    ends = one.concentration(np.array([0.0, np.pi]))
    for other in others:
        assert other.concentration(np.array([np.pi, 0.0])) == pytest.approx(ends, rel=1e-9)


def test_jacobians_with_a_cue_are_exact():
    p, cue = Parameters(D=0.4, v_p0=6.0, delta_P=11.0), Cue(strength=0.4)
    dynamics, y = Dynamics(p, 12, cue), perturbed_sphere(p, {1: 1.5, 2: 0.3}, {2: 0.1, 3: 0.05}, 12)
    system, x = SteadySystem(p, 12, cue=cue), homogeneous(p, 12).x.copy()
    x[:36] += 0.02 * np.cos(np.arange(36.0)) / (1.0 + np.arange(36.0))
    none = np.zeros(0)
    for f, exact, at in (
        (dynamics.rate, dynamics.jacobian(y), y),
        (lambda v: system.residual(v, none), system.jacobian(x, none), x),
    ):
        step = 1e-6
        columns = [(f(at + step * e) - f(at - step * e)) / (2 * step) for e in np.eye(at.size)]
        assert np.abs(np.array(columns).T - exact).max() < 1e-7 * np.abs(exact).max()


@pytest.mark.slow
def test_evolution_settles_to_the_steady_state_under_a_strong_cue():
    cue = Cue(strength=0.5)
    p = Parameters(D=0.4, v_p0=5.0, delta_P=11.0)
    last = evolve_to_steady(p, perturbed_sphere(p, {}), 100.0, rate=1e-7, cue=cue)
    state = newton_refined(last)
    assert state.converged
    assert state.cue == cue
    assert strong_residual(state) < 5e-9
    assert state.c_rear == pytest.approx(last.c_rear, rel=1e-6)
    assert state.c_front == pytest.approx(last.c_front, rel=1e-6)
    fastest = np.linalg.eigvals(Dynamics(p, state.n, cue).jacobian(last.y)).real.max()
    assert fastest < 0


def test_what_a_cue_rules_out_is_refused():
    across = Cue(strength=0.1, direction=(1, 0, 1))
    with pytest.raises(InvalidInput, match=r"direction \(0, 0, 1\).*3D run"):
        steady_state(BELOW, homogeneous(BELOW), across)
    state = steady_state(BELOW, homogeneous(BELOW), Cue(strength=0.01))
    with pytest.raises(InvalidInput, match="needs a cell without a cue"):
        growth_rates(state, 1)
    with pytest.raises(InvalidInput, match=r"a branch .* needs a cell without a cue"):
        branch_from_state(state, "v_p0", (1.0, 3.0), 1.0)
