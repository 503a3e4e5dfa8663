"""Time evolution: conservation, agreement with Newton's method and with the spectrum."""

from itertools import islice

import numpy as np
import pytest

from amoeboid.axisymmetric.evolution import (
    Dynamics,
    evolve,
    evolve_to_steady,
    newton_refined,
    perturbed_sphere,
    state_of,
)
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import growth_rates
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.integrators import Control
from amoeboid.validation import InvalidInput


def test_the_jacobian_is_exact():
    p = Parameters(D=0.4, v_p0=6.0, delta_P=11.0, alpha=0.05)
    dynamics, y = Dynamics(p, 12), perturbed_sphere(p, {1: 1.5, 2: 0.3}, {2: 0.1, 3: 0.05}, 12)
    step = 1e-5
    columns = [
        (dynamics.rate(y + step * e) - dynamics.rate(y - step * e)) / (2 * step)
        for e in np.eye(y.size)
    ]
    exact = dynamics.jacobian(y)
    assert np.abs(np.array(columns).T - exact).max() < 1e-7 * np.abs(exact).max()


def test_area_is_exact_and_filaments_are_conserved_without_turnover():
    p = Parameters(D=0.2, v_p0=1.0, beta=0.0, delta_P=20.0)
    start = perturbed_sphere(p, {1: 0.5}, {2: 0.15, 3: 0.1})
    numbers = []
    for now in islice(evolve(p, start, 3.0, Control(tolerance=1e-8)), 200):
        shape = now.shape
        assert float(shape.area[0]) == pytest.approx(4 * np.pi, rel=1e-13)
        assert abs(float(shape.gap[0])) < 1e-13
        c = shape.grid.even_values @ now.c
        numbers.append(float(shape.surface_integral(c)[0]))
    assert now.t == pytest.approx(3.0)
    np.testing.assert_allclose(numbers, numbers[0], rtol=1e-7)


def test_filaments_relax_at_the_turnover_rate():
    """d/dt of the filament number is beta (c0 A - N): an exact balance of the model."""
    p = Parameters(D=0.4, v_p0=6.0, beta=0.7, delta_P=11.0)
    start = perturbed_sphere(p, {0: 0.4, 1: 1.0}, {2: 0.1})
    first, *_, last = evolve(p, start, 2.0, Control(tolerance=1e-8))
    excess = [
        float(now.shape.surface_integral(now.shape.grid.even_values @ now.c)[0]) / (4 * np.pi)
        - p.c0
        for now in (first, last)
    ]
    assert excess[1] / excess[0] == pytest.approx(np.exp(-0.7 * last.t), rel=1e-6)


@pytest.mark.parametrize(("amplitude", "which"), [(3.0, -1), (0.3, 0)])
def test_both_sides_of_the_hysteresis_end_on_the_states_that_newton_finds(amplitude, which):
    p = Parameters(D=0.4, v_p0=5.5)
    states = steady_solutions(p, degrees=(1,))
    assert len(states) == 3
    end = evolve_to_steady(p, perturbed_sphere(p, {1: amplitude}), 500.0)
    goal = states[which]
    assert end.rate <= 1e-10
    assert end.max_retrograde_speed == pytest.approx(goal.max_retrograde_speed, abs=1e-8)
    assert end.c_front == pytest.approx(goal.c_front, abs=1e-8)
    assert end.c_rear == pytest.approx(goal.c_rear, abs=1e-8)
    assert end.zeta0 == pytest.approx(goal.zeta0, abs=1e-8 * goal.zeta0)
    assert newton_refined(end).converged


def test_the_unstable_state_separates_the_two():
    p = Parameters(D=0.4, v_p0=5.5)
    _, middle, upper = steady_solutions(p, degrees=(1,))
    y = state_of(middle)
    rest = perturbed_sphere(p, {}, n=middle.n)
    below, above = (evolve_to_steady(p, y + s * (y - rest), 500.0) for s in (-0.01, 0.01))
    assert below.max_retrograde_speed < 1e-8
    assert above.max_retrograde_speed == pytest.approx(upper.max_retrograde_speed, abs=1e-8)


def test_supercritical_start_reaches_the_branch_and_strong_deformation_is_survived():
    p = Parameters(D=0.4, v_p0=6.0, delta_P=11.0)
    goal = steady_solutions(p, degrees=(1,))[-1]
    end = evolve_to_steady(p, perturbed_sphere(p, {1: 3.0}, {2: 0.2, 3: 0.1}), 500.0)
    assert end.max_retrograde_speed == pytest.approx(goal.max_retrograde_speed, abs=1e-8)


@pytest.mark.parametrize(
    ("p", "which"),
    [
        (Parameters(D=0.03, v_p0=3.8), 0),  # the sphere above its threshold
        (Parameters(D=0.4, v_p0=5.5), 1),  # the unstable branch
        (Parameters(D=0.4, v_p0=5.5, delta_P=11.0), 1),
    ],
)
def test_the_growth_rate_in_time_is_the_eigenvalue(p, which):
    state = homogeneous(p) if which == 0 else steady_solutions(p, degrees=(1,))[which]
    y = state_of(state)
    dynamics = Dynamics(p, state.n)
    rates, modes = np.linalg.eig(dynamics.jacobian(y))
    mode = modes[:, np.argmax(rates.real)].real
    kick = 1e-5 * mode / np.abs(mode).max()
    control = Control(tolerance=1e-11, first_step=1e-2)
    duration = 1.0
    ends = [list(evolve(p, y + s * kick, duration, control))[-1].y for s in (1.0, -1.0)]
    # half the difference of two mirrored starts: the quadratic terms cancel
    size = np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(2 * kick)
    measured = np.log(size) / duration
    assert measured == pytest.approx(float(growth_rates(state, 0, 28)[0].real), abs=1e-6)


def test_impossible_starts_are_refused():
    p = Parameters()
    with pytest.raises(InvalidInput, match="mode of the shape"):
        perturbed_sphere(p, {}, {1: 0.1})
    with pytest.raises(InvalidInput, match="mode of c"):
        perturbed_sphere(p, {99: 0.1})
    with pytest.raises(InvalidInput, match="touch its axis"):
        next(evolve(p, perturbed_sphere(p, {}, {2: 40.0})))
