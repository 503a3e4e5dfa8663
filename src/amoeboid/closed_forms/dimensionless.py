"""The paper's dimensionless numbers (the barred symbols); all need beta > 0.

They are defined in docs/notation.md, and have the shape of the points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.points import AnyPoints, Points, finite_result, points
from amoeboid.validation import InvalidInput


@dataclass(frozen=True, kw_only=True)
class Dimensionless:
    """SI `eq_dimless_params_2`: c0/c_r, D/(R0^2 beta), v_p(c0)/(R0 beta), and the pressure number.

    The pressure number delta_P R0/(eta_s beta) is not in the paper; it sets how much the cell
    deforms.
    """

    c0: Array
    D: Array
    v_p: Array
    delta_P: Array


def dimensionless(p: AnyPoints) -> Dimensionless:
    """The dimensionless numbers of some points. Raises InvalidInput where beta = 0."""
    at = _turning_over(p)
    f0 = at.v_p(at.c0)
    return Dimensionless(
        c0=at.c0 / at.c_r,
        D=at.D / (at.R0**2 * at.beta),
        v_p=f0 / (at.R0 * at.beta),
        delta_P=at.delta_P * at.R0 / (at.eta_s * at.beta),
    )


@finite_result
def viscosity_ratio(p: Points) -> Array:
    """eta_s/eta_b [1]; SI `eq_dimless_params_2`. Raises InvalidInput where eta_b = 0."""
    if np.any(p.eta_b == 0):
        raise InvalidInput("eta_b must be > 0 for the ratio eta_s/eta_b, got 0")
    return p.eta_s / p.eta_b


@finite_result
def dimensionless_cubic_coefficient(p: Points) -> Array:
    """The nu that the SI prints, c_r^2 nu/beta [1]; `eq_non_linear_coefficient`.

    Raises InvalidInput where beta = 0 (use `cubic_coefficient`) or without a threshold.
    """
    at = _turning_over(p)
    return at.c_r**2 * cubic_coefficient(at) / at.beta


def _turning_over(p: AnyPoints) -> Points:
    at = points(p)
    if np.any(at.beta == 0):
        raise InvalidInput(
            "beta must be > 0 for the dimensionless numbers of the paper, got 0, and they divide "
            "by it; use the dimensional quantities"
        )
    return at
