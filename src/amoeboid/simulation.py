"""The time loop: steps of controlled length until a time, a steady state, or an event.

`evolve` yields every accepted step; it keeps nothing and writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from amoeboid.config import SHORTEST_STEP, Config, Time, resolved
from amoeboid.numerics.banded import SingularMatrix
from amoeboid.surface.explicit import explicit_step
from amoeboid.surface.geometry import Geometry, geometry, volume_centroid
from amoeboid.surface.initial import initial_state
from amoeboid.surface.model import Flow, Model, State
from amoeboid.surface.remeshing import remeshed
from amoeboid.surface.rigid import changes, gradient, rotations
from amoeboid.surface.stability import SETTLED, leading_growth_rate
from amoeboid.surface.stepping import (
    StepFailed,
    flow_of,
    semi_implicit_step,
    starting_step,
)
from amoeboid.surface.transport import rate_of_change
from amoeboid.validation import InvalidInput

Array = NDArray[np.float64]

FIRST_STEP = 1e-2  # in units of 1 / model.rate
# Relative change within 1 / model.rate that counts as none, slow turning left out.
STEADY = 1e-5
# Growth rate of disturbances, in units of model.rate, above which a state is unstable: the error
# that it is found with. Slower growth makes little of a disturbance in a run of the default length.
UNSTABLE = SETTLED
# Relative change, in units of STEADY, that ends a rest.
CHANGED = 3.0
# An instability that has not shown after so many times the inverse of its growth rate is none of
# the run: of what the mesh does not resolve, or so fast an oscillation that its steps damp it.
PATIENCE = 20.0
# Share of that turning which its gradients on a coarse mesh cannot tell from other changes.
TURNING_ERROR = 0.1
# More than so many times STEADY are a change that is none of turning.
MOST_UNCLEAR = 4.0
# Length of the start on a new mesh as a share of the step before it, which was of higher order.
START_AGAIN = 0.3
KEPT = 3  # states that a step and its error estimate are made from
SAFETY, MOST_GROWTH, MOST_SHRINKING = 0.9, 2.0, 0.3
# BDF2 is stable if no step is longer than 1 + sqrt(2) times the one before.
STABLE_GROWTH = 2.4


@dataclass(frozen=True)
class Rest:
    """What is known of a cell that no longer changes: since when [T], and how fast small
    disturbances grow [1/T], None if that could not be found."""

    since: float
    growth: float | None


@dataclass(frozen=True, eq=False)
class Step:
    """An accepted step: the state it led to, the flow during it, and what the next one needs.

    `model` may have another mesh than that of the step before; `history`: the state and those
    before it that the next step needs, newest first; `rate` is the largest relative rate of change
    of shape and concentration in units of model.rate; `rest` is None as long as the cell changes,
    and for an initial state; `ended` says why the run ends here, None if it goes on.
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

    @property
    def steady(self) -> bool:
        """Whether the cell does not change, and no small disturbance is known to grow."""
        return self.rest is not None and not self.unstable

    @property
    def unstable(self) -> bool:
        """Whether the cell does not change, but a small disturbance grows."""
        return self._grows and not self.in_vain

    @property
    def in_vain(self) -> bool:
        """Whether growth has been waited for so long that it is none of the run."""
        rest = self.rest
        waited = 0.0 if rest is None else (self.state.t - rest.since) * (rest.growth or 0.0)
        return self._grows and waited > PATIENCE

    @property
    def _grows(self) -> bool:
        return (self.growth or 0.0) > UNSTABLE * self.model.rate

    @property
    def growth(self) -> float | None:
        """Growth rate of the fastest growing disturbance [1/T] of a cell at rest, if known."""
        return None if self.rest is None else self.rest.growth

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
    model, state = initial_state(config)
    dt = FIRST_STEP / model.rate
    flow = flow_of(model, state, dt)
    rate, _ = _rate(model, state, flow)
    return Step(0, model, (state,), flow, dt / max(1.0, rate), 0, rate)


def evolve(first: Step, time: Time, events: Sequence[Event] = ()) -> Iterator[Step]:
    """Yield the steps after `first` until one of them has `ended` set.

    A run continued from any step goes on exactly as the uninterrupted one. Raises Diverged if no
    step, however short, can be made.
    """
    time = resolved(Config(parameters=first.model.parameters, time=time)).time
    step = first
    while step.state.t < time.end:
        step = _next(step, time)
        step = _ended(step, time, events)
        yield step
        if step.ended:
            return


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
    remaining = time.end - step.state.t
    length = remaining if time.max_step > 0.999 * remaining else time.max_step
    model = step.model
    try:
        state, flow = explicit_step(model, step.state, length, step.flow)
    except (StepFailed, InvalidInput) as error:
        raise Diverged(f"at t = {step.state.t:.6g}, step {step.number}: {error}") from None
    return _accepted(step, model, (state, step.state), flow, time.max_step, 0)


def _semi_implicit(step: Step, time: Time) -> Step:
    """One accepted step; its length follows from the error estimate."""
    model, present = remeshed(step.model, step.state)
    kept = model is step.model
    past, flow_before = (step.history, step.flow) if kept else ((present,), None)
    dt, rejected = min(_next_length(step), time.max_step), step.rejected
    if not kept:
        dt *= START_AGAIN
    why = "the flow changes faster than any step can follow"
    while dt > SHORTEST_STEP / model.rate:
        remaining = time.end - step.state.t
        # do not leave a sliver for the last step
        length = remaining if dt > 0.999 * remaining else dt
        try:
            state, flow, error = _tried(model, past, length, flow_before, time.tolerance)
        except (StepFailed, SingularMatrix, InvalidInput) as failure:
            # InvalidInput: the law is not defined at a concentration that this step would need
            why = str(failure)
            dt, rejected = 0.3 * length, rejected + 1
            continue
        order = 2 if len(past) > 2 else 1
        factor = np.clip(
            SAFETY * (time.tolerance / max(error, 1e-300)) ** (1 / (order + 1)),
            MOST_SHRINKING,
            MOST_GROWTH,
        )
        if error > time.tolerance:
            why = f"the error of one step stays above time.tolerance = {time.tolerance:g}"
            dt, rejected = float(factor) * length, rejected + 1
            continue
        grown = min(time.max_step, float(factor) * length)
        # a last step cut short by time.end says nothing about the length to go on with
        next_dt = max(grown, dt) if length < dt else grown
        return _accepted(step, model, (state, *past[: KEPT - 1]), flow, next_dt, rejected)
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
    rate, still = _rate(model, history[0], flow)
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


def _rate(model: Model, state: State, flow: Flow) -> tuple[float, bool]:
    """Largest relative rate of change, in units of model.rate, and whether that is none."""
    p = model.parameters
    g = geometry(state.r, model.mesh.faces)
    c_scale = max(p.c0, np.abs(state.c).max())
    c_rate = rate_of_change(model, state.c, g, flow.v) / c_scale
    r_rate = np.einsum("vi,vi->v", flow.v, flow.normals) / p.R0
    rate = float(max(np.abs(c_rate).max(), np.abs(r_rate).max()) / model.rate)
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    if STEADY <= rate < 100.0 * STEADY:
        change = np.concatenate([c_rate, r_rate])
        turning = _turning(model, x, g, state.c / c_scale, change)
        still = float(np.abs(change - turning).max() / model.rate)
        unclear = TURNING_ERROR * float(np.abs(turning).max() / model.rate)
        # in proportion to what is no turning, so that a growth of it still shows
        rate = min(rate, still / (1.0 + min(unclear / STEADY, MOST_UNCLEAR)))
    # A small polarization that grows at lambda_1 also changes slowly.
    amplitude = np.linalg.norm(3.0 * (g.node_areas * state.c) @ x) / (model.A0 * p.R0 * c_scale)
    growth = model.growth_rate * amplitude / model.rate
    return rate, bool(rate < STEADY and not (growth > 0 and rate > 0.1 * growth))


def _turning(model: Model, x: Array, g: Geometry, c: Array, change: Array) -> Array:
    """The part of `change` (2V,), of c and of r.n/R0, that a rotation of the whole cell makes.

    No force holds the axis of a cell; a mesh turns it slowly.
    """
    slope = gradient(c, g, model.mesh)
    basis = changes(rotations(x), slope, g.normals, model.parameters.R0)
    return np.asarray(basis @ np.linalg.lstsq(basis, change, rcond=1e-6)[0])
