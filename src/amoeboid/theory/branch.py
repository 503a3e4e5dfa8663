"""The branch of polarized steady states close to the threshold, and how far to trust it.

    v_p0 = v_p^c + v_2 a^2 + v_4 a^4 + ...

The paper keeps v_2 (its cubic amplitude equation); v_4 tells where that stops being good.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.polymerization import Array
from amoeboid.theory.amplitude import (
    at_threshold,
    cubic_coefficient,
    cubic_coefficient_at_speed,
    eliminated,
)
from amoeboid.theory.flow import Harmonics, max_retrograde_speed
from amoeboid.theory.linear import critical_slope, critical_speed, driving_slope, growth_rate
from amoeboid.theory.points import AnyPoints, Points, finite_result

# Step, relative to v_p0, of the five-point differences: truncation ~ STEP^4, rounding ~ eps/STEP^2.
STEP = 1e-3
# Distances from the threshold, each half the one before, at which the orders are compared.
HALVINGS = 7


@dataclass(frozen=True, kw_only=True)
class Branch:
    """v_p0 = v_p_critical + v_2 a^2 + v_4 a^4 [L/T]; a in [N/L^2]."""

    v_p_critical: Array
    v_2: Array
    v_4: Array


@dataclass(frozen=True, kw_only=True)
class SteadyAmplitude:
    """Polarized steady states: amplitude [N/L^2], 0 where `exists` is false; `stable` or not."""

    amplitude: Array
    exists: Array
    stable: Array


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """What the cubic theory predicts at v_p0, beside the next order.

    max_retrograde_speed [L/T] has the prefactor at the threshold, max_retrograde_speed_at_v_p0 the
    one at v_p0 (figure 3A, B of the paper). next_order_speed [L/T] comes from v_4 and the flow to
    third order. relative_error estimates that of the cubic speed: the largest relative distance
    from the next order on the way there from the threshold (the two curves may cross farther out,
    which is no sign of accuracy), 1 where the next order has no such state. All are 0 where
    `state.exists` is false.
    """

    state: SteadyAmplitude
    max_retrograde_speed: Array
    max_retrograde_speed_at_v_p0: Array
    next_order: SteadyAmplitude
    next_order_speed: Array
    relative_error: Array


@finite_result
def branch(p: Points) -> Branch:
    """The branch to fourth order in a, for any law; v_p0 of p is not used.

    The derivatives with respect to v_p0 are five-point differences. Raises InvalidInput without a
    threshold.
    """
    at = p.at_speed(critical_speed(p))
    steady = eliminated(at)
    slope, curvature = _speed_derivatives(lambda q: growth_rate(q, 1), at)
    nu_slope, _ = _speed_derivatives(cubic_coefficient_at_speed, at)
    v_2 = -steady.nu / slope
    v_4 = -(steady.nu_5 + nu_slope * v_2 + curvature * v_2**2 / 2) / slope
    return Branch(v_p_critical=at.v_p0, v_2=v_2, v_4=v_4)


@finite_result
def steady_amplitude(p: Points) -> SteadyAmplitude:
    """Amplitude of the polarized steady state, a^2 = -lambda_1/nu with nu at the threshold.

    Main text `WNLA`. It exists above a supercritical threshold (stable) and below a subcritical
    one (unstable, the barrier to the polarized state).
    """
    nu = cubic_coefficient(p)
    squared = _ratio(-growth_rate(p, 1), nu)
    exists = squared > 0
    amplitude = np.sqrt(np.where(exists, squared, 0.0))
    return SteadyAmplitude(amplitude=amplitude, exists=exists, stable=exists & (nu < 0))


@finite_result
def next_steady_amplitude(p: Points) -> SteadyAmplitude:
    """The same state to next order: a^2 solves v_2 a^2 + v_4 a^4 = v_p0 - v_p^c.

    The root that continues the cubic one; where there is none, `exists` is false.
    """
    b = branch(p)
    distance = p.v_p0 - b.v_p_critical
    discriminant = b.v_2**2 + 4 * b.v_4 * distance
    root = np.sqrt(np.where(discriminant >= 0, discriminant, 0.0))
    squared = _ratio(2 * distance, b.v_2 + np.copysign(root, b.v_2))
    exists = (discriminant >= 0) & (squared > 0)
    amplitude = np.sqrt(np.where(exists, squared, 0.0))
    return SteadyAmplitude(
        amplitude=amplitude, exists=exists, stable=exists & (cubic_coefficient(p) < 0)
    )


@finite_result
def trusted_distance(p: Points, tolerance: float = 0.1) -> Array:
    """How far from v_p^c the cubic amplitude is good to `tolerance`, relatively [L/T].

    |v_p0 - v_p^c| < 2 tolerance v_2^2/|v_4|: there the next order changes a by `tolerance`.
    """
    b = branch(p)
    return np.divide(2 * tolerance * b.v_2**2, np.abs(b.v_4))


@finite_result
def flow_speed(p: Points, amplitude: ArrayLike) -> Array:
    """Leading-order maximal retrograde speed with the prefactor at v_p0 [L/T]; SI `eq_v0_epsilon`.

    The paper's exponential branch (figure 3) uses this one.
    """
    return np.abs(driving_slope(p)) * np.asarray(amplitude)


@finite_result
def flow_speed_at_threshold(p: Points, amplitude: ArrayLike) -> Array:
    """The same with the prefactor at the threshold, (D/R0 + beta R0/2) a/c0 [L/T]; `eq_vMig_inv`.

    The consistent leading order, the same for every law; the paper uses it for the inverse law and
    for its 0.17 um/s.
    """
    return np.abs(critical_slope(p)) * np.asarray(amplitude)


def harmonics(p: AnyPoints, amplitude: ArrayLike) -> Harmonics:
    """The harmonics that a polarization of this amplitude carries, at leading order.

    a, m_2 a^2, m_3 a^3 [N/L^2], and those of the shape, r_2 a^2, r_3 a^3 [1].
    """
    form = at_threshold(p)
    a = np.asarray(amplitude, dtype=float)
    return Harmonics(
        a=a,
        b=form.m_2 * a**2,
        d=form.m_3 * a**3,
        rho_2=form.r_2 * a**2,
        rho_3=form.r_3 * a**3,
    )


@finite_result
def prediction(p: Points) -> Prediction:
    """Polarized state at v_p0 by the cubic theory, with an estimate of its error; broadcasts.

    Raises InvalidInput without a threshold.
    """
    cubic, following = steady_amplitude(p), next_steady_amplitude(p)
    speed = flow_speed_at_threshold(p, cubic.amplitude)
    next_speed = max_retrograde_speed(p, harmonics(p, following.amplitude))
    return Prediction(
        state=cubic,
        max_retrograde_speed=speed,
        max_retrograde_speed_at_v_p0=flow_speed(p, cubic.amplitude),
        next_order=following,
        next_order_speed=next_speed,
        relative_error=_largest_disagreement(p),
    )


def _largest_disagreement(p: Points) -> Array:
    """Of the cubic speed with the next order, at geometrically spaced distances up to that of p."""
    critical = critical_speed(p)
    distances = (2.0**-k * (p.v_p0 - critical) for k in range(HALVINGS))
    return np.max([_disagreement(p.at_speed(critical + d)) for d in distances], axis=0)


def _disagreement(p: Points) -> Array:
    cubic, following = steady_amplitude(p), next_steady_amplitude(p)
    speed = flow_speed_at_threshold(p, cubic.amplitude)
    next_speed = max_retrograde_speed(p, harmonics(p, following.amplitude))
    change = np.abs(_ratio(next_speed - speed, speed))
    return np.where(cubic.exists & ~following.exists, 1.0, change)


def _speed_derivatives(quantity: Callable[[Points], Array], p: Points) -> tuple[Array, Array]:
    """First and second derivative with respect to v_p0, by five-point differences."""
    h = STEP * p.v_p0
    low2, low, mid, high, high2 = (quantity(p.at_speed(p.v_p0 + k * h)) for k in (-2, -1, 0, 1, 2))
    first = (low2 - 8 * low + 8 * high - high2) / (12 * h)
    second = (-low2 + 16 * low - 30 * mid + 16 * high - high2) / (12 * h**2)
    return first, second


def _ratio(a: Array, b: Array) -> Array:
    """a/b, and 0 where b is 0 (no finite amplitude there)."""
    zero = b == 0
    return np.where(zero, 0.0, a / np.where(zero, 1.0, b))
