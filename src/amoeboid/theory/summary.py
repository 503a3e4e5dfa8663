"""What the closed forms say about one parameter point, with reasons where they say nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.parameters import Parameters
from amoeboid.theory.amplitude import bifurcation, normal_form_at_infinite_pressure
from amoeboid.theory.branch import Prediction, harmonics, prediction, trusted_distance
from amoeboid.theory.flow import rho_2
from amoeboid.theory.linear import (
    FirstMode,
    Thresholds,
    base_tension,
    critical_pressure,
    finite_pressure_rates,
    first_mode,
    growth_rate,
    thresholds,
)
from amoeboid.validation import InvalidInput

L_MAX = 6


@dataclass(frozen=True, kw_only=True)
class Weakly:
    """What the amplitude equation says at a point that has a threshold."""

    v_p_critical: float
    nu: float
    nu_5: float
    bifurcation: str
    delta_P_star: float
    prediction: Prediction
    rho_2: float | None
    trusted_distance: float


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Linear theory at the point, and the weakly nonlinear one where there is a threshold.

    growth_rates: {l: lambda_l} for delta_P -> infinity, l = 1 .. 6; finite_pressure_rates:
    {l: (slow, fast)}, complex, l = 2 .. 6. max_retrograde_speed is that of the stable state which
    small perturbations lead to: 0 where the homogeneous state is stable, None where the cubic
    theory has no stable state. notes say what a reader must know about these numbers.
    """

    zeta0: float
    growth_rates: dict[int, float]
    finite_pressure_rates: dict[int, tuple[complex, complex]]
    first_mode: FirstMode | None
    thresholds: Thresholds
    weakly: Weakly | None
    max_retrograde_speed: float | None
    notes: tuple[str, ...]


def summary(p: Parameters) -> Summary:
    """The summary of one point. Raises InvalidInput where the law is not defined at c0."""
    rates = growth_rate(p, np.arange(1, L_MAX + 1))
    growth_rates = {l: float(rate) for l, rate in enumerate(rates, start=1)}
    finite = {
        l: (complex(slow), complex(fast))
        for l in range(2, L_MAX + 1)
        for slow, fast in [finite_pressure_rates(p, l)]
    }
    found = thresholds(p)
    weakly, notes = _weakly(p, found)
    speed, more = _speed(p.v_p0, growth_rates[1], weakly)
    unstable = [str(l) for l, (slow, _) in finite.items() if slow.real > 0]
    if unstable:
        notes.append(
            f"modes l = {', '.join(unstable)} are unstable at this pressure; the "
            "amplitude equation takes them for slaved"
        )
    return Summary(
        zeta0=float(base_tension(p)),
        growth_rates=growth_rates,
        finite_pressure_rates=finite,
        first_mode=first_mode(p, L_MAX),
        thresholds=found,
        weakly=weakly,
        max_retrograde_speed=speed,
        notes=(*notes, *more),
    )


def _weakly(p: Parameters, found: Thresholds) -> tuple[Weakly | None, list[str]]:
    if found.reason:
        return None, [f"no threshold: {found.reason}"]
    try:
        form, predicted = normal_form_at_infinite_pressure(p), prediction(p)
    except InvalidInput as error:
        return None, [f"no amplitude equation: {error}"]
    notes = []
    if found.v_p0.size > 1:
        notes.append("this law has several thresholds; nu and the flow belong to the lowest")
    return (
        Weakly(
            v_p_critical=float(form.v_p0),
            nu=float(form.nu),
            nu_5=float(form.nu_5),
            bifurcation=str(bifurcation(p)),
            delta_P_star=float(critical_pressure(p)),
            prediction=predicted,
            rho_2=_rho_2(p, predicted),
            trusted_distance=float(trusted_distance(p)),
        ),
        notes,
    )


def _rho_2(p: Parameters, predicted: Prediction) -> float | None:
    """rho_2 of the polarized state, None where there is no such state or nothing holds a shape."""
    try:
        found = rho_2(p, harmonics(p, predicted.state.amplitude))
    except InvalidInput:
        return None
    return float(found) if predicted.state.exists else None


def _speed(v_p0: float, lambda_1: float, weakly: Weakly | None) -> tuple[float | None, list[str]]:
    """Speed of the state that small perturbations of the homogeneous one lead to."""
    if lambda_1 <= 0:
        notes = ["the homogeneous state is stable against polarization: no flow"]
        if weakly is not None and weakly.prediction.state.exists:
            notes.append(
                "a polarization above the amplitude of the unstable state grows nevertheless"
            )
        return 0.0, notes
    if weakly is None:
        return None, ["the homogeneous state polarizes; the amplitude is beyond this theory"]
    predicted = weakly.prediction
    distance = abs(v_p0 - weakly.v_p_critical)
    if not predicted.state.stable:
        return None, [
            "the homogeneous state polarizes and the cubic theory has no stable state: it jumps to "
            "a large amplitude"
        ]
    notes = []
    if not predicted.next_order.exists:
        notes.append("the next order has no such state: do not trust the predicted flow")
    elif distance > weakly.trusted_distance:
        times = distance / weakly.trusted_distance
        notes.append(
            f"v_p0 is {times:.3g} times farther from the threshold than the cubic theory is good "
            f"to 10 %: its speed may be off by {float(predicted.relative_error):.0%}, "
            "`amoeboid steady` computes it exactly"
        )
    return float(predicted.max_retrograde_speed), notes
