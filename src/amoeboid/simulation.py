"""The time loop: steps of controlled length until a time, a steady state, or an event.

`evolve` yields every accepted step; it keeps nothing and writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from amoeboid.config import Config, Time, resolved
from amoeboid.numerics.banded import SingularMatrix
from amoeboid.surface.geometry import geometry, volume_centroid
from amoeboid.surface.initial import initial_connectivity, initial_state
from amoeboid.surface.model import Flow, Model, State
from amoeboid.surface.stepping import StepFailed, flow_of, semi_implicit_step
from amoeboid.surface.transport import rate_of_change
from amoeboid.theory.linear import growth_rate
from amoeboid.validation import InvalidInput

FIRST_STEP = 1e-2  # in units of 1 / model.rate
SHORTEST_STEP = 1e-7
STEADY = 1e-5  # relative change within 1 / model.rate that counts as none
SAFETY, MOST_GROWTH, MOST_SHRINKING = 0.9, 2.0, 0.3


@dataclass(frozen=True, eq=False)
class Step:
    """An accepted step: the state it led to, the flow during it, and what the next one needs.

    `rate` is the largest relative rate of change of shape and concentration in units of
    model.rate; `steady` if it vanishes and does not grow, as it does at the slow start of an
    instability; `ended` says why the run ends here, None if it goes on.
    """

    number: int
    state: State
    flow: Flow
    previous: State | None
    next_dt: float
    rejected: int
    rate: float
    steady: bool
    ended: str | None = None

    @property
    def dt(self) -> float:
        """Length of the step [T]; 0 for an initial state."""
        return 0.0 if self.previous is None else self.state.t - self.previous.t


Event = Callable[[Step], str | None]


class Diverged(ArithmeticError):
    """The run cannot go on; the steps yielded before it are good."""


def start(config: Config) -> tuple[Model, Step]:
    """The model and the initial step of a configuration.

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


def _started(config: Config) -> tuple[Model, Step]:
    model, state = initial_state(config)
    dt = FIRST_STEP / model.rate
    flow = flow_of(model, state, dt)
    rate, steady = _rate(model, state, flow)
    return model, Step(0, state, flow, None, dt / max(1.0, rate), 0, rate, steady)


def model_of(config: Config) -> Model:
    """The model of a configuration, without an initial state: what a resumed run needs."""
    return Model(config.parameters, initial_connectivity(config))


def evolve(model: Model, first: Step, time: Time, events: Sequence[Event] = ()) -> Iterator[Step]:
    """Yield the steps after `first` until one of them has `ended` set.

    A run continued from any step goes on exactly as the uninterrupted one. Raises Diverged if no
    step, however short, can be made.
    """
    time = resolved(Config(parameters=model.parameters, time=time)).time
    step = first
    while step.state.t < time.end:
        step = _next(model, step, time)
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


def _next(model: Model, step: Step, time: Time) -> Step:
    """One accepted step; its length follows from the error estimate."""
    dt, rejected = min(step.next_dt, time.max_step), step.rejected
    why = "the flow changes faster than any step can follow"
    while dt > SHORTEST_STEP / model.rate:
        remaining = time.end - step.state.t
        # do not leave a sliver for the last step
        length = remaining if dt > 0.999 * remaining else dt
        try:
            state, flow = semi_implicit_step(model, step.state, length)
        except (StepFailed, SingularMatrix) as error:
            why = str(error)
            dt, rejected = 0.3 * length, rejected + 1
            continue
        error_estimate = _error(model, step, state)
        factor = np.clip(
            SAFETY * np.sqrt(time.tolerance / max(error_estimate, 1e-300)),
            MOST_SHRINKING,
            MOST_GROWTH,
        )
        if error_estimate > time.tolerance:
            why = f"the error of one step stays above time.tolerance = {time.tolerance:g}"
            dt, rejected = float(factor) * length, rejected + 1
            continue
        grown = min(time.max_step, float(factor) * length)
        # a last step cut short by time.end says nothing about the length to go on with
        next_dt = max(grown, dt) if length < dt else grown
        rate, still = _rate(model, state, flow)
        steady = still and rate <= step.rate
        return Step(step.number + 1, state, flow, step.state, next_dt, rejected, rate, steady)
    raise Diverged(f"at t = {step.state.t:.6g}, step {step.number}: {why}")


def _error(model: Model, step: Step, new: State) -> float:
    """Local error of c and r, relative to c0 + |c| and R0, from the change of their rates.

    For a first-order step it is (dt^2/2) times the second derivative.
    """
    p, now, before = model.parameters, step.state, step.previous
    if before is None:
        return 0.0
    ratio = (new.t - now.t) / (now.t - before.t)
    c_error = np.abs((new.c - now.c) - ratio * (now.c - before.c)) / (p.c0 + np.abs(new.c))
    r_error = np.abs((new.r - now.r) - ratio * (now.r - before.r)) / p.R0
    return 0.5 * float(max(c_error.max(), r_error.max()))


def _rate(model: Model, state: State, flow: Flow) -> tuple[float, bool]:
    """Largest relative rate of change, in units of model.rate, and whether that is none."""
    p = model.parameters
    g = geometry(state.r, model.mesh.faces)
    c_rate = rate_of_change(model, state.c, g, flow.v)
    v_n = np.einsum("vi,vi->v", flow.v, flow.normals)
    c_scale = max(p.c0, np.abs(state.c).max())
    rate = float(max(np.abs(c_rate).max() / c_scale, np.abs(v_n).max() / p.R0) / model.rate)
    # A small polarization that grows at lambda_1 also changes slowly.
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    amplitude = np.linalg.norm(3.0 * (g.node_areas * state.c) @ x) / (model.A0 * p.R0 * c_scale)
    growth = float(growth_rate(p, 1)) * amplitude / model.rate
    return rate, bool(rate < STEADY and not (growth > 0 and rate > 0.1 * growth))
