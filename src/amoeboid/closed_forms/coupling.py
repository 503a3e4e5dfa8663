"""Coefficients of the amplitude equations of a steady shape, to fifth order, for any law.

c = c0 + a P_1 + b P_2 + d P_3 + ... on the shape r = R0 (1 + rho_2 P_2 + rho_3 P_3 + ...), where
a ~ e, b and rho_2 ~ e^2, d and rho_3 ~ e^3. In the frame in which the shape rests,

    a' = lambda_1 a + A3 a^3 + A11 a b + A1r a rho_2
         + A5 a^5 + A31 a^3 b + A12 a b^2 + A201 a^2 d + A011 b d
         + A3r a^3 rho_2 + A11r a b rho_2 + A1rr a rho_2^2
         + A2s a^2 rho_3 + A01s b rho_3 + A001r d rho_2 + Ars rho_2 rho_3
    b' = lambda_2 b + Br rho_2 + B2 a^2 + B4 a^4 + B21 a^2 b + B02 b^2 + B101 a d
         + B2r a^2 rho_2 + B01r b rho_2 + Brr rho_2^2 + B1s a rho_3
    d' = lambda_3 d + Ds rho_3 + D3 a^3 + D11 a b + D1r a rho_2

with lambda_l for delta_P -> infinity (`growth_rate`). The pressure acts through the shape alone,

    rho_2 = kappa_2 [ w_1 b + Q2 a^2 + Q4 a^4 + Q21 a^2 b + Q02 b^2 + Q101 a d
                      + Q2r a^2 rho_2 + Q01r b rho_2 + Qrr rho_2^2 + Q1s a rho_3 ] + (5/7) rho_2^2
    rho_3 = kappa_3 [ w_1 d + S3 a^3 + S11 a b + S1r a rho_2 ]

with kappa_l = 0 for delta_P -> infinity (`shape_response`). Friction and bending are known to third
order: they change A3, A11, A1r, B2, Br and kappa_2 alone. The area and the filament number fix
the radius and the mean of c, which change at fourth order; rho_1 = 0 fixes the origin. Derived in
tests/theory/test_theory_amplitude.py; SI `eq_coeff_cdot_actin_non_linear_1` and `_2` for the
exponential law, `eq_nonlinear_inv` for the inverse law, both to third order and without the shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.linear import (
    driving_derivatives,
    effective_friction,
    flow_response,
    growth_rate,
    mode_derivatives,
    refuse_nonlinear_friction,
    refuse_surroundings,
    shape_response,
    stress_derivatives,
)
from amoeboid.closed_forms.points import Points, finite_result

SHAPE_SQUARED = 5 / 7
"""Coefficient of rho_2^2 in rho_2: curvature and tension at second order, at any pressure."""


@dataclass(frozen=True, kw_only=True)
class CubicEquations:
    """The equations to third order: all that nu needs.

    Units: 1/T over powers of N/L^2; kappa_2 [T/L]; w_1 and Q2 [L/T] over powers of N/L^2.
    """

    lambda_1: Array
    lambda_2: Array
    A3: Array
    A11: Array
    A1r: Array
    B2: Array
    Br: Array
    kappa_2: Array
    w_1: Array
    Q2: Array


@dataclass(frozen=True, kw_only=True)
class FifthOrder:
    """The terms of fourth and fifth order, and the third harmonic that they need."""

    lambda_3: Array
    A5: Array
    A31: Array
    A12: Array
    A201: Array
    A011: Array
    A3r: Array
    A11r: Array
    A1rr: Array
    A2s: Array
    A01s: Array
    A001r: Array
    Ars: Array
    B4: Array
    B21: Array
    B02: Array
    B101: Array
    B2r: Array
    B01r: Array
    Brr: Array
    B1s: Array
    D3: Array
    D11: Array
    D1r: Array
    Ds: Array
    kappa_3: Array
    Q4: Array
    Q21: Array
    Q02: Array
    Q101: Array
    Q2r: Array
    Q01r: Array
    Qrr: Array
    Q1s: Array
    S3: Array
    S11: Array
    S1r: Array


@finite_result
def cubic_equations(p: Points) -> CubicEquations:
    """The amplitude equations to third order at v_p0 of p; broadcasts over the parameters.

    With bending, and with uniform friction of the surface; friction of the cortex only for
    delta_P -> infinity. Raises InvalidInput for other friction, where the law is not defined at c0,
    a coefficient overflows, or nothing holds the shape (delta_P and v_p(c0) are 0).
    """
    refuse_nonlinear_friction(p)
    c0, R0, S = p.c0, p.R0, p.eta_s + p.eta_b
    f0, f1 = p.v_p_derivatives(c0, 1)
    w = driving_derivatives(p, 3)
    _, w1, w2, _ = w
    _, K1 = stress_derivatives(p, 1)
    G1, G2 = flow_response(p, 1), flow_response(p, 2)
    _, first, second, third = (G1 * w_k for w_k in mode_derivatives(p, 1, 3, w))
    # flow of mode 2 on the shape P_2, and drag of the shape P_2 on a moving cell
    on_shape = 1 - G2 * (1 + (p.gamma_t + p.gamma_c) * R0**2 / (2 * S))
    drag = effective_friction(p) * R0**2 / S
    total = 2 * p.gamma_t + p.gamma_n
    moved = p.gamma_t / np.where(total > 0, total, 1.0)
    steered = (1 + 3 * moved * drag) * f1 - (1 - 6 * moved) * drag / 2 * K1
    return CubicEquations(
        lambda_1=growth_rate(p, 1),
        lambda_2=growth_rate(p, 2),
        A3=-(c0 * third + 2 * G2 * w2) / (5 * R0),
        A11=2 * (first - 3 * G2 * w1 - 2 * c0 * second) / (5 * R0),
        A1r=2 * (4 * p.D / R0 - 4 * c0 * G1**2 * steered - 3 * on_shape * f0) / (5 * R0),
        B2=-2 * (first + c0 * G2 * w2) / R0,
        Br=-6 * c0 * on_shape * f0 / R0,
        kappa_2=shape_response(p, 2),
        w_1=w1,
        Q2=w2 / 3,
    )


@finite_result
def fifth_order(p: Points) -> FifthOrder:
    """The terms beyond third order at v_p0 of p; broadcasts, and raises as `cubic_equations`.

    Raises InvalidInput with friction or bending, where they are not known.
    """
    refuse_surroundings(p, "the theory beyond third order")
    c0, R0, beta = p.c0, p.R0, p.beta
    f0 = p.v_p(c0)
    _, w1, w2, w3, w4, w5 = driving_derivatives(p, 5)
    _, K1, K2, K3 = stress_derivatives(p, 3)
    G2, G3 = flow_response(p, 2), flow_response(p, 3)
    # what a concentration meets on the shape P_2 or P_3
    on_2, on_3 = 2 * c0 * (3 * (2 * G3 - 1) * w1 + K1), c0 * (3 * (1 + 4 * G2) * w1 - 5 * K1)
    a3r = (120 * G2**2 - 89 * G2 - 15) * w2 - 8 * c0 * (8 - 9 * G3) * w3
    a11r = (90 * G2**2 - 93 * G2 + 54 * G3 + 37) * w1 + 5 * (15 * G2 - 4) * K1
    b2r = 16 * (5 * K1 - 9 * (1 - G3) * w1) - 15 * c0 * (1 - G2) * (1 + 8 * G2) * w2
    b01r = 2 * c0 * ((1 - G2) * (1 - 6 * G2) * w1 + (5 * G2 - 1) * K1)
    return FifthOrder(
        lambda_3=growth_rate(p, 3),
        A5=-(c0 * w5 + 4 * G2 * w4) / (140 * R0),
        A31=((7 - 55 * G2 - 12 * G3) * w3 - 20 * c0 * w4) / (175 * R0),
        A12=((28 - 30 * G2 - 108 * G3) * w2 - 55 * c0 * w3) / (175 * R0),
        A201=-6 * (2 * G2 * w2 + c0 * w3) / (35 * R0),
        A011=18 * ((G2 - 2 * G3) * w1 - c0 * w2) / (35 * R0),
        A3r=(a3r + 5 * ((3 + 13 * G2) * K2 + 8 * c0 * K3)) / (175 * R0),
        A11r=4 * (a11r - 2 * c0 * (37 - 81 * G3) * w2 + 55 * c0 * K2) / (175 * R0),
        A1rr=(
            6 * (1 - G2) * (13 + 60 * G2) * f0
            + 2 * c0 * ((205 - 648 * G3) * w1 - 97 * K1)
            + 56 * p.D / R0
        )
        / (175 * R0),
        A2s=6 * (5 * (K1 + c0 * K2) - 3 * (1 + 4 * G2) * (w1 + c0 * w2)) / (35 * R0),
        A01s=-18 * (2 * (1 - G3) * f0 + on_3 + beta * R0) / (35 * R0),
        A001r=18 * ((1 - G2) * f0 + on_2 - beta * R0) / (35 * R0),
        Ars=216 * c0 * (G2 - G3) * f0 / (35 * R0),
        B4=-((7 + 8 * G3) * w3 + 5 * c0 * G2 * w4) / (35 * R0),
        B21=-(11 * c0 * G2 * w3 + (28 + 10 * G2 + 72 * G3) / 5 * w2) / (7 * R0),
        B02=-6 * G2 * (w1 + c0 * w2) / (7 * R0),
        B101=6 * ((1 - 4 * G3) * w1 - 3 * c0 * G2 * w2) / (7 * R0),
        B2r=(b2r + 5 * c0 * (3 + 13 * G2) * K2) / (35 * R0),
        B01r=6 * (b01r + 4 * p.D / R0 - (1 - G2) * f0) / (7 * R0),
        Brr=6 * c0 * (1 - G2) * (1 + 12 * G2) * f0 / (7 * R0),
        B1s=-6 * (4 * (1 - G3) * f0 + on_3 + beta * R0) / (7 * R0),
        D3=-4 * (2 * G2 * w2 + c0 * G3 * w3) / (5 * R0),
        D11=-12 * ((1 + 2 * G2) * w1 + 3 * c0 * G3 * w2) / (5 * R0),
        D1r=-6 * (4 * (1 - G2) * f0 - on_2 + beta * R0) / (5 * R0),
        Ds=-12 * c0 * (1 - G3) * f0 / R0,
        kappa_3=shape_response(p, 3),
        Q4=w4 / 42,
        Q21=11 * w3 / 42,
        Q02=w2 / 7,
        Q101=3 * w2 / 7,
        Q2r=(11 - 8 * G2) * w2 / 14 - 13 * K2 / 42,
        Q01r=(4 * (5 - 3 * G2) * w1 - 10 * K1) / 7,
        Qrr=-2 * (11 - 6 * G2) * f0 / 7,
        Q1s=12 * w1 / 7,
        S3=w3 / 15,
        S11=3 * w2 / 5,
        S1r=-6 * w1 / 5,
    )
