import numpy as np
import pytest

from amoeboid.numerics.integrators import Control, StepTooSmall, integrate, rodas_step
from amoeboid.validation import InvalidInput


def pendulum(y):
    return np.array([y[1], -np.sin(y[0]) - 0.1 * y[0] * y[1]])


def pendulum_jacobian(y):
    return np.array([[0.0, 1.0], [-np.cos(y[0]) - 0.1 * y[1], -0.1 * y[0]]])


def solution(steps, embedded=False):
    y, h = np.array([1.0, 0.3]), 2.0 / steps
    for _ in range(steps):
        new, error = rodas_step(pendulum, pendulum_jacobian(y), y, pendulum(y), h)
        y = new - error if embedded else new
    return y


@pytest.mark.parametrize(("embedded", "order"), [(False, 4), (True, 3)])
def test_measured_order(embedded, order):
    exact = solution(1024)
    errors = [np.abs(solution(n, embedded) - exact).max() for n in (8, 16, 32, 64)]
    slope = -np.polyfit(np.log([8, 16, 32, 64]), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.2)


def test_a_stiff_problem_is_integrated_within_the_tolerance():
    # Prothero & Robinson 1974, made autonomous: y follows sin(t) at any stiffness
    def rate(y):
        return np.array([1.0, -1e6 * (y[1] - np.sin(y[0])) + np.cos(y[0])])

    def jacobian(y):
        return np.array([[0.0, 0.0], [1e6 * np.cos(y[0]) - np.sin(y[0]), -1e6]])

    steps = list(integrate(rate, jacobian, np.zeros(2), Control(tolerance=1e-6), end=3.0))
    assert steps[-1].t == pytest.approx(3.0, abs=1e-12)
    assert steps[-1].y[1] == pytest.approx(np.sin(3.0), abs=1e-5)
    assert len(steps) < 200


def test_the_error_follows_the_tolerance():
    exact = solution(1024)
    for tolerance in (1e-4, 1e-6, 1e-8):
        last = None
        for last in integrate(
            pendulum, pendulum_jacobian, np.array([1.0, 0.3]), Control(tolerance=tolerance), end=2.0
        ):
            assert last.error <= 1.0
        assert np.abs(last.y - exact).max() < 20 * tolerance


def test_a_solution_that_blows_up_raises():
    control = Control(tolerance=1e-6, min_step=1e-9)
    with pytest.raises(StepTooSmall, match="min_step"):
        list(integrate(lambda y: y**2, lambda y: np.diag(2 * y), np.ones(1), control, end=2.0))


def test_impossible_controls_are_rejected():
    with pytest.raises(InvalidInput, match="tolerance must be > 0"):
        Control(tolerance=0.0)
