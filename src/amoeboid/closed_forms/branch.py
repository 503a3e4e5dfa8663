"""The branch of polarized steady states close to the threshold, and how far to trust it.

    v_p0 = v_p^c + v_2 a^2 + v_4 a^4 + ...

The paper keeps v_2 (its cubic amplitude equation, main text `WNLA`); v_4 tells where that stops
being good. All of it is at delta_P of the points; `infinite_pressure` (points.py) gives the rigid
sphere of the paper. Results have the shape that all arguments broadcast to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.amplitude import (
    NormalForm,
    at_threshold,
    cubic_coefficient_at_speed,
    cubic_coefficient_of,
    eliminated,
    second_harmonic,
    slaved,
)
from amoeboid.closed_forms.coupling import cubic_equations
from amoeboid.closed_forms.flow import Harmonics, max_retrograde_speed
from amoeboid.closed_forms.linear import (
    critical_pressure,
    critical_slope,
    critical_speed,
    flow_response,
    growth_rate,
    mode_derivatives,
    slowest_rate,
)
from amoeboid.closed_forms.points import AnyPoints, Points, finite_result

# Step, relative to v_p0, of the five-point differences: truncation ~ STEP^4, rounding ~ eps/STEP^2.
STEP = 1e-3
# Distances from the threshold, each half the one before, at which the orders are compared.
HALVINGS = 7
# Share of what the next order leaves out that counts for the error estimate, a factor of safety,
# and the estimate from which on the theory knows nothing. They were measured against steady states
# of the axisymmetric solver (tests/cross/test_theory_against_axisymmetric.py).
LEFT_OUT = 0.8
SAFETY = 1.06
# The weight of the second harmonic next to delta_P*, where it decays slowly, and how much of its
# change is too much there.
NEAR_CRITICAL = 4.0
MAX_CHANGE = 0.25
MAX_ESTIMATE = 0.6
# A cubic speed above this many times the next order's may be any multiple of the true one.
MAX_EXCESS = 1.5
# Modes of the sphere that must decay at the threshold for the polarized state to be stable.
OTHER_MODES = (2, 3, 4, 5, 6)


@dataclass(frozen=True, kw_only=True)
class BranchExpansion:
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
    third order. relative_error bounds |max_retrograde_speed/true - 1| where `in_reach` is true; it
    is 1 where the theory does not know. Where `in_reach` is false the speeds are no prediction:
    another mode of the sphere grows as well, mode 2 is close to it at a pressure not far above
    delta_P*, or the next order is far below the cubic one. All are 0 where `state.exists` is false.
    """

    state: SteadyAmplitude
    max_retrograde_speed: Array
    max_retrograde_speed_at_v_p0: Array
    next_order: SteadyAmplitude
    next_order_speed: Array
    relative_error: Array
    in_reach: Array


@finite_result
def branch(p: Points) -> BranchExpansion:
    """The branch to fourth order in a, for any law; v_p0 of p is not used.

    The derivatives with respect to v_p0 are five-point differences. Raises InvalidInput without a
    threshold.
    """
    return onset(p).branch


@finite_result
def steady_amplitude(p: Points) -> SteadyAmplitude:
    """Amplitude of the polarized steady state, a^2 = -lambda_1/nu with nu at the threshold.

    Main text `WNLA`. It exists above a supercritical threshold and below a subcritical one (there
    it is unstable, the barrier to the polarized state). Above the threshold it is stable unless
    another mode of the sphere grows there already.
    """
    at = p.at_speed(critical_speed(p))
    nu = cubic_coefficient_at_speed(at)
    return _cubic_state(p, nu, (nu < 0) & _others_decay(at))


@finite_result
def next_steady_amplitude(p: Points) -> SteadyAmplitude:
    """The same state to next order: a^2 solves v_2 a^2 + v_4 a^4 = v_p0 - v_p^c.

    The root that continues the cubic one; where there is none, `exists` is false.
    """
    return _next_state(p, onset(p))


@finite_result
def trusted_distance(p: Points, tolerance: float = 0.1) -> Array:
    """How far from v_p^c the cubic amplitude is good to `tolerance`, relatively [L/T].

    |v_p0 - v_p^c| < 2 tolerance v_2^2/|v_4|: there the next order changes a by `tolerance`. Also,
    where v_4 is small by chance, the decay rate of the second harmonic changes by less than
    sqrt(tolerance).
    """
    return distance_from(onset(p), tolerance)


def distance_from(at: Onset, tolerance: float = 0.1) -> Array:
    """`trusted_distance` [L/T] for a `tolerance`, from what is known about the threshold."""
    b = at.branch
    by_next_order = np.divide(2 * tolerance * b.v_2**2, np.abs(b.v_4))
    by_harmonic = np.sqrt(tolerance) * np.abs(np.divide(at.second_rate, at.second_slope))
    return np.fmin(by_next_order, by_harmonic)


@finite_result
def flow_speed(p: Points, amplitude: ArrayLike) -> Array:
    """Leading-order maximal retrograde speed with the prefactor at v_p0 [L/T]; SI `eq_v0_epsilon`.

    The paper's exponential branch (figure 3) uses this one.
    """
    slope = flow_response(p, 1) * mode_derivatives(p, 1, 1)[1]
    return np.abs(slope) * np.asarray(amplitude)


@finite_result
def flow_speed_at_threshold(p: Points, amplitude: ArrayLike) -> Array:
    """The same with the prefactor at the threshold, (D/R0 + beta R0/2) a/c0 [L/T]; SI
    `eq_vMig_inv`.

    The consistent leading order, the same for every law; the paper uses it for the inverse law and
    for its 0.17 um/s.
    """
    return np.abs(flow_response(p, 1) * critical_slope(p)) * np.asarray(amplitude)


def harmonics(p: AnyPoints, amplitude: ArrayLike) -> Harmonics:
    """The harmonics that a polarization of an amplitude carries, to leading order (docs/theory.md).

    a, m_2 a^2, m_3 a^3 [N/L^2], and those of the shape, r_2 a^2, r_3 a^3 [1].
    """
    return _carried(at_threshold(p), np.asarray(amplitude, dtype=float))


@finite_result
def prediction(p: Points) -> Prediction:
    """Polarized state at v_p0 by the cubic theory, with an estimate of its error; broadcasts.

    Raises InvalidInput without a threshold, and with friction or bending, with which the next order
    is not known.

    >>> import amoeboid as am
    >>> found = am.prediction(am.Parameters(v_p0=3.58))
    >>> f"{found.max_retrograde_speed:.3f}, error about {found.relative_error:.0%}"
    '0.152, error about 17%'
    """
    return prediction_from(onset(p), p)


def prediction_from(onset: Onset, p: Points) -> Prediction:
    """`prediction` from what is known about the threshold."""
    cubic = _cubic_state(p, onset.form.nu, onset.stable)
    following = _next_state(p, onset)
    speed = flow_speed_at_threshold(p, cubic.amplitude)
    next_speed = max_retrograde_speed(p, _carried(onset.form, following.amplitude))
    estimate, excess = _on_the_way(p, onset)
    excessive = (estimate >= MAX_ESTIMATE) & (excess > MAX_EXCESS)
    # an unstable state that the next order does not have is none of the cell
    confirmed = following.exists | cubic.stable | ~cubic.exists
    near = onset.nearness * _change(p, onset) < MAX_CHANGE
    reached = confirmed & near & ~excessive & _others_decay(p)
    return Prediction(
        state=cubic,
        max_retrograde_speed=speed,
        max_retrograde_speed_at_v_p0=flow_speed(p, cubic.amplitude),
        next_order=following,
        next_order_speed=next_speed,
        relative_error=np.where(estimate < MAX_ESTIMATE, estimate, np.where(cubic.exists, 1.0, 0)),
        in_reach=reached,
    )


@dataclass(frozen=True, kw_only=True)
class Onset:
    """What the threshold and its neighborhood say: found once, used at every v_p0.

    second_rate, second_slope: the rate at rest of harmonic 2 [1/T], and its derivative with respect
    to v_p0; nearness: delta_P*/delta_P, 1 at most;
    stable: the branch starts upwards, stable.
    """

    branch: BranchExpansion
    form: NormalForm
    second_rate: Array
    second_slope: Array
    nearness: Array
    stable: Array


@finite_result
def onset(p: Points) -> Onset:
    """What `prediction` and `trusted_distance` need of the threshold; v_p0 of p is not used."""
    at = p.at_speed(critical_speed(p))
    form = eliminated(at)
    e = cubic_equations(_at_five_speeds(at))
    slope, curvature = _speed_derivatives(e.lambda_1, at)
    nu_slope, _ = _speed_derivatives(cubic_coefficient_of(e), at)
    second_slope, _ = _speed_derivatives(slaved(e).rate_at_rest, at)
    v_2 = -form.nu / slope
    v_4 = -(form.nu_5 + nu_slope * v_2 + curvature * v_2**2 / 2) / slope
    star = critical_pressure(p)
    return Onset(
        branch=BranchExpansion(v_p_critical=at.v_p0, v_2=v_2, v_4=v_4),
        form=form,
        second_rate=second_harmonic(at).rate_at_rest,
        second_slope=second_slope,
        nearness=_ratio(star, np.maximum(star, p.delta_P)),
        stable=(form.nu < 0) & _others_decay(at),
    )


def _cubic_state(p: Points, nu: Array, stable: Array) -> SteadyAmplitude:
    squared = _ratio(-growth_rate(p, 1), nu)
    exists = squared > 0
    amplitude = np.sqrt(np.where(exists, squared, 0.0))
    return SteadyAmplitude(amplitude=amplitude, exists=exists, stable=exists & stable)


def _next_state(p: Points, onset: Onset) -> SteadyAmplitude:
    b = onset.branch
    distance = p.v_p0 - b.v_p_critical
    discriminant = b.v_2**2 + 4 * b.v_4 * distance
    root = np.sqrt(np.where(discriminant >= 0, discriminant, 0.0))
    squared = _ratio(2 * distance, b.v_2 + np.copysign(root, b.v_2))
    exists = (discriminant >= 0) & (squared > 0)
    amplitude = np.sqrt(np.where(exists, squared, 0.0))
    return SteadyAmplitude(amplitude=amplitude, exists=exists, stable=exists & onset.stable)


def _carried(form: NormalForm, a: Array) -> Harmonics:
    return Harmonics(
        a=a,
        b=form.m_2 * a**2,
        d=form.m_3 * a**3,
        rho_2=form.r_2 * a**2,
        rho_3=form.r_3 * a**3,
    )


def _others_decay(p: Points) -> Array:
    """Whether every mode of the sphere but the first decays."""
    return np.all(slowest_rate(p, _first_axis(np.array(OTHER_MODES), p)) < 0, axis=0)


def _on_the_way(p: Points, onset: Onset) -> tuple[Array, Array]:
    """Largest `_judged` at geometrically spaced distances from the threshold up to that of p.

    Cubic and next order may cross farther out, which is no sign of accuracy.
    """
    critical = onset.branch.v_p_critical
    shares = _first_axis(2.0 ** -np.arange(HALVINGS), p)
    estimates, excesses = _judged(p.at_speed(critical + shares * (p.v_p0 - critical)), onset)
    return np.max(estimates, axis=0), np.max(excesses, axis=0)


def _judged(p: Points, onset: Onset) -> tuple[Array, Array]:
    """Estimated relative error of the cubic speed, and its ratio to that of the next order.

    The error is the distance from the next order, and what that leaves out: the third harmonic, the
    flow beyond the first, and that the second harmonic decays slower the farther the threshold is.
    """
    cubic = _cubic_state(p, onset.form.nu, onset.stable)
    following = _next_state(p, onset)
    carried = _carried(onset.form, following.amplitude)
    next_speed = max_retrograde_speed(p, carried)
    leading = flow_speed_at_threshold(p, following.amplitude)
    ratio = _ratio(flow_speed_at_threshold(p, cubic.amplitude), next_speed)
    third = np.abs(_ratio(np.asarray(carried.d), following.amplitude))
    beyond = np.abs(_ratio(next_speed - leading, leading))
    change = _change(p, onset)
    left_out = third + beyond + change**2 + NEAR_CRITICAL * onset.nearness * change
    estimate = SAFETY * np.hypot(ratio - 1, LEFT_OUT * left_out)
    estimate = np.where(following.exists, estimate, 1.0)
    return np.where(cubic.exists, estimate, 0.0), ratio


def _change(p: Points, onset: Onset) -> Array:
    """Relative change of the decay rate of harmonic 2 since the threshold."""
    return np.abs(second_harmonic(p).rate_at_rest / onset.second_rate - 1)


def _speed_derivatives(values: Array, p: Points) -> tuple[Array, Array]:
    """First and second derivative with respect to v_p0, from the values `_at_five_speeds`."""
    h = STEP * p.v_p0
    low2, low, mid, high, high2 = np.broadcast_to(values, (5, *p.shape))
    first = (low2 - 8 * low + 8 * high - high2) / (12 * h)
    second = (-low2 + 16 * low - 30 * mid + 16 * high - high2) / (12 * h**2)
    return first, second


def _at_five_speeds(p: Points) -> Points:
    """The points at five speeds about their own, along a first axis of its own."""
    return p.at_speed(p.v_p0 + _first_axis(np.arange(-2, 3), p) * (STEP * p.v_p0))


def _first_axis(values: Array, p: Points) -> Array:
    """Values (n,) along an axis before those of the points."""
    return values.reshape(-1, *[1] * len(p.shape))


def _ratio(a: Array, b: Array) -> Array:
    """a/b, and 0 where b is 0 (no finite amplitude there)."""
    zero = b == 0
    return np.where(zero, 0.0, a / np.where(zero, 1.0, b))
