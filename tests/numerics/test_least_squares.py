"""Gauss-Newton in a trust region: known minima, bounds, and functions that end somewhere."""

from dataclasses import dataclass

import numpy as np
import pytest

from amoeboid.numerics.least_squares import minimum


@dataclass(frozen=True)
class Rosenbrock:
    y: np.ndarray

    @property
    def residuals(self):
        return np.array([10 * (self.y[1] - self.y[0] ** 2), 1 - self.y[0]])

    @property
    def jacobian(self):
        return np.array([[-20 * self.y[0], 10.0], [-1.0, 0.0]])


OPEN = np.full(2, np.inf)


def solved(start, lower=-OPEN, upper=OPEN, ends=lambda _: False):
    return minimum(lambda y, _: None if ends(y) else Rosenbrock(y), Rosenbrock(start), lower, upper)


def test_the_minimum_of_the_valley_of_rosenbrock_is_found():
    found = solved(np.array([-1.2, 1.0]))
    assert found.converged
    np.testing.assert_allclose(found.point.y, [1.0, 1.0], atol=1e-7)


def test_a_bound_holds_and_the_rest_is_minimized():
    found = solved(np.array([-1.2, 1.0]), upper=np.array([0.5, np.inf]))
    np.testing.assert_allclose(found.point.y, [0.5, 0.25], atol=1e-7)
    assert list(found.at_bound) == [True, False]
    assert found.converged


def test_equal_bounds_fix_a_component():
    fixed = np.array([-np.inf, 4.0])
    found = solved(np.array([1.0, 4.0]), fixed, -np.array([-np.inf, -4.0]))
    assert found.point.y[1] == 4.0
    # d/dx of 100 (4 - x^2)^2 + (1 - x)^2 = 0
    x = max(np.roots([400, 0, -1598, -2]).real)
    # converged within 1e-8 of a sum of squares that is 1 there, with the curvature 1600
    assert found.point.y[0] == pytest.approx(x, abs=np.sqrt(1e-8 / 800))


def test_an_edge_downhill_is_told():
    found = solved(np.array([0.2, 0.0]), ends=lambda y: y[0] > 0.5)
    assert found.edge
    assert not found.converged
    assert found.point.y[0] == pytest.approx(0.5, abs=5e-3)


def test_a_direction_without_effect_is_left_alone():
    @dataclass(frozen=True)
    class Sum:
        y: np.ndarray

        @property
        def residuals(self):
            return np.array([self.y.sum() - 3.0, 2.0])

        @property
        def jacobian(self):
            return np.array([[1.0, 1.0], [0.0, 0.0]])

    found = minimum(lambda y, _: Sum(y), Sum(np.array([1.0, 0.0])), -OPEN, OPEN)
    np.testing.assert_allclose(found.point.y, [2.0, 1.0], atol=1e-9)
