"""Roots and minima between two numbers."""

import math

import pytest

from amoeboid.numerics.bracketed import bounded_minimum, bracketed_root


@pytest.mark.parametrize(("xtol", "rtol"), [(1e-300, 1e-14), (1e-6, 1e-14)])
def test_a_root_is_found_to_the_tolerance(xtol, rtol):
    root = bracketed_root(lambda x: x**3 - 2 * x - 5, 2.0, 3.0, xtol, rtol)
    assert root == pytest.approx(2.0945514815423265, abs=2 * xtol, rel=2 * rtol)


@pytest.mark.parametrize("end", [1.0, math.nan])
def test_a_function_without_a_change_of_sign_or_a_value_is_rejected(end):
    with pytest.raises(ValueError, match=r"sign|NaN"):
        bracketed_root(lambda x: 1.0 if x == 0.0 else end, 0.0, 1.0)


def test_minimum_between_two_numbers():
    x, value = bounded_minimum(lambda x: (x - 0.3) ** 2 + 1.0, 0.0, 1.0, xtol=1e-6)
    assert (x, value) == (pytest.approx(0.3, abs=1e-6), pytest.approx(1.0))
