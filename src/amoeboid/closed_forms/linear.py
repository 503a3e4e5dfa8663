"""Linear theory of the homogeneous sphere: growth rates, thresholds, finite pressure.

Notation: S = eta_s + eta_b, L = l(l+1), f_k the k-th derivative of the law at c0. An isotropic
stress tau(c) (elastic, active) acts as a polymerization speed of -R0 tau/(2S) would: flows follow
w(c) = v_p(c) - R0 tau(c)/(2S), the motion of the membrane v_p alone. Friction, Gamma = gamma_t +
gamma_c, slows the flow of every mode; that of mode l = 1, in which the cell moves as a whole, by
gamma_eff alone (docs/theory.md, docs/forces.md). Results
have the shape that all arguments broadcast to.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.modes import (
    SURROUNDINGS,
    base_tension,
    degree,
    density_slope,
    driving_derivatives,
    driving_slope,
    effective_friction,
    flow_response,
    held_pressure,
    mode_derivatives,
    push_share,
    refuse_nonlinear_friction,
    refuse_surroundings,
    shape_response,
    stress_derivatives,
    stress_slope,
)
from amoeboid.closed_forms.points import AnyPoints, Points, finite_result, points
from amoeboid.closed_forms.roots import roots_about
from amoeboid.model.polymerization import Exponential, Inverse
from amoeboid.validation import InvalidInput

__all__ = [
    "MAX_THRESHOLDS",
    "PROPORTIONAL",
    "SURROUNDINGS",
    "FirstMode",
    "Thresholds",
    "base_tension",
    "critical_pressure",
    "critical_slope",
    "critical_speed",
    "driving_derivatives",
    "driving_slope",
    "effective_friction",
    "finite_pressure_matrix",
    "finite_pressure_rates",
    "first_mode",
    "flow_response",
    "growth_rate",
    "held_pressure",
    "mode_derivatives",
    "mode_onsets",
    "proportional_to_speed",
    "push_share",
    "refuse_nonlinear_friction",
    "refuse_surroundings",
    "shape_response",
    "slowest_rate",
    "stress_derivatives",
    "stress_slope",
    "thresholds",
]

# A law that scales with v_p0 to this accuracy over the whole range of the root search has the
# threshold that the closed form gives, to the same accuracy.
PROPORTIONAL = 1e-12
MAX_THRESHOLDS = 100


@dataclass(frozen=True)
class Thresholds:
    """Every v_p0 > 0 at which a growth rate vanishes.

    v_p0: (n,) ascending [L/T]; onset: (n,) true where stability is lost as v_p0 grows, false
    where it is regained; reason: why there is none, empty otherwise.
    """

    v_p0: Array
    onset: Array
    reason: str


@dataclass(frozen=True)
class FirstMode:
    """The mode l that goes unstable first as v_p0 grows, and where [L/T]."""

    l: int
    v_p0: float


@finite_result
def growth_rate(p: Points, l: ArrayLike) -> Array:
    """Growth rate lambda_l of the homogeneous sphere [1/T]; SI `lambdal`, `lambdal_compress`.

    Exact for l = 1; for l >= 2 in the limit delta_P -> infinity. l broadcasts with the parameters.
    Raises InvalidInput unless l is a whole number >= 1.

    >>> import amoeboid as am
    >>> am.growth_rate(am.points(am.Parameters(D=0.4), v_p0=[5, 7]), l=1).round(4).tolist()
    [-0.3064, 0.2911]
    """
    L = degree(l)
    drive = L * flow_response(p, l) * p.c0 * mode_derivatives(p, l, 1)[1] / p.R0
    return -drive - L * p.D / p.R0**2 - p.beta


@finite_result
def critical_slope(p: Points, l: ArrayLike = 1) -> Array:
    """The slope of what drives mode l, at which lambda_l = 0 [L^3/(T N)]; needs c0 > 0.

    That is w_1 without friction of the cortex; see `mode_derivatives`. Raises InvalidInput where
    c0 = 0.
    """
    if np.any(np.asarray(p.c0) == 0):
        raise InvalidInput(
            "c0 must be > 0 for a threshold, got 0: without filaments nothing is advected"
        )
    L = degree(l)
    return -p.R0 * (L * p.D / p.R0**2 + p.beta) / (L * flow_response(p, l) * p.c0)


def thresholds(p: AnyPoints, l: int = 1) -> Thresholds:
    """Every v_p0 > 0 with lambda_l = 0, whatever the law; SI `vpc`, `vpc_inv`, `eq_vpc_compress`.

    p is a single point, its v_p0 is not used; l is the degree of the mode. Closed form if the law
    is proportional to v_p0, otherwise all roots in 16 decades about the natural scale (the lowest
    100 of a law that wiggles forever). The printed `eq_vpc_compress` lacks a factor 1/2
    (docs/errata.md). Raises InvalidInput where the law is not defined at c0.

    >>> import amoeboid as am
    >>> am.thresholds(am.Parameters(D=0.4)).v_p0.round(5).tolist()
    [6.02566]
    """
    p = _single(p)
    if p.c0 == 0:
        p.v_p_derivatives(p.c0, 1)
        return _none("c0 = 0: there are no filaments that the flow could carry")
    target = float(critical_slope(p, l) - stress_slope(p))
    if proportional_to_speed(p):
        slope = float(_speed_slope(p, l))
        if not slope * target > 0:
            return _none(_without_threshold(slope, target))
        return Thresholds(_representable(np.array([target / slope])), np.array([slope < 0]), "")
    scale = abs(target) * float(p.c_r) or float(p.v_p0) or 1.0
    roots = roots_about(lambda v: growth_rate(p.at_speed(v), l), scale)
    found = list(islice(roots, MAX_THRESHOLDS))
    if not found:
        return _none("lambda is never 0 for this law within 8 decades of its natural speed scale")
    return Thresholds(np.array(found), np.array([_rises(p, v, l) for v in found]), "")


def _without_threshold(slope: float, target: float) -> str:
    """Why slope v_p0 = target has no solution v_p0 > 0."""
    if target > 0:
        return "the isotropic stress by itself polarizes the cell at every v_p0"
    if slope >= 0:
        return "the law does not decrease with c at c0, so polymerization is stabilizing"
    return "D, beta and the slope of the stress are 0: nothing opposes polarization at any v_p0 > 0"


def critical_speed(p: AnyPoints, l: int = 1) -> Array:
    """Lowest v_p0 with lambda_l = 0 [L/T], broadcasting; SI `vpc`, `vpc_inv`, `eq_vpc_compress`.

    One closed form for all points if the law is proportional to v_p0. Raises InvalidInput, with
    the reason, if there is no threshold at some point.
    """
    p = points(p)
    if not proportional_to_speed(p):
        return np.reshape([_lowest(point, l) for point in p.flat()], p.shape)
    slope = _speed_slope(p, l)
    target = critical_slope(p, l) - stress_slope(p)
    absent = ~(np.broadcast_to(np.sign(slope) * np.sign(target), p.shape) > 0)
    if np.any(absent):
        _lowest(p.flat()[int(np.flatnonzero(absent)[0])], l)
    with np.errstate(all="ignore"):
        return _representable(target / slope)


def _speed_slope(p: Points, l: int) -> Array:
    """What a unit of v_p0 adds to the slope that drives mode l."""
    at = p.at_speed(1.0)
    return at.v_p_derivatives(p.c0, 1)[1] + (mode_derivatives(at, l, 1)[1] - driving_slope(at))


def proportional_to_speed(p: AnyPoints) -> bool:
    """Whether v_p(c0) and its slope are proportional to v_p0, as the paper's two laws are."""
    if isinstance(p.law, Exponential | Inverse):
        return True
    p = points(p)
    unit = np.array(p.at_speed(1.0).v_p_derivatives(p.c0, 1))
    for speed in 10.0 ** np.arange(-8, 9):
        try:
            scaled = np.array(p.at_speed(speed).v_p_derivatives(p.c0, 1)) / speed
        except InvalidInput:
            return False
        if np.any(np.abs(scaled - unit) > PROPORTIONAL * np.abs(unit)):
            return False
    return True


@finite_result
def finite_pressure_matrix(p: Points, l: ArrayLike) -> Array:
    """The matrix M (..., 2, 2) of d(c_l, rho_l)/dt = M (c_l, rho_l) for l >= 2 [1/T, c_l in N/L^2].

    Exact at any delta_P, with r = R0 (1 + rho_l P_l); generalizes SI `lambdal`, derived in
    docs/theory.md, with friction and bending in docs/forces.md. Raises InvalidInput unless l is a
    whole number >= 2.
    """
    L = degree(l, lowest=2)
    S = p.eta_s + p.eta_b
    f0, f1 = p.v_p_derivatives(p.c0, 1)
    g1, held = driving_slope(p), held_pressure(p, L)
    # friction along the surface as a share of the shear viscosity, and across
    along = (p.gamma_t + p.gamma_c) * p.R0**2 / p.eta_s
    across = (p.gamma_n + p.gamma_c) * p.R0**2 / (2 * S)
    slower = 1 + along / (L - 2)
    lever = ((L - 2) / S + L / (p.eta_s * slower)) * S / (L - 2)
    shape = 1 + across * lever / 2
    push = p.gamma_c * p.R0**2 * (f1 + density_slope(p) * f0) / (2 * S)
    M21 = (g1 + push * lever / 2) / p.R0 / shape
    treadmilling = f0 * (1 - along / 2) / slower
    M22 = -(treadmilling + held * p.R0**2 / 8 * (L / (p.eta_s * slower) + (L - 2) / S)) / p.R0
    M22 = M22 / shape
    M11 = -L * p.D / p.R0**2 - p.beta - 2 * p.c0 * g1 / p.R0
    M11 = M11 + p.c0 * (across * M21 - push / p.R0)
    M12 = p.c0 * (L - 2) / p.R0 * (held * p.R0**2 / (4 * S) - f0) + p.c0 * across * M22
    a, b, c, d = np.broadcast_arrays(M11, M12, M21, M22)
    return np.stack([np.stack([a, b], axis=-1), np.stack([c, d], axis=-1)], axis=-2)


@finite_result
def finite_pressure_rates(p: Points, l: ArrayLike) -> Array:
    """Its two eigenvalues [1/T], complex, shape (..., 2), the slower-decaying one first."""
    M = finite_pressure_matrix(p, l)
    m11, m12, m21, m22 = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    mean = (m11 + m22) / 2
    half_gap = np.sqrt(((m11 - m22) / 2) ** 2 + m12 * m21 + 0j)
    larger = mean + np.where(mean < 0, -1, 1) * half_gap
    # The product of the eigenvalues gives the small one without cancellation.
    determinant = m11 * m22 - m12 * m21
    real = half_gap.imag == 0
    smaller = np.where(
        real & (larger != 0), determinant / np.where(larger == 0, 1, larger), 2 * mean - larger
    )
    pair = np.stack([larger, smaller], axis=-1)
    slow_first = np.argsort(-pair.real, axis=-1, kind="stable")
    return np.take_along_axis(pair, slow_first, axis=-1)


@finite_result
def slowest_rate(p: Points, l: ArrayLike) -> Array:
    """Growth rate of mode l of the sphere at delta_P of p, which may be infinite [1/T].

    Of the two of a mode l >= 2 the real part of the one that decays slower or grows faster.
    """
    which = np.isfinite(p.delta_P) & (np.asarray(l) >= 2)
    if not np.any(which):
        return growth_rate(p, l)
    at = p if np.all(which) else p.at_pressure(np.where(np.isfinite(p.delta_P), p.delta_P, 0.0))
    free = finite_pressure_rates(at, np.maximum(l, 2))[..., 0].real
    return free if np.all(which) else np.where(which, free, growth_rate(p, l))


@finite_result
def critical_pressure(p: Points) -> Array:
    """delta_P*: below it mode 2 goes unstable before mode 1 [M/(L T^2)]; docs/theory.md.

    v_p0 is not used: the l = 1 threshold takes its place. 0 where mode 2 never leads, as with
    enough bending stiffness. Raises InvalidInput without a threshold, and where friction makes mode
    2 lead at every pressure.
    """
    at = p.at_speed(critical_speed(p))
    f0, f1 = at.v_p_derivatives(p.c0, 1)
    S = p.eta_s + p.eta_b
    # the determinant of `finite_pressure_matrix` for l = 2 is linear in `held_pressure`
    along = (p.gamma_t + p.gamma_c) * p.R0**2 / p.eta_s
    slower = 1 + along / 4
    lever = 1 + 3 * S / (2 * p.eta_s * slower)
    drive = -p.c0 * driving_slope(at) / p.R0
    push = p.c0 * p.gamma_c * p.R0 * (f1 + density_slope(p) * f0) / (2 * S)
    decay = 6 * p.D / p.R0**2 + p.beta - 2 * drive
    resisting = decay * lever / 2 + drive
    treadmilling = (1 - along / 2) / slower
    pulling = 4 * drive - 2 * push * lever - treadmilling * (decay + push)
    if np.any((resisting <= 0) & (pulling > 0)):
        raise InvalidInput(
            "mode 2 goes unstable first at every pressure with this friction (gamma_t, gamma_n, "
            "gamma_c): there is no delta_P* above which mode 1 does"
        )
    # Without diffusion and turnover the threshold rests on the stress alone; mode 2 never leads.
    held = np.where(
        resisting > 0, S * f0 * pulling / (p.R0**2 * np.where(resisting > 0, resisting, 1)), 0.0
    )
    return np.maximum(held - p.gamma_c * f0 - 12 * p.kappa / p.R0**3, 0.0)


def mode_onsets(p: AnyPoints, l_max: int = 6) -> dict[int, float]:
    """First v_p0 [L/T] at which each mode l = 1 .. l_max goes unstable at the given delta_P.

    0 where it grows without polymerization; modes that stay stable are left out. p is a single
    point; its v_p0 is not used.
    """
    p = _single(p)
    onsets = {}
    first = thresholds(p)
    if _is_positive(partial(_slowest, p, 1), 0.0):
        onsets[1] = 0.0
    elif np.any(first.onset):
        onsets[1] = float(first.v_p0[np.argmax(first.onset)])
    scale = onsets.get(1) or float(p.c_r) * float(p.beta * p.R0 + p.D / p.R0) or 1.0
    degrees = np.arange(2, l_max + 1)
    with suppress(InvalidInput):  # the law is not defined without polymerization
        onsets |= dict.fromkeys(degrees[_slowest(p, degrees, 0.0) > 0].tolist(), 0.0)
    for l in degrees.tolist():
        if l in onsets:
            continue
        rate = partial(_slowest, p, l)
        roots = islice(roots_about(rate, scale), MAX_THRESHOLDS)
        rising = next((v for v in roots if _is_positive(rate, v * (1 + 1e-6))), None)
        if rising is not None:
            onsets[l] = rising
    return onsets


def first_mode(p: AnyPoints, l_max: int = 6) -> FirstMode | None:
    """The mode among l = 1 .. l_max that goes unstable first, or None if none ever does."""
    onsets = mode_onsets(p, l_max)
    if not onsets:
        return None
    leading = min(onsets, key=lambda mode: onsets[mode])
    return FirstMode(leading, onsets[leading])


def _slowest(p: Points, l: ArrayLike, v_p0: ArrayLike) -> Array:
    return slowest_rate(p.at_speed(v_p0), l)


def _rises(p: Points, v: float, l: int) -> bool:
    return _is_positive(lambda v: growth_rate(p.at_speed(v), l), v * (1 + 1e-6))


def _is_positive(rate: Callable[[ArrayLike], Array], v: float) -> bool:
    """Whether the rate is positive at v; false where the law is not defined."""
    try:
        return bool(rate(v) > 0)
    except InvalidInput:
        return False


def _lowest(p: Points, l: int) -> float:
    found = thresholds(p, l)
    if found.reason:
        raise InvalidInput(f"no threshold: {found.reason}")
    return float(found.v_p0[0])


def _single(p: AnyPoints) -> Points:
    p = points(p)
    if p.shape != ():
        raise InvalidInput(
            f"a single parameter point is needed here, got points of shape {p.shape}"
        )
    return p


def _none(reason: str) -> Thresholds:
    return Thresholds(np.empty(0), np.empty(0, dtype=bool), reason)


def _representable(v: Array) -> Array:
    if not np.all(np.isfinite(v)):
        raise InvalidInput("the critical v_p0 exceeds double precision; bring c0/c_r nearer to 1")
    return v
