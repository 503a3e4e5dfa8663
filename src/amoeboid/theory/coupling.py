"""Coefficients of the amplitude equations of the rigid sphere, to fifth order, for any law.

With c = c0 + a P_1 + b P_2 + d P_3 + ..., where a ~ e, b ~ e^2, d ~ e^3, and delta_P -> infinity:

    a' = lambda_1 a + A3 a^3 + A11 a b + A5 a^5 + A31 a^3 b + A12 a b^2 + A201 a^2 d + A011 b d
    b' = lambda_2 b + B2 a^2 + B4 a^4 + B21 a^2 b + B02 b^2 + B101 a d
    d' = lambda_3 d + D3 a^3 + D11 a b

The mean of c does not change: div(v c) has no mean on a sphere at rest. Derived in
tests/theory/test_theory_amplitude.py; SI `eq_coeff_cdot_actin_non_linear_1` and `_2` for the
exponential law, `eq_nonlinear_inv` for the inverse law, both to third order.
"""

from __future__ import annotations

from dataclasses import dataclass

from amoeboid.polymerization import Array
from amoeboid.theory.linear import driving_slope, flow_response, growth_rate
from amoeboid.theory.points import Points, finite_result


@dataclass(frozen=True, kw_only=True)
class CubicEquations:
    """The equations to third order: all that nu needs. Units: 1/T over powers of N/L^2."""

    lambda_1: Array
    lambda_2: Array
    A3: Array
    A11: Array
    B2: Array


@dataclass(frozen=True, kw_only=True)
class FifthOrder:
    """The terms of fourth and fifth order, and the third harmonic that they need."""

    lambda_3: Array
    A5: Array
    A31: Array
    A12: Array
    A201: Array
    A011: Array
    B4: Array
    B21: Array
    B02: Array
    B101: Array
    D3: Array
    D11: Array


@finite_result
def cubic_equations(p: Points) -> CubicEquations:
    """The amplitude equations to third order at v_p0 of p; broadcasts over the parameters.

    Raises InvalidInput where the law is not defined at c0 or a coefficient overflows.
    """
    c0, R0 = p.c0, p.R0
    _, _, f2, f3 = p.v_p_derivatives(c0, 3)
    g1 = driving_slope(p)
    G2 = flow_response(p, 2)
    return CubicEquations(
        lambda_1=growth_rate(p, 1),
        lambda_2=growth_rate(p, 2),
        A3=-(c0 * f3 + 2 * G2 * f2) / (5 * R0),
        A11=2 * ((1 - 3 * G2) * g1 - 2 * c0 * f2) / (5 * R0),
        B2=-2 * (g1 + c0 * G2 * f2) / R0,
    )


@finite_result
def fifth_order(p: Points) -> FifthOrder:
    """The terms beyond third order at v_p0 of p; broadcasts, and raises as `cubic_equations`."""
    c0, R0 = p.c0, p.R0
    _, _, f2, f3, f4, f5 = p.v_p_derivatives(c0, 5)
    g1 = driving_slope(p)
    G2, G3 = flow_response(p, 2), flow_response(p, 3)
    return FifthOrder(
        lambda_3=growth_rate(p, 3),
        A5=-(c0 * f5 + 4 * G2 * f4) / (140 * R0),
        A31=((7 - 55 * G2 - 12 * G3) * f3 - 20 * c0 * f4) / (175 * R0),
        A12=((28 - 30 * G2 - 108 * G3) * f2 - 55 * c0 * f3) / (175 * R0),
        A201=-6 * (2 * G2 * f2 + c0 * f3) / (35 * R0),
        A011=18 * ((G2 - 2 * G3) * g1 - c0 * f2) / (35 * R0),
        B4=-((7 + 8 * G3) * f3 + 5 * c0 * G2 * f4) / (35 * R0),
        B21=-(11 * c0 * G2 * f3 + (28 + 10 * G2 + 72 * G3) / 5 * f2) / (7 * R0),
        B02=-6 * G2 * (g1 + c0 * f2) / (7 * R0),
        B101=6 * ((1 - 4 * G3) * g1 - 3 * c0 * G2 * f2) / (7 * R0),
        D3=-4 * (2 * G2 * f2 + c0 * G3 * f3) / (5 * R0),
        D11=-12 * ((1 + 2 * G2) * g1 + 3 * c0 * G3 * f2) / (5 * R0),
    )
