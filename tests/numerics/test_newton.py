import numpy as np
import pytest

from amoeboid.numerics.newton import newton
from amoeboid.validation import InvalidInput


def cubic(x):
    return x**3 - np.array([1.0, 8.0])


def cubic_and_jacobian(x):
    return cubic(x), np.diag(3 * x**2)


def test_converges_quadratically():
    result = newton(cubic, cubic_and_jacobian, np.array([1.3, 2.3]))
    assert result.converged
    np.testing.assert_allclose(result.x, [1.0, 2.0], rtol=1e-14)
    steps = np.array(result.steps)
    order = np.log(steps[3] / steps[2]) / np.log(steps[2] / steps[1])
    assert order == pytest.approx(2.0, abs=0.2)


def test_a_jacobian_serves_for_the_last_steps_and_the_error_left_is_rounding():
    points = []

    def counted(x):
        points.append(x)
        return cubic_and_jacobian(x)

    result = newton(cubic, counted, np.array([1.3, 2.3]))
    assert result.converged
    assert len(points) < len(result.steps)
    np.testing.assert_allclose(result.x, [1.0, 2.0], rtol=1e-14)
    for tolerance in (1e-4, 1e-7):
        result = newton(cubic, counted, np.array([1.3, 2.3]), step_tolerance=tolerance)
        np.testing.assert_allclose(result.x, [1.0, 2.0], rtol=max(tolerance**2, 1e-13))


def test_a_system_without_solution_is_not_converged_and_keeps_its_history():
    result = newton(lambda x: x**2 + 1.0, lambda x: (x**2 + 1.0, np.diag(2 * x)), np.array([3.0]))
    assert not result.converged
    assert len(result.residuals) >= 2
    assert min(result.residuals) >= 1.0 - 1e-12


def test_a_singular_jacobian_is_not_converged():
    result = newton(lambda x: x**2 + 1.0, lambda x: (x**2 + 1.0, np.diag(2 * x)), np.array([0.0]))
    assert not result.converged


def test_a_step_out_of_the_domain_is_shortened():
    def root(x):
        if np.any(x <= 0):
            raise InvalidInput("x must be > 0")
        return np.log(x) - 1.0

    result = newton(root, lambda x: (root(x), np.diag(1 / x)), np.array([20.0]))
    assert result.converged
    assert result.x[0] == pytest.approx(np.e, rel=1e-14)


def test_a_residual_that_is_far_too_large_is_no_overflow():
    def residual(x):
        return np.exp(np.minimum(x * x, 230.0)) - 1.0 + 1e-3 * x

    def both(x):
        f = residual(x)
        return f, np.diag(np.full(x.size, 1e-80))

    found = newton(residual, both, np.array([1.0, 1.0]), max_iterations=3)
    assert not found.converged


def test_a_whole_step_is_taken_where_the_next_is_far_shorter_however_equations_are_scaled():
    """A weak nonlinear term in an equation of a large magnitude."""
    sizes = np.array([1.0, 1e6])

    def residual(x):
        return sizes * np.array([x[0] - 1.0, x[1] - x[0] ** 2])

    def both(x):
        return residual(x), sizes[:, None] * np.array([[1.0, 0.0], [-2 * x[0], 1.0]])

    result = newton(residual, both, np.array([0.99, 0.99**2]))
    assert result.converged
    assert result.residuals[1] > 2 * result.residuals[0]
    assert result.steps[1] < 0.1 * result.steps[0]


def test_factors_of_the_last_jacobian_are_those_at_the_solution_to_first_order():
    result = newton(cubic, cubic_and_jacobian, np.array([1.05, 2.05]))
    assert result.jacobian.solve(np.array([3.0, 12.0])) == pytest.approx([1.0, 1.0], rel=0.02)
    none = newton(lambda x: x, lambda x: (x, np.zeros((2, 2))), np.ones(2))
    assert none.jacobian is None
