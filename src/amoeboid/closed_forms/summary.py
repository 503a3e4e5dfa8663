"""What the closed forms say about one parameter point, with the reasons for missing results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.amplitude import (
    cubic_coefficient,
    cubic_coefficient_of,
    kind_of,
    normal_form_at_infinite_pressure,
    slaved,
)
from amoeboid.closed_forms.branch import (
    Onset,
    Prediction,
    SteadyAmplitude,
    distance_from,
    flow_speed_at_threshold,
    onset,
    prediction_from,
    steady_amplitude,
)
from amoeboid.closed_forms.coupling import cubic_equations
from amoeboid.closed_forms.flow import Harmonics, rho_2
from amoeboid.closed_forms.linear import (
    FirstMode,
    Thresholds,
    base_tension,
    critical_pressure,
    critical_speed,
    finite_pressure_rates,
    first_mode,
    growth_rate,
    thresholds,
)
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.display import shown
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput

L_MAX = 6
NU = "L^4/(T N^2)"


@dataclass(frozen=True, kw_only=True)
class _Bifurcation:
    """What is known at the threshold itself."""

    v_p_critical: float
    nu: float
    m_2: float
    r_2: float
    bifurcation: str
    nu_infinite_pressure: float
    nu_5_infinite_pressure: float | None
    bifurcation_infinite_pressure: str
    delta_P_star: float | None


@dataclass(frozen=True, kw_only=True)
class Weakly(_Bifurcation):
    """What the amplitude equation says at a point that has a threshold.

    nu, m_2, r_2, the bifurcation and the prediction are those at the pressure of the cell. `state`
    and `max_retrograde_speed` are those of the cubic equation alone. What needs the next order
    (nu_5, prediction, trusted distance) is None with friction or bending, where it is not known;
    delta_P_star is None where mode 2 leads at every pressure.
    """

    state: SteadyAmplitude
    max_retrograde_speed: float
    prediction: Prediction | None
    rho_2: float | None
    trusted_distance: float | None


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Linear theory at the point, and the weakly nonlinear one where there is a threshold.

    growth_rates: {l: lambda_l} for delta_P -> infinity, l = 1 .. 6; finite_pressure_rates:
    {l: (slow, fast)}, complex, l = 2 .. 6. max_retrograde_speed is that of the stable state which
    small perturbations lead to: 0 where the homogeneous state is stable, None where the cubic
    theory has no stable state or does not reach. notes say what a reader must know about these
    numbers.
    """

    zeta0: float
    growth_rates: dict[int, float]
    finite_pressure_rates: dict[int, tuple[complex, complex]]
    first_mode: FirstMode | None
    thresholds: Thresholds
    weakly: Weakly | None
    max_retrograde_speed: float | None
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class _AtThreshold(_Bifurcation):
    """What `Weakly` says about the threshold, with notes, and why the error is not known, if so."""

    trusted_distance: float | None
    around: Onset | None
    notes: tuple[str, ...]
    no_estimate: str


def summary(p: Parameters) -> Summary:
    """The summary of one point. Raises InvalidInput where the law is not defined at c0."""
    (found,) = summaries(p, (p.v_p0,))
    return found


def summaries(p: Parameters, speeds: Iterable[float]) -> tuple[Summary, ...]:
    """The summaries at several v_p0; thresholds and what belongs to them are found once.

    `speeds`: the values of v_p0 [L/T]. Raises InvalidInput where the law is not defined at c0.
    """
    points = [p.replace(v_p0=v_p0) for v_p0 in speeds]
    growing = [growth_rate(q, np.arange(1, L_MAX + 1)) for q in points]
    found, first = thresholds(p), first_mode(p, L_MAX)
    threshold, notes = _at_threshold(p, found)
    return tuple(
        _summary(q, rates, found, first, threshold, notes)
        for q, rates in zip(points, growing, strict=True)
    )


def _summary(
    p: Parameters,
    rates: Array,
    found: Thresholds,
    first: FirstMode | None,
    threshold: _AtThreshold | None,
    notes: Sequence[str],
) -> Summary:
    growth_rates = {l: float(rate) for l, rate in enumerate(rates, start=1)}
    degrees = range(2, L_MAX + 1)
    pairs = finite_pressure_rates(p, np.array(degrees))
    finite = {
        l: (complex(slow), complex(fast)) for l, (slow, fast) in zip(degrees, pairs, strict=True)
    }
    growing = [l for l, (slow, _) in finite.items() if slow.real > 0]
    weakly, all_notes = None, [*notes]
    if threshold is not None:
        weakly, more = _weakly(p, threshold)
        all_notes += more
    all_notes += _first_mode_notes(p, first, found, weakly)
    speed, more = _speed(p.v_p0, growth_rates[1], growing, weakly)
    return Summary(
        zeta0=float(base_tension(p)),
        growth_rates=growth_rates,
        finite_pressure_rates=finite,
        first_mode=first,
        thresholds=found,
        weakly=weakly,
        max_retrograde_speed=speed,
        notes=(*all_notes, *more),
    )


def _at_threshold(p: Parameters, found: Thresholds) -> tuple[_AtThreshold | None, tuple[str, ...]]:
    """What does not depend on v_p0; None and the reason without an amplitude equation."""
    if found.reason:
        return None, (f"no threshold: {found.reason}",)
    at, rigid = p.replace(v_p0=float(critical_speed(p))), infinite_pressure(p)
    try:
        e = cubic_equations(at)
        m_2, r_2 = (float(value) for value in slaved(e).at_rest(e.B2, e.Q2))
        nu, rigid_nu = float(cubic_coefficient_of(e)), float(cubic_coefficient(rigid))
    except InvalidInput as error:
        return None, (f"no amplitude equation: {error}",)
    notes = []
    if found.v_p0.size > 1:
        notes.append("this law has several thresholds; nu and the flow refer to the lowest")
    kind, rigid_kind = str(kind_of(np.asarray(nu))), str(kind_of(np.asarray(rigid_nu)))
    if kind != rigid_kind:
        notes.append(
            f"the bifurcation is {kind} at this pressure and {rigid_kind} for delta_P -> infinity, "
            f"where nu is {shown(p.quantity(rigid_nu, NU))}"
        )
    star = None
    try:
        star = float(critical_pressure(p))
    except InvalidInput as error:
        notes.append(f"no delta_P*: {error}")
    nu_5, distance, around, no_estimate = None, None, None, ""
    try:
        nu_5 = float(normal_form_at_infinite_pressure(p).nu_5)
        around = onset(p)
        distance = float(distance_from(around))
    except InvalidInput as error:
        no_estimate = str(error)
    return (
        _AtThreshold(
            v_p_critical=at.v_p0,
            nu=nu,
            m_2=m_2,
            r_2=r_2,
            bifurcation=kind,
            nu_infinite_pressure=rigid_nu,
            nu_5_infinite_pressure=nu_5,
            bifurcation_infinite_pressure=rigid_kind,
            delta_P_star=star,
            trusted_distance=distance,
            around=around,
            notes=tuple(notes),
            no_estimate=no_estimate,
        ),
        (),
    )


def _weakly(p: Parameters, at: _AtThreshold) -> tuple[Weakly, list[str]]:
    """What the amplitude equation says at a v_p0, and notes."""
    notes = [*at.notes]
    nu_5, predicted, distance = at.nu_5_infinite_pressure, None, None
    try:
        if at.around is None:
            raise InvalidInput(at.no_estimate)
        predicted, distance = prediction_from(at.around, points(p)), at.trusted_distance
    except InvalidInput as error:
        notes.append(f"no error estimate: {error}")
    state = steady_amplitude(p) if predicted is None else predicted.state
    return (
        Weakly(
            v_p_critical=at.v_p_critical,
            nu=at.nu,
            m_2=at.m_2,
            r_2=at.r_2,
            bifurcation=at.bifurcation,
            nu_infinite_pressure=at.nu_infinite_pressure,
            nu_5_infinite_pressure=nu_5,
            bifurcation_infinite_pressure=at.bifurcation_infinite_pressure,
            delta_P_star=at.delta_P_star,
            state=state,
            max_retrograde_speed=float(flow_speed_at_threshold(p, state.amplitude)),
            prediction=predicted,
            rho_2=_rho_2(p, state, at.m_2),
            trusted_distance=distance,
        ),
        notes,
    )


def _first_mode_notes(
    p: Parameters, first: FirstMode | None, found: Thresholds, weakly: Weakly | None
) -> list[str]:
    """What follows where a mode l >= 2 goes unstable before mode 1, or alone."""
    if first is None or first.l == 1:
        return []
    state = "symmetric from front to rear" if first.l % 2 == 0 else "of another symmetry"
    own = shown(p.quantity(first.v_p0, "L/T"))
    before = "and mode 1 never does"
    if found.v_p0.size:
        before = f"before mode 1 at {shown(p.quantity(float(found.v_p0[0]), 'L/T'))}"
    notes = [
        f"mode l = {first.l} goes unstable first, at v_p0 = {own}, {before}: the first state is "
        f"deformed and {state}, not polarized; `amoeboid steady` computes it"
    ]
    if weakly is not None:
        notes.append(
            "nu and the bifurcation are those of the polarized branch, which leaves a sphere "
            "that is already unstable; small perturbations do not follow this branch"
        )
    return notes


def _rho_2(p: Parameters, state: SteadyAmplitude, m_2: float) -> float | None:
    """rho_2 of the polarized state, None where there is no such state or nothing holds a shape."""
    a = float(state.amplitude)
    try:
        found = rho_2(p, Harmonics(a=a, b=m_2 * a**2))
    except InvalidInput:
        return None
    return float(found) if state.exists else None


def _speed(
    v_p0: float, lambda_1: float, growing: list[int], weakly: Weakly | None
) -> tuple[float | None, list[str]]:
    """Speed of the state that small perturbations of the homogeneous one lead to."""
    others = "mode" + "s" * (len(growing) > 1) + " l = " + ", ".join(map(str, growing))
    if lambda_1 <= 0 and growing:
        return None, [
            f"the homogeneous state is stable against polarization, but {others} grow"
            + "s" * (len(growing) == 1)
            + ": `amoeboid steady` computes what follows"
        ]
    if lambda_1 <= 0:
        notes = ["the homogeneous state is stable: no flow"]
        if weakly is not None and weakly.state.exists:
            notes.append(
                "a polarization larger than that of the unstable state still grows"
                if weakly.prediction is not None and weakly.prediction.in_reach
                else "the cubic theory has an unstable polarized state, too far from the threshold "
                "to be trusted; `amoeboid steady` decides whether the cell has polarized states"
            )
        return 0.0, notes
    if weakly is None:
        return None, ["the homogeneous state polarizes; this theory does not give the amplitude"]
    if growing:
        return None, [
            f"{others} of the sphere grow" + "s" * (len(growing) == 1) + " at this pressure and "
            "v_p0 beside mode 1; the amplitude equation treats all modes but l = 1 as slaved and "
            "predicts no flow; `amoeboid steady` computes it"
        ]
    predicted = weakly.prediction
    if not weakly.state.stable:
        return None, [
            "the homogeneous state polarizes and the cubic theory has no stable state: it jumps "
            "to a large amplitude"
        ]
    if predicted is None or weakly.trusted_distance is None:
        return None, [
            "the range of the cubic theory is unknown with this friction or bending: `amoeboid "
            "steady` computes the flow"
        ]
    if not predicted.in_reach:
        return None, [
            "v_p0 is too far from the threshold for the cubic theory: the next order is far below "
            "it, or mode 2 is close to its own threshold; `amoeboid steady` computes the flow"
        ]
    times = abs(v_p0 - weakly.v_p_critical) / weakly.trusted_distance
    return float(predicted.max_retrograde_speed), _trust(predicted, times)


def _trust(predicted: Prediction, times: float) -> list[str]:
    """How far to trust a flow that is predicted, at `times` the trusted distance."""
    if not predicted.next_order.exists:
        return ["the next order has no such state; the predicted flow is not reliable"]
    if times <= 1:
        return []
    error = float(predicted.relative_error)
    off = f"its speed may be wrong by {error:.0%}" if error < 1 else "its error is unknown"
    return [
        f"the cubic theory is accurate to 10 % near the threshold, and v_p0 is {times:.3g} times "
        f"farther away: {off}; `amoeboid steady` computes it exactly"
    ]
