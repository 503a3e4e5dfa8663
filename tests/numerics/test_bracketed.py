"""Roots between two numbers: found to the tolerance, in as few calls as SciPy's."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from amoeboid.numerics.bracketed import bounded_minimum, bracketed_root

FUNCTIONS = {
    "cubic": (lambda x: x**3 - 2 * x - 5, 2.0, 3.0),
    "flat": (lambda x: (x - 0.3) ** 9, -1.0, 2.0),
    "steep": (lambda x: math.exp(20 * x) - 3.0, -5.0, 5.0),
    "step": (lambda x: math.copysign(1.0, x - math.pi), 0.0, 10.0),
    "pole": (lambda x: math.copysign(1.0 / max(abs(x - 1.0), 1e-300), x - 1.0), 0.0, 3.0),
    "wave": (lambda x: math.sin(x) - 0.99999, 0.0, 1.57),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize(("xtol", "rtol"), [(1e-300, 1e-14), (1e-6, 1e-15)])
def test_the_sign_changes_within_the_tolerance_of_a_root(name, xtol, rtol):
    function, low, high = FUNCTIONS[name]
    calls = []
    root = bracketed_root(lambda x: (calls.append(x), function(x))[1], low, high, xtol, rtol)
    assert root in calls
    width = xtol + rtol * abs(root) + 1e-300
    known = {x: function(x) for x in calls}
    assert known[root] == 0.0 or any(
        known[x] * known[root] < 0 and abs(x - root) <= width for x in calls
    )
    _, theirs = brentq(function, low, high, xtol=xtol, rtol=rtol, maxiter=500, full_output=True)
    assert len(calls) <= 1.6 * theirs.function_calls + 4


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4), st.floats(-1e3, 1e3))
def test_roots_of_cubics_are_those_of_scipy(coefficients, scale):
    def function(x):
        return float(np.polyval(coefficients, x)) * scale

    ends = function(-1.0), function(1.0)
    if not ends[0] * ends[1] < 0:
        return
    root = bracketed_root(function, -1.0, 1.0, 1e-15, 1e-15)
    # where there are three, another may be found
    assert abs(function(root)) <= 1e-12 * max(map(abs, ends))


@pytest.mark.parametrize("ends", [(1.0, 1.0), (-1e-200, -1e-200), (math.nan, 1.0), (1.0, math.nan)])
def test_ends_without_a_change_of_sign_are_rejected(ends):
    with pytest.raises(ValueError, match="no change of sign"):
        bracketed_root(lambda x: ends[int(x)], 0.0, 1.0)


def test_a_value_in_between_that_is_none_is_rejected():
    with pytest.raises(ValueError, match="not a number"):
        bracketed_root(lambda x: math.nan if 0.2 < x < 0.8 else x - 0.5, 0.0, 1.0)


def test_a_root_that_is_not_found_is_an_error():
    with pytest.raises(ArithmeticError, match="no root found"):
        bracketed_root(lambda x: math.log(x / 1e-80), 1e-150, 1e100, 1e-300)


def test_an_end_that_is_a_root_is_found():
    assert bracketed_root(lambda x: x, 0.0, 1.0) == 0.0
    assert bracketed_root(lambda x: x - 1.0, 0.0, 1.0) == 1.0


def test_values_beyond_double_precision_lead_to_bisection():
    root = bracketed_root(lambda x: math.inf if x > 0.3 else -1e308, 0.0, 1.0, 1e-12)
    assert root == pytest.approx(0.3, abs=1e-11)


def test_minimum_between_two_numbers():
    x, value = bounded_minimum(lambda x: (x - 0.3) ** 2 + 1.0, 0.0, 1.0, xtol=1e-6)
    assert (x, value) == (pytest.approx(0.3, abs=1e-6), pytest.approx(1.0))
