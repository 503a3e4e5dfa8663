"""Amplitude equation of the polarization close to the threshold, and the type of the bifurcation.

a is the amplitude of the first harmonic of c [N/L^2]; all coefficients are dimensional and belong
to delta_P of the points. `infinite_pressure` (points.py) gives those of the rigid sphere, which the
paper prints. Notation: docs/theory.md. Results
have the shape that all arguments broadcast to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.coupling import (
    SHAPE_SQUARED,
    CubicEquations,
    cubic_equations,
    fifth_order,
)
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import AnyPoints, Points, finite_result, infinite_pressure
from amoeboid.validation import InvalidInput

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"


@dataclass(frozen=True, kw_only=True)
class NormalForm:
    """lambda_1 a + nu a^3 + nu_5 a^5, and the harmonics of c and of the shape that follow a.

    b = m_2 a^2 + m_4 a^4, d = m_3 a^3, rho_2 = r_2 a^2 + r_4 a^4, rho_3 = r_3 a^3. v_p0 is where it
    is taken [L/T]; nu [L^4/(T N^2)], nu_5 [L^8/(T N^4)].
    """

    v_p0: Array
    m_2: Array
    m_3: Array
    m_4: Array
    r_2: Array
    r_3: Array
    r_4: Array
    nu: Array
    nu_5: Array


@dataclass(frozen=True)
class SlavedHarmonic:
    """A slaved pair: y' = rate y + feedback r + source, r = response (slope y + drive) + offset.

    y is the harmonic of c, r that of the shape, per power of a.
    """

    rate: Array
    feedback: Array
    response: Array
    slope: Array

    @property
    def rate_at_rest(self) -> Array:
        """The rate of y while the shape follows it: 0 where the pair is neutral [1/T]."""
        return self.rate + self.feedback * self.response * self.slope

    def at_rest(
        self, source: Array, drive: Array, offset: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """(y, r) for y' = 0. Raises InvalidInput where the pair is neutral."""
        rate = self.rate_at_rest
        if np.any(rate == 0):
            raise InvalidInput(
                "D and beta must not both be 0 here: harmonic 2 or 3 is at its own threshold, so "
                "it is not slaved to the first one; raise D or beta"
            )
        y = -(source + self.feedback * (self.response * drive + offset)) / rate
        return y, self.response * (self.slope * y + drive) + offset


@finite_result
def second_harmonic(p: Points) -> SlavedHarmonic:
    """b and rho_2 at v_p0 and delta_P of p."""
    return slaved(cubic_equations(p))


def slaved(e: CubicEquations) -> SlavedHarmonic:
    """`second_harmonic` from the equations at a point."""
    return SlavedHarmonic(e.lambda_2, e.Br, e.kappa_2, e.w_1)


@finite_result
def normal_form_at_infinite_pressure(p: Points) -> NormalForm:
    """The normal form a' = ... on the center manifold at the threshold, for delta_P -> infinity.

    v_p0 and delta_P of p are not used. At another pressure its nu is that of `eliminated`, and its
    nu_5 is not known. Raises InvalidInput without a threshold, or where D = beta = 0 (then no
    harmonic is slaved).
    """
    at = infinite_pressure(p.at_speed(critical_speed(p)))
    steady, equations = eliminated(at), cubic_equations(at)
    # b follows a with a delay: 2 m_2 a a' = 2 m_2 nu a^4 on the left of the b equation.
    delay = 2 * steady.m_2 * steady.nu / equations.lambda_2
    return replace(steady, m_4=steady.m_4 + delay, nu_5=steady.nu_5 + equations.A11 * delay)


@finite_result
def at_threshold(p: Points) -> NormalForm:
    """`eliminated` at the threshold of p, at its pressure; v_p0 of p is not used.

    Raises InvalidInput without a threshold, or where D = beta = 0.
    """
    return eliminated(p.at_speed(critical_speed(p)))


@finite_result
def eliminated(p: Points) -> NormalForm:
    """Harmonics 2 and 3 eliminated at rest (b' = d' = 0, resting shape), at v_p0 and delta_P of p.

    The zeros of lambda_1 a + nu a^3 + nu_5 a^5 are the steady states. Raises InvalidInput where
    harmonic 2 or 3 is at its own threshold.
    """
    cubic, e = cubic_equations(p), fifth_order(p)
    second = slaved(cubic)
    m_2, r_2 = second.at_rest(cubic.B2, cubic.Q2)
    third = SlavedHarmonic(e.lambda_3, e.Ds, e.kappa_3, cubic.w_1)
    m_3, r_3 = third.at_rest(
        e.D3 + e.D11 * m_2 + e.D1r * r_2, drive=e.S3 + e.S11 * m_2 + e.S1r * r_2
    )
    source = e.B4 + e.B21 * m_2 + e.B02 * m_2**2 + e.B101 * m_3
    source = source + (e.B2r + e.B01r * m_2 + e.Brr * r_2) * r_2 + e.B1s * r_3
    drive = e.Q4 + e.Q21 * m_2 + e.Q02 * m_2**2 + e.Q101 * m_3
    drive = drive + (e.Q2r + e.Q01r * m_2 + e.Qrr * r_2) * r_2 + e.Q1s * r_3
    m_4, r_4 = second.at_rest(source, drive, offset=SHAPE_SQUARED * r_2**2)
    direct = e.A5 + e.A31 * m_2 + e.A12 * m_2**2 + (e.A201 + e.A011 * m_2) * m_3
    by_shape = (e.A3r + e.A11r * m_2 + e.A1rr * r_2 + e.A001r * m_3 + e.Ars * r_3) * r_2
    by_shape = by_shape + (e.A2s + e.A01s * m_2) * r_3
    return NormalForm(
        v_p0=np.asarray(p.v_p0),
        m_2=m_2,
        m_3=m_3,
        m_4=m_4,
        r_2=r_2,
        r_3=r_3,
        r_4=r_4,
        nu=cubic.A3 + cubic.A11 * m_2 + cubic.A1r * r_2,
        nu_5=direct + by_shape + cubic.A11 * m_4 + cubic.A1r * r_4,
    )


@finite_result
def cubic_coefficient(p: Points) -> Array:
    """nu at the threshold and at delta_P of p [L^4/(T N^2)]; v_p0 of p is not used.

    Negative means supercritical. For `infinite_pressure(p)` it is SI `eq_non_linear_coefficient`
    times beta/c_r^2 and `eq_non_linear_coefficient_inv`. Raises InvalidInput without a threshold,
    or where D = beta = 0.
    """
    return cubic_coefficient_at_speed(p.at_speed(critical_speed(p)))


@finite_result
def cubic_coefficient_at_speed(p: Points) -> Array:
    """nu at v_p0 of p, with lambda_2 kept [L^4/(T N^2)]; equals `cubic_coefficient` at onset.

    Raises InvalidInput where harmonic 2 is at its own threshold.
    """
    return cubic_coefficient_of(cubic_equations(p))


def cubic_coefficient_of(e: CubicEquations) -> Array:
    """`cubic_coefficient_at_speed` from the equations at a point."""
    m_2, r_2 = slaved(e).at_rest(e.B2, e.Q2)
    return e.A3 + e.A11 * m_2 + e.A1r * r_2


def bifurcation(p: AnyPoints) -> Array:
    """ "supercritical" where nu < 0 at the threshold, else "subcritical"; main text `WNLA`.

    That of mode 1 at delta_P of p; below `critical_pressure` mode 2 goes unstable before it.
    """
    return kind_of(cubic_coefficient(p))


def kind_of(nu: Array) -> Array:
    """`bifurcation` from nu at the threshold."""
    return np.where(nu < 0, SUPERCRITICAL, SUBCRITICAL)
