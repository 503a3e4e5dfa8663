"""Spectra of several states at once are those of each state alone, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from amoeboid.axisymmetric import stability
from amoeboid.axisymmetric.linearization import MAX_TOGETHER, linearizations
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import (
    AZIMUTHAL_NUMBERS,
    are_stable,
    are_stable_along,
    fastest_rates,
    growth_rates,
    growth_rates_of,
    is_stable,
)
from amoeboid.axisymmetric.steady import homogeneous, steady_state
from amoeboid.axisymmetric.unknowns import resampled
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput


@pytest.fixture(scope="module")
def states():
    """Spheres and polarized cells: with and without turnover, friction, bending, pressure."""
    found = list(steady_solutions(Parameters(D=0.4, v_p0=5.5), degrees=(1,)))
    found += [
        steady_state(Parameters(D=0.4, v_p0=v, delta_P=pressure), found[-1])
        for v, pressure in ((5.52, 300.0), (5.54, 300.0), (5.56, 200.0), (6.0, 300.0))
    ]
    more_modes = replace(found[2], n=48, x=resampled(found[2].x, found[2].n, 48))
    found.append(steady_state(Parameters(D=0.4, v_p0=5.52), more_modes))
    surrounded = Parameters(D=0.4, v_p0=5.5, gamma_t=0.01, gamma_share=0.5, kappa=0.1)
    found.append(steady_state(surrounded, found[2]))
    found.append(homogeneous(Parameters(beta=0.0, v_p0=0.1)))
    assert [state.message for state in found] == [""] * len(found)
    return found


def test_rates_of_states_together_are_those_of_each_alone(states):
    together = growth_rates_of(states)
    sizes = [len(which) for which, _ in linearizations(states)]
    assert max(sizes) > 1
    assert len(sizes) > 2
    modes = [{states[k].n for k in which} for which, _ in linearizations(states)]
    assert {32, 48} in modes
    for state, rates in zip(states, together, strict=True):
        for m in AZIMUTHAL_NUMBERS:
            np.testing.assert_array_equal(rates[m], growth_rates(state, m))


def test_states_together_are_stable_where_each_alone_is(states):
    answers = are_stable(states)
    assert answers == [is_stable(state) for state in states]
    assert set(answers) == {True, False}


def test_stability_along_a_branch_is_that_of_every_state_on_it(monkeypatch):
    """Of 60 spheres through their threshold, those next to it are looked at, of others some."""
    threshold = onset_speed(Parameters())
    spheres = [homogeneous(Parameters(v_p0=v), 16) for v in threshold * np.linspace(0.6, 1.6, 60)]
    expected = are_stable(spheres)
    seen = []
    monkeypatch.setattr(
        stability,
        "fastest_rates",
        lambda states: (seen.extend(states), fastest_rates(states))[1],
    )
    assert are_stable_along(spheres) == expected
    assert set(expected) == {True, False}
    assert len({id(state) for state in seen}) == len(seen) < 45
    change = expected.index(False)
    assert {id(s) for s in spheres[change - 1 : change + 1]} <= {id(s) for s in seen}
    assert are_stable_along(spheres[:1]) == expected[:1]
    assert are_stable_along([]) == []


def test_states_far_apart_are_all_looked_at():
    """An instability between two stable states of nearly the same rates is not passed over."""
    speeds = np.array([5.0, 5.5, 6.1, 6.9, 7.9])
    spheres = [homogeneous(Parameters(v_p0=v), 8) for v in speeds]
    unstable = 6.1

    def rates(states):
        return np.array([[0.5 if s.parameters.v_p0 == unstable else -0.5] * 4 for s in states])

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(stability, "fastest_rates", rates)
        assert are_stable_along(spheres) == [True, True, False, True, True]


def test_more_states_than_go_together_come_back_in_order(states):
    many = [states[2], states[3]] * MAX_TOGETHER
    rates = [found[1][0] for found in growth_rates_of(many, (1,))]
    assert rates == [rates[0], rates[1]] * MAX_TOGETHER
    assert rates[0] != rates[1]


def test_one_state_that_has_not_converged_is_refused(states):
    p = states[2].parameters
    attempt = steady_state(p.replace(v_p0=4.5), states[2], max_iterations=3)
    assert not attempt.converged
    with pytest.raises(InvalidInput, match="converged"):
        are_stable([states[0], attempt])
