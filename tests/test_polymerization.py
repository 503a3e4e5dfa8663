import math

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.model.polymerization import Custom, Exponential, Inverse, law
from amoeboid.numerics.expressions import FUNCTIONS, MAX_EXPRESSION_LENGTH
from amoeboid.validation import InvalidInput

V_P0, C_R = 1.7, 0.8
EXPRESSIONS = [
    "v_p0*exp(-c/c_r)",
    "v_p0*c_r/c",
    "v_p0/(1 + c/c_r)",
    "v_p0/(1 + (c/c_r)**4)",
    "v_p0*(1 - tanh(c/c_r))**0.5",
    "v_p0*sqrt(1 + c**2)*log(2 + c)",
    "v_p0*c**(-3/2) + c_r**c",
    "sin(c)*cos(2*c) - tan(c/4)/pi",
    "sinh(c/3)/cosh(c) + (-c)**3 + c**0 - +c",
    "v_p0*c**-2 / exp(c)**2",
]


def exact_derivatives(expression, c, order):
    """The same expression differentiated by sympy: an independent implementation."""
    names = {n: sympy.Symbol(n, positive=True) for n in ("c", "v_p0", "c_r")}
    f = sympy.sympify(expression, locals={**names, "pi": sympy.pi})
    at = {names["v_p0"]: V_P0, names["c_r"]: C_R, names["c"]: c}
    return [float(sympy.diff(f, names["c"], k).subs(at).evalf(30)) for k in range(order + 1)]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_derivatives_of_expressions_are_exact(expression):
    for c in (0.3, 1.1):
        found = Custom(expression).derivatives(c, V_P0, C_R, order=5)
        np.testing.assert_allclose(found, exact_derivatives(expression, c, 5), rtol=1e-11)


@pytest.mark.parametrize(
    ("named", "expression"),
    [(Exponential(), "v_p0*exp(-c/c_r)"), (Inverse(), "v_p0*c_r/c")],
)
def test_named_laws_have_exact_derivatives(named, expression):
    found = named.derivatives(0.7, V_P0, C_R, order=5)
    np.testing.assert_allclose(found, exact_derivatives(expression, 0.7, 5), rtol=1e-12)


@given(st.floats(0.05, 20.0), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_an_expression_agrees_with_the_named_law(c, v_p0, c_r):
    for named, text in ((Exponential(), "v_p0*exp(-c/c_r)"), (Inverse(), "v_p0*c_r/c")):
        np.testing.assert_allclose(
            Custom(text).derivatives(c, v_p0, c_r), named.derivatives(c, v_p0, c_r), rtol=1e-9
        )


@pytest.mark.parametrize("spec", ["exponential", "inverse", "v_p0/(1+c/c_r)"])
def test_laws_broadcast_and_keep_complex_numbers(spec):
    c = np.linspace(0.5, 2.0, 4)
    values = law(spec).derivatives(c[:, None], np.array([1.0, 2.0]), C_R)
    assert len(values) == 4
    assert all(v.shape == (4, 2) for v in values)
    # the complex step derivative is exact to rounding
    step = law(spec).value(c + 1e-30j, V_P0, C_R).imag / 1e-30
    np.testing.assert_allclose(step, law(spec).derivatives(c, V_P0, C_R)[1], rtol=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "c.real",
        "c if c else 1",
        "lambda: c",
        "[c for c in (1, 2)]",
        "open('x')",
        "exp(c, c)",
        "exp(x=c)",
        "D*c",
        "c + 1j",
        "c + True",
        "c @ c",
        "c // 2",
        "c % 2",
        "c; c",
        "c = 1",
        "",
        "exponentiel",
        "v_p0",
        "1.0",
        "c +",
        "c + 1e999",
        f"c + {'9' * 400}",
        "(" * 300 + "c" + ")" * 300,
        "c" + "+c" * MAX_EXPRESSION_LENGTH,
        "\x00c",
    ],
)
def test_anything_but_arithmetic_is_refused(text):
    with pytest.raises(InvalidInput, match="law"):
        law(text)


@pytest.mark.parametrize("spec", [1.0, None, b"c", ["c"]])
def test_a_law_is_a_word_or_an_expression(spec):
    with pytest.raises(InvalidInput, match="law"):
        law(spec)


@pytest.mark.parametrize(
    ("text", "c"), [("1/(c-1)", 1.0), ("log(c)", 0.0), ("sqrt(c)", 0.0), ("c**9**9**9", 2.0)]
)
def test_an_undefined_value_is_refused_never_nan(text, c):
    with pytest.raises(InvalidInput, match="must be finite"):
        Custom(text).derivatives(c, V_P0, C_R)


def test_the_inverse_law_needs_filaments():
    with pytest.raises(InvalidInput, match="inverse law needs c > 0"):
        Inverse().value(np.array([1.0, 0.0]), V_P0, C_R)


def test_every_function_is_tested():
    text = " ".join(EXPRESSIONS)
    assert all(f"{name}(" in text for name in FUNCTIONS)


def test_negative_integer_powers_at_negative_arguments():
    (value, slope) = Custom("c**-3").derivatives(-2.0, V_P0, C_R, order=1)
    assert math.isclose(value, -1 / 8)
    assert math.isclose(slope, -3 / 16)
