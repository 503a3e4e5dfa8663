"""Derivatives of functions of NumPy by Taylor arithmetic, against sympy."""

import math

import numpy as np
import pytest
import sympy

from amoeboid.numerics.taylor import _UFUNCS, Taylor

X = sympy.Symbol("x", positive=True)
AT, ORDER = 0.7, 6
# What is called with a series, and the same in sympy.
FUNCTIONS = {
    np.exp: (lambda x: np.exp(-x / 2), sympy.exp(-X / 2)),
    np.exp2: (lambda x: np.exp2(x), 2**X),
    np.expm1: (lambda x: np.expm1(x * x), sympy.exp(X**2) - 1),
    np.log: (lambda x: np.log(1 + x), sympy.log(1 + X)),
    np.log2: (lambda x: np.log2(x), sympy.log(X, 2)),
    np.log10: (lambda x: np.log10(x), sympy.log(X, 10)),
    np.log1p: (lambda x: np.log1p(x**2), sympy.log(1 + X**2)),
    np.sqrt: (lambda x: np.sqrt(1 + x), sympy.sqrt(1 + X)),
    np.square: (lambda x: np.square(np.exp(x)), sympy.exp(2 * X)),
    np.reciprocal: (lambda x: np.reciprocal(1 + x), 1 / (1 + X)),
    np.sin: (lambda x: np.sin(2 * x), sympy.sin(2 * X)),
    np.cos: (lambda x: np.cos(x * x), sympy.cos(X**2)),
    np.tan: (lambda x: np.tan(x), sympy.tan(X)),
    np.arctan: (lambda x: np.arctan(x * x), sympy.atan(X**2)),
    np.sinh: (lambda x: np.sinh(x), sympy.sinh(X)),
    np.cosh: (lambda x: np.cosh(x), sympy.cosh(X)),
    np.tanh: (lambda x: np.tanh(x * x), sympy.tanh(X**2)),
    np.arcsinh: (lambda x: np.arcsinh(x * x), sympy.asinh(X**2)),
    np.negative: (lambda x: np.negative(x * x), -(X**2)),
    np.positive: (lambda x: np.positive(x * x), X**2),
    np.add: (lambda x: np.add(np.float64(2.0), x**3), 2 + X**3),
    np.subtract: (lambda x: np.float64(2.0) - x**3, 2 - X**3),
    np.multiply: (lambda x: np.float64(2.0) * x**3, 2 * X**3),
    np.true_divide: (lambda x: np.float64(2.0) / x, 2 / X),
    np.power: (lambda x: np.power(x, x) + np.power(2.0, x), X**X + 2**X),
    np.float_power: (lambda x: np.float_power(x, -2.5), X ** sympy.Rational(-5, 2)),
}


@pytest.mark.parametrize("ufunc", FUNCTIONS, ids=lambda u: u.__name__)
def test_derivatives_of_a_function_of_numpy_are_exact(ufunc):
    function, exact = FUNCTIONS[ufunc]
    found = function(Taylor.variable(np.array([AT]), ORDER)).derivatives()
    expected = [float(sympy.diff(exact, X, k).subs(X, AT).evalf(30)) for k in range(ORDER + 1)]
    np.testing.assert_allclose(np.ravel([np.ravel(f)[0] for f in found]), expected, rtol=1e-11)
    # the value is what the function makes of the number itself
    assert function(np.array([AT]))[0] == pytest.approx(expected[0], rel=1e-14)


def test_every_function_that_is_known_is_tested():
    assert set(FUNCTIONS) == set(_UFUNCS)


def test_missing_coefficients_are_zero():
    found = (3.0 + Taylor.variable(np.array([2.0]), 4) ** 2).derivatives()
    assert [float(np.ravel(f)[0]) for f in found] == [7.0, 4.0, 2.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "function",
    [
        np.abs, np.floor, lambda x: np.maximum(x, 1.0), lambda x: np.clip(x, 0.0, 1.0),
        lambda x: np.where(x > 1, x, 0.0), lambda x: np.interp(x, [0, 1], [0, 1]), np.asarray,
        float, math.exp, lambda x: np.add.reduce(x), lambda x: np.exp(x, out=np.empty(1)),
    ],
)  # fmt: skip
def test_what_has_no_derivative_is_refused(function):
    with pytest.raises(TypeError):
        function(Taylor.variable(np.array([AT]), 2))


@pytest.mark.parametrize("exponent", [3, 3.0, np.float64(3), np.array(3.0), 3 + 0j])
def test_whole_powers_of_negative_numbers_are_products(exponent):
    found = (Taylor.variable(np.array([-2.0]), 2) ** exponent).derivatives()
    assert [float(np.ravel(f)[0].real) for f in found] == [-8.0, 12.0, -12.0]


def test_exponents_may_be_arrays_and_complex():
    x = Taylor.variable(np.array([2.0, 2.0]), 1)
    value, slope = (x ** np.array([3.0, 0.5])).derivatives()
    np.testing.assert_allclose(value, [8.0, 2**0.5])
    np.testing.assert_allclose(slope, [12.0, 0.5 / 2**0.5])
    # d/dp x^p by a complex step
    (step,) = (x ** (3 + 1e-30j)).derivatives()[0].imag[:1] / 1e-30
    assert step == pytest.approx(8 * math.log(2), rel=1e-14)
