"""The time loop: steps of controlled length until a time, a steady state, or an event.

Steps end where an input jumps, and start anew there; see `simulation.changes`.
`evolve` yields every accepted step; it keeps nothing and writes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.config import SHORTEST_STEP, Config, Time, resolved
from amoeboid.meshes.geometry import area, geometry, node_areas, volume_centroid
from amoeboid.numerics.multistep import extrapolated
from amoeboid.numerics.sparse import SingularMatrix
from amoeboid.simulation.changes import after_break, awaited, landed, next_stop
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.explicit import explicit_step
from amoeboid.surface.initial import Adaptation, first_flow, initial_condition
from amoeboid.surface.model import Model
from amoeboid.surface.remeshing import due, remeshed
from amoeboid.surface.stability import leading_growth_rate
from amoeboid.surface.state import Flow, State
from amoeboid.surface.steadiness import (
    CHANGED,
    MAX_GROWTH_TIMES,
    STEADY,
    UNSTABLE,
    Rest,
    relative_rate,
)
from amoeboid.surface.stepping import StepFailed, semi_implicit_step, starting_step
from amoeboid.validation import InvalidInput

# Length of the start on a new mesh as a share of the step before it, which was of higher order.
START_AGAIN = 0.3
KEPT = 3  # states that a step and its error estimate are made from
# Times that differ by less than this share of the interval between two frames are one time.
SAME_TIME = 1e-9
SAFETY, MAX_STEP_FACTOR, MIN_STEP_FACTOR = 0.9, 2.0, 0.3
# BDF2 is stable if no step is longer than 1 + sqrt(2) times the one before.
STABLE_GROWTH = 2.4


@dataclass(frozen=True, eq=False)
class Step:
    """An accepted step: the state it led to, the flow during it, and what the next one needs.

    `model` may have another mesh than that of the step before, and has the parameters at the time
    of the state, at a jump those before it; `history`: the state and those
    before it that the next step needs, newest first; `rate` is the largest relative rate of change
    of shape and concentration in units of model.rate; `rest` is None as long as the cell or one of
    its parameters changes, and for an initial state; `ended` says why the run ends here, None if it
    goes on; `tried`: the nodes (V, 3) with which it was last tried in vain to make a better mesh
    than this one; `adapted`, of an initial state: what was done to a shape from a file.
    """

    number: int
    model: Model
    history: tuple[State, ...]
    flow: Flow
    next_dt: float
    rejected: int
    rate: float
    rest: Rest | None = None
    ended: str | None = None
    tried: Array | None = None
    adapted: Adaptation | None = None

    @property
    def steady(self) -> bool:
        """Whether the cell does not change, and no small perturbation is known to grow.

        It need not be stable for that: see `stability`.
        """
        return self.rest is not None and not self.unstable

    @property
    def unstable(self) -> bool:
        """Whether the cell does not change, but a small perturbation grows."""
        return self._grows and not self.growth_not_seen

    @property
    def growth_not_seen(self) -> bool:
        """Whether predicted growth has not appeared within the time allowed for it."""
        waited = 0.0 if self.rest is None else self.state.t - self.rest.since
        return self._grows and waited * (self.growth or 0.0) > MAX_GROWTH_TIMES

    @property
    def _grows(self) -> bool:
        least = max(UNSTABLE * self.model.rate, self.growth_error or 0.0)
        return (self.growth or 0.0) > least

    @property
    def growth(self) -> float | None:
        """Growth rate of the fastest growing perturbation [1/T] of a cell at rest, if known."""
        return None if self.rest is None else self.rest.growth.rate

    @property
    def growth_error(self) -> float | None:
        """Error of `growth` [1/T], without that of the mesh."""
        return None if self.rest is None or self.growth is None else self.rest.growth.error

    @property
    def stability(self) -> str:
        """ "stable" or "unstable", as far as the error of the growth rate tells, or "unknown"."""
        if self.stability_problem:
            return "unknown"
        return "stable" if (self.growth or 0.0) < 0.0 else "unstable"

    @property
    def stability_problem(self) -> str:
        """Why it is not known whether the state is stable; empty if it is."""
        if self.rest is None:
            pending = awaited(self.model, self.state.t)
            return pending or "the cell still changes"
        if self.growth is None or self.growth_error is None:
            return self.rest.growth.problem
        if self.growth_not_seen:
            return (
                f"a growth rate of {self.growth:.3g} per unit time is predicted, but no growth "
                "appeared; the mesh may be too coarse for it, or time.max_step too long for an "
                "oscillation"
            )
        if abs(self.growth) <= self.growth_error:
            return (
                f"the growth rate of the fastest perturbation, {self.growth:.3g} per unit time, "
                f"is only known to {self.growth_error:.2g}"
            )
        return ""

    @property
    def state(self) -> State:
        """The state that the step led to."""
        return self.history[0]

    @property
    def dt(self) -> float:
        """Length of the step [T]; 0 for an initial state."""
        return 0.0 if len(self.history) == 1 else self.state.t - self.history[1].t


Event = Callable[[Step], str | None]


class Diverged(ArithmeticError):
    """The run cannot go on; the steps yielded before it are good."""


def start(config: Config) -> Step:
    """The initial step of a configuration.

    Raises InvalidInput, also for parameters so extreme that not even the initial state exists.
    """
    config = resolved(config)
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            return _started(config)
    except (StepFailed, SingularMatrix, FloatingPointError) as error:
        raise InvalidInput(
            f"the parameters must allow a cell at rest to start from, these do not: {error}"
        ) from None


def _started(config: Config) -> Step:
    begin = initial_condition(config)
    model, state = begin.model, begin.state
    flow, dt = first_flow(model, state)
    rate, _ = relative_rate(model, state, flow)
    next_dt = dt / max(1.0, rate)
    return Step(0, model, (state,), flow, next_dt, 0, rate, adapted=begin.adapted)


def evolve(first: Step, time: Time, events: Sequence[Event] = ()) -> Iterator[Step]:
    """Yield the steps after `first` until one of them has `ended` set.

    A run continued from any step goes on exactly as the uninterrupted one. Raises Diverged if no
    step, however short, can be made.
    """
    given, inputs = first.model.given, first.model.inputs
    changes = {} if inputs is None else {"changes": inputs.changes, "cue": inputs.cue}
    time = resolved(Config(parameters=given, time=time, **changes)).time
    step = first
    while step.state.t < time.end:
        step = _next(step, time)
        step = _ended(step, time, events)
        yield step
        if step.ended:
            return


def between(before: Step, after: Step, t: float) -> Step:
    """The cell at a time t within the step from `before` to `after`.

    Of second order, as the step: nodes and numbers of filaments at the nodes lie on the polynomial
    through the states that the step was made from (on the line between the last two where that
    would make c negative), velocities and tension on the line between the two flows. Area and
    number of filaments are those of the states. The run does not depend on it. Raises InvalidInput
    for another time.
    """
    model, faces, past = after.model, after.model.mesh.faces, after.history
    if not past[-1].t <= past[1].t <= t <= past[0].t:
        raise InvalidInput(f"t must be {past[1].t:g} to {past[0].t:g}, got {t:g}")
    numbers = [s.c * node_areas(s.r, faces) for s in past]
    for count in (len(past), 2):
        times = [s.t for s in past[:count]]
        r = extrapolated(times, [s.r for s in past[:count]], t)
        wanted = extrapolated(times, [np.asarray(area(s.r, faces)) for s in past[:count]], t)
        center = volume_centroid(r, faces)
        r = center + np.sqrt(wanted / area(r, faces)) * (r - center)
        c = extrapolated(times, numbers[:count], t) / node_areas(r, faces)
        if c.min() >= 0.0:
            break
    position = extrapolated(times, [s.position for s in past[:count]], t)
    begins = past[1].t
    known = before.model.mesh is model.mesh and begins not in model.breaks
    begun = before.flow if known else flow_of(model.at(begins, begins), past[1], after.dt)
    share, g = (t - past[1].t) / after.dt, geometry(r, faces)
    v_c, v_p = (
        (1.0 - share) * a + share * b
        for a, b in ((begun.v_c, after.flow.v_c), (begun.v_p, after.flow.v_p))
    )
    zeta0 = (1.0 - share) * begun.zeta0 + share * after.flow.zeta0
    state = State(t, r, np.maximum(c, 0.0), zeta0, position)
    flow = Flow(v_c, v_p, zeta0, g.normals, g.node_areas)
    return replace(after, model=model.at(t, begins), history=(state, *past[1:]), flow=flow)


def due_times(after: float, until: float, interval: float) -> Iterator[float]:
    """Multiples of `interval` beyond `after`, up to `until`; one that is `until` but for rounding
    is given as that."""
    count = math.floor(after / interval + SAME_TIME) + 1
    while (t := count * interval) <= until + SAME_TIME * interval:
        yield until if t >= until - SAME_TIME * interval else t
        count += 1


def _ended(step: Step, time: Time, events: Sequence[Event]) -> Step:
    reasons = [reason for event in events if (reason := event(step))]
    if step.steady and time.stop_when_steady:
        reasons.append("steady")
    if step.state.t >= time.end:
        reasons.append("end of time")
    return replace(step, ended=reasons[0]) if reasons else step


def _next(step: Step, time: Time) -> Step:
    """One step of the scheme that is asked for."""
    return _explicit(step, time) if time.scheme == "explicit" else _semi_implicit(step, time)


def _explicit(step: Step, time: Time) -> Step:
    """One step of the paper's algorithm, whose length is given."""
    model, stop = step.model, next_stop(step.model, step.state.t, time.end)
    remaining = stop - step.state.t
    length = remaining if time.max_step > 0.999 * remaining else time.max_step
    try:
        state, flow = explicit_step(model, step.state, length, step.flow)
        state = landed(state, stop, length == remaining)
    except (StepFailed, InvalidInput) as error:
        raise Diverged(f"at t = {step.state.t:.6g}, step {step.number}: {error}") from None
    return _accepted(step, model, (state, step.state), flow, time.max_step, 0)


def _semi_implicit(step: Step, time: Time) -> Step:
    """One accepted step; its length follows from the error estimate."""
    model, present, tried = step.model, step.state, step.tried
    stop, smooth = next_stop(model, present.t, time.end), not after_break(model, present.t)
    if due(model, present, tried):
        model, present = remeshed(model, present)
        tried = present.r if model is step.model else None
    kept = model is step.model
    past, flow_before = (step.history, step.flow) if kept else ((present,), None)
    if not smooth:  # what was before tells nothing of what comes
        past, flow_before = (replace(present, angular_velocity=None),), None
    dt = min(_next_length(step) if smooth else step.next_dt, time.max_step)
    rejected = step.rejected
    if not (kept and smooth):
        dt *= START_AGAIN
    why = "the flow changes faster than any step can follow"
    while dt > SHORTEST_STEP / model.rate:
        remaining = stop - present.t
        # do not leave a sliver for the last step
        length = remaining if dt > 0.999 * remaining else dt
        try:
            state, flow, error = _tried(model, past, length, flow_before, time.tolerance)
            state = landed(state, stop, length == remaining)
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
        # a step cut short by a stop says nothing about the length to go on with
        next_dt = max(grown, dt) if length < dt else grown
        new = _accepted(step, model, (state, *past[: KEPT - 1]), flow, next_dt, rejected)
        return replace(new, tried=tried)
    raise Diverged(f"at t = {step.state.t:.6g}, step {step.number}: {why}")


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
