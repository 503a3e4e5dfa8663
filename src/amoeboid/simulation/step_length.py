"""One step of a run: its length, by the estimate of its error, and what is known of its state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.config import SHORTEST_STEP
from amoeboid.numerics.sparse import SingularMatrix
from amoeboid.sections import Time
from amoeboid.simulation.changes import after_break, awaited, landed, next_stop
from amoeboid.simulation.finish import solved_for
from amoeboid.simulation.step import Step
from amoeboid.surface.explicit import explicit_step
from amoeboid.surface.model import Model
from amoeboid.surface.noise import noisy_past
from amoeboid.surface.remeshing import due, remeshed
from amoeboid.surface.stability import leading_growth_rate
from amoeboid.surface.state import Flow, State
from amoeboid.surface.steadiness import CHANGED, STEADY, Rest, relative_rate
from amoeboid.surface.stepping import StepFailed, semi_implicit_step, starting_step
from amoeboid.validation import InvalidInput

# Length of the start on a new mesh as a share of the step before it, which was of higher order.
START_AGAIN = 0.3
KEPT = 3  # states that a step and its error estimate are made from
SAFETY, MAX_STEP_FACTOR, MIN_STEP_FACTOR = 0.9, 2.0, 0.3
# BDF2 is stable if no step is longer than 1 + sqrt(2) times the one before.
STABLE_GROWTH = 2.4


class Diverged(ArithmeticError):
    """The run cannot continue; the steps yielded before it are good."""


def next_step(step: Step, time: Time) -> Step:
    """The step after `step`, of the scheme that is asked for.

    Raises Diverged if none, however short, can be made.
    """
    if time.scheme == "explicit":
        return _explicit(step, time)
    if step.model.noise is not None:
        return _noisy(step, time)
    new = _semi_implicit(step, time)
    solves = time.stop_when_steady and time.finish == "solve"
    return (solved_for(step, new) if solves else None) or new


def _explicit(step: Step, time: Time) -> Step:
    """One step of the paper's algorithm, whose length is given."""
    model, stop = step.model, next_stop(step.model, step.state.t, time.end)
    remaining = stop - step.state.t
    length = remaining if time.max_step > 0.999 * remaining else time.max_step
    try:
        state, flow = explicit_step(model, step.state, length, step.flow)
        state = landed(state, stop, length == remaining)
    except (StepFailed, InvalidInput) as error:
        raise Diverged(f"{_place(step)}: {error}") from None
    return _accepted(step, model, (state, step.state), flow, time.max_step, 0)


def _semi_implicit(step: Step, time: Time) -> Step:
    """One accepted step; its length follows from the error estimate."""
    begun = _begun(step)
    model, past, stop = begun.model, begun.past, next_stop(step.model, step.state.t, time.end)
    dt = min(_next_length(step) if begun.smooth else step.next_dt, time.max_step)
    rejected = step.rejected
    if not begun.goes_on:
        dt *= START_AGAIN
    why = "the flow changes faster than any step can follow"
    while dt > SHORTEST_STEP / model.rate:
        length, lands = _to_stop(dt, stop - past[0].t)
        try:
            state, flow, error = _tried(model, past, length, begun.flow, time.tolerance)
            state = landed(state, stop, lands)
        except (StepFailed, SingularMatrix, InvalidInput) as failure:
            # InvalidInput: the law is not defined at a concentration that this step would need
            why = str(failure)
            dt, rejected = 0.3 * length, rejected + 1
            continue
        order = 2 if len(past) > 2 else 1
        factor = np.clip(
            SAFETY * (time.tolerance / max(error, 1e-300)) ** (1 / (order + 1)),
            MIN_STEP_FACTOR,
            MAX_STEP_FACTOR,
        )
        if error > time.tolerance:
            why = f"the error of one step stays above time.tolerance = {time.tolerance:g}"
            dt, rejected = float(factor) * length, rejected + 1
            continue
        grown = min(time.max_step, float(factor) * length)
        # a step cut short by a stop says nothing about the length to continue with
        next_dt = max(grown, dt) if length < dt else grown
        new = _accepted(step, model, (state, *past[: KEPT - 1]), flow, next_dt, rejected)
        return replace(new, tried=begun.tried)
    raise Diverged(f"{_place(step)}: {why}")


def _noisy(step: Step, time: Time) -> Step:
    """One step with shot noise, of length time.max_step: see `surface.noise`.

    How long it is depends on nothing that its noise decides: if large changes were rejected for
    shorter steps, there would be too few of them. A step that cannot be made is made shorter,
    with the same random numbers; the next ones grow back to the given length.
    """
    begun, stop = _begun(step), next_stop(step.model, step.state.t, time.end)
    model, rejected, why = begun.model, step.rejected, ""
    dt = min(_next_length(step), time.max_step)
    while dt > SHORTEST_STEP / model.rate:
        length, lands = _to_stop(dt, stop - step.state.t)
        try:
            past, kept = noisy_past(model, begun.past, length, step.number + 1)
            state, flow, _ = _tried(model, past, length, begun.flow, time.tolerance)
        except (StepFailed, SingularMatrix, InvalidInput) as failure:
            why, dt, rejected = str(failure), 0.3 * length, rejected + 1
            continue
        history = (landed(state, stop, lands), *past[: KEPT - 1])
        new = _accepted(step, model, history, flow, time.max_step, rejected)
        return replace(new, tried=begun.tried, noise_kept=kept)
    raise Diverged(f"{_place(step)}: {why}")


@dataclass(frozen=True, eq=False)
class _Begun:
    """What a step begins with: model and past, on a better mesh where one is due.

    `flow`: the flow before it, None where nothing before tells of what comes; `smooth`: no input
    has just jumped; `goes_on`: neither has that nor the mesh changed.
    """

    model: Model
    past: tuple[State, ...]
    flow: Flow | None
    tried: Array | None
    smooth: bool
    goes_on: bool


def _begun(step: Step) -> _Begun:
    model, present, tried = step.model, step.state, step.tried
    smooth = not after_break(model, present.t)
    if due(model, present, tried):
        model, present = remeshed(model, present)
        tried = present.r if model is step.model else None
    kept = model is step.model
    past, flow = (step.history, step.flow) if kept else ((present,), None)
    if not smooth:  # what was before tells nothing of what comes
        past, flow = (replace(present, angular_velocity=None),), None
    return _Begun(model, past, flow, tried, smooth, kept and smooth)


def _place(step: Step) -> str:
    """Where a run stands, in words."""
    t = step.model.parameters.quantity(step.state.t, "T")
    return f"at t = {t:.6g}, step {step.number}"


def _to_stop(dt: float, remaining: float) -> tuple[float, bool]:
    """The length of a step that aims at dt, and whether it ends at the stop `remaining` ahead."""
    # do not leave a sliver for the last step
    length = remaining if dt > 0.999 * remaining else dt
    return length, length == remaining


def _accepted(
    before: Step,
    model: Model,
    history: tuple[State, ...],
    flow: Flow,
    next_dt: float,
    rejected: int,
) -> Step:
    """The step after `before`, with what is to be known of its state."""
    model = model.at(history[0].t, since=history[1].t)
    rate, still = relative_rate(model, history[0], flow)
    if awaited(model, history[0].t):
        return Step(before.number + 1, model, history, flow, next_dt, rejected, rate)
    rest = before.rest if rate < CHANGED * STEADY else None
    if rest is None and still and rate <= before.rate:
        rest = Rest(history[0].t, leading_growth_rate(model, history[0], flow))
    return Step(before.number + 1, model, history, flow, next_dt, rejected, rate, rest)


def _tried(
    model: Model, past: Sequence[State], dt: float, before: Flow | None, tolerance: float
) -> tuple[State, Flow, float]:
    """The state after dt, the flow there, and the error of the step."""
    if len(past) == 1:
        return starting_step(model, past[0], dt, before, tolerance)
    return semi_implicit_step(model, past, dt, before, tolerance)


def _next_length(step: Step) -> float:
    """The length that the step after `step` aims at [T].

    After a step cut short by time.end, or an explicit one, it grows from that step's length.
    """
    if step.dt == 0.0:
        return step.next_dt
    shortest = 2.0 * SHORTEST_STEP / step.model.rate
    return min(step.next_dt, max(STABLE_GROWTH * step.dt, shortest))
