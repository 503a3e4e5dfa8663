"""Fixed-point iteration: the estimate of the remaining error, and the Anderson step."""

from itertools import pairwise

import numpy as np
import pytest

from amoeboid.numerics.iterations import Iteration, anderson_step, remaining_error


def linear_map(factors):
    """A linear map with these contraction factors (n,), and its fixed point."""
    factors = np.asarray(factors)
    solution = 1.0 + 0.1 * np.arange(len(factors))
    return lambda x: solution + factors * (x - solution), solution


@pytest.mark.parametrize("factor", [0.3, -0.5, 0.9, 2.0])
def test_anderson_step_solves_a_map_of_one_contraction_factor(factor):
    """The step has its maximum length where the exact one is longer (0.9), or diverges (2)."""
    g, solution = linear_map([factor])
    first = Iteration(x=np.zeros(1), g=g(np.zeros(1)))
    second = Iteration(x=first.g, g=g(first.g))
    ahead = anderson_step(first, second)
    exact = factor / (1 - factor)
    assert ahead == pytest.approx(np.clip(exact, -1.0, 1.0))
    if abs(exact) <= 1.0:
        np.testing.assert_allclose(second.g + ahead * (second.g - first.g), solution, rtol=1e-14)


@pytest.mark.parametrize("factor", [0.05, 0.4, -0.4])
def test_remaining_error_is_exact_for_one_positive_contraction_factor(factor):
    """It is an upper bound where the iterations alternate about the solution."""
    g, solution = linear_map([factor, factor])
    first = Iteration(x=np.zeros(2), g=g(np.zeros(2)))
    second = Iteration(x=first.g, g=g(first.g))
    exact = np.abs(second.g - solution).max()
    left = remaining_error(first, second)
    assert left == pytest.approx(exact if factor > 0 else exact * (1 - factor) / (1 + factor))


def test_remaining_error_needs_no_consecutive_iterations():
    g, solution = linear_map([0.4, 0.4])
    a, b = np.array([3.0, 0.0]), np.array([2.5, 0.7])
    found = remaining_error(Iteration(a, g(a)), Iteration(b, g(b)))
    assert found >= np.abs(g(b) - solution).max()
    assert found < 2.0 * np.abs(g(b) - solution).max()


def test_remaining_error_of_a_diverging_iteration_is_infinite():
    g, _ = linear_map([1.0, 1.5])
    iterations = [np.zeros(2), np.ones(2)]
    first, second = (Iteration(x, g(x)) for x in iterations)
    assert remaining_error(first, second) == np.inf


def test_remaining_error_and_anderson_step_vanish_at_the_solution():
    g, solution = linear_map([0.5])
    same = Iteration(solution, g(solution))
    assert remaining_error(same, same) == 0.0
    assert anderson_step(same, same) == 0.0


def test_anderson_steps_halve_the_number_of_iterations():
    """With one slow contraction factor among fast ones."""
    g, solution = linear_map([0.6, 0.05, -0.05, 0.02])

    def needed(use):
        iterations, x = [], np.zeros(4)
        while not iterations or np.abs(iterations[-1].g - solution).max() > 1e-8:
            iterations.append(Iteration(x, g(x)))
            x = iterations[-1].g
            if use and len(iterations) > 1:
                before, last = iterations[-2:]
                x = last.g + anderson_step(before, last) * (last.g - before.g)
        return len(iterations), [p.change for p in iterations]

    without, changes = needed(False)
    assert all(b < a for a, b in pairwise(changes))
    assert needed(True)[0] <= without / 2
