"""Normal form of the polarization close to the threshold, and the type of the bifurcation.

a is the amplitude of the first harmonic of c [N/L^2]; all coefficients are dimensional.
Valid for delta_P -> infinity, where the cell stays a sphere. Notation: docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from amoeboid.polymerization import Array
from amoeboid.theory.coupling import cubic_equations, fifth_order
from amoeboid.theory.linear import critical_speed
from amoeboid.theory.points import AnyPoints, Points, finite_result
from amoeboid.validation import InvalidInput

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"


@dataclass(frozen=True, kw_only=True)
class NormalForm:
    """a' = lambda_1 a + nu a^3 + nu_5 a^5 with b = m_2 a^2 + m_4 a^4 and d = m_3 a^3.

    v_p0 is where it is taken [L/T]; nu [L^4/(T N^2)], nu_5 [L^8/(T N^4)].
    """

    v_p0: Array
    m_2: Array
    m_3: Array
    m_4: Array
    nu: Array
    nu_5: Array


@finite_result
def normal_form(p: Points) -> NormalForm:
    """The normal form on the center manifold at the threshold, to fifth order.

    v_p0 of p is not used. Raises InvalidInput without a threshold, or where D = beta = 0 (then no
    harmonic is slaved).
    """
    at = p.at_speed(critical_speed(p))
    steady, equations = eliminated(at), cubic_equations(at)
    # b follows a with a delay: 2 m_2 a a' = 2 m_2 nu a^4 on the left of the b equation.
    delay = 2 * steady.m_2 * steady.nu / equations.lambda_2
    return replace(steady, m_4=steady.m_4 + delay, nu_5=steady.nu_5 + equations.A11 * delay)


@finite_result
def eliminated(p: Points) -> NormalForm:
    """Harmonics 2 and 3 eliminated at rest (b' = d' = 0) at v_p0 of p, with lambda_2 kept.

    Its zeros are the steady states. Raises InvalidInput where lambda_2 or lambda_3 is 0.
    """
    cubic, e = cubic_equations(p), fifth_order(p)
    m_2 = _slaved(cubic.B2, cubic.lambda_2, "lambda_2")
    m_3 = _slaved(e.D3 + e.D11 * m_2, e.lambda_3, "lambda_3")
    quartic = e.B4 + e.B21 * m_2 + e.B02 * m_2**2 + e.B101 * m_3
    m_4 = _slaved(quartic, cubic.lambda_2, "lambda_2")
    with_a3 = e.A31 * m_2 + e.A12 * m_2**2 + e.A201 * m_3
    return NormalForm(
        v_p0=np.asarray(p.v_p0),
        m_2=m_2,
        m_3=m_3,
        m_4=m_4,
        nu=cubic.A3 + cubic.A11 * m_2,
        nu_5=e.A5 + with_a3 + cubic.A11 * m_4 + e.A011 * m_2 * m_3,
    )


@finite_result
def cubic_coefficient(p: Points) -> Array:
    """nu at the threshold [L^4/(T N^2)]; SI `eq_non_linear_coefficient` times beta/c_r^2,
    `eq_non_linear_coefficient_inv`. v_p0 is not used; negative means supercritical.

    Raises InvalidInput without a threshold, or where D = beta = 0.
    """
    return cubic_coefficient_at_speed(p.at_speed(critical_speed(p)))


@finite_result
def cubic_coefficient_at_speed(p: Points) -> Array:
    """nu at v_p0 of p, with lambda_2 kept [L^4/(T N^2)]; equals `cubic_coefficient` at onset.

    Raises InvalidInput where lambda_2 is 0.
    """
    e = cubic_equations(p)
    return e.A3 + e.A11 * _slaved(e.B2, e.lambda_2, "lambda_2")


def bifurcation(p: AnyPoints) -> Array:
    """ "supercritical" where nu < 0 at the threshold, else "subcritical"; main text `WNLA`."""
    return np.where(cubic_coefficient(p) < 0, SUPERCRITICAL, SUBCRITICAL)


def _slaved(source: Array, rate: Array, name: str) -> Array:
    """Amplitude that a harmonic of this growth rate takes under a steady source."""
    if np.any(rate == 0):
        raise InvalidInput(
            f"{name} must differ from 0 to eliminate its harmonic; D and beta must not both be 0, "
            "nor may the harmonic be at its own threshold"
        )
    return -source / rate
