"""The time loop: steps of controlled length until an event ends the run.

`evolve` yields every accepted step; it keeps nothing and writes nothing. Steps end where an input
jumps, and start anew there; see `simulation.changes`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from amoeboid.config import Config, resolved
from amoeboid.meshes.cells import InitialCell
from amoeboid.numerics.sparse import SingularMatrix
from amoeboid.sections import Noise, Time
from amoeboid.simulation.events import Event, events_of, reason
from amoeboid.simulation.step import Step
from amoeboid.simulation.step_length import next_step
from amoeboid.surface.initial import first_flow, initial_condition
from amoeboid.surface.steadiness import relative_rate
from amoeboid.surface.stepping import StepFailed
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput


@one_thread
def start(config: Config, cell: InitialCell | None = None) -> Step:
    """The initial step of a configuration, with `cell` that of its shape and concentration.

    To that cell is added what section [initial] says, without a value of its own no perturbation.
    Raises InvalidInput, also for parameters so extreme that not even the initial state exists.
    """
    if cell is not None and config.initial.perturbation is None:
        config = replace(config, initial=replace(config.initial, perturbation=0.0))
    config = resolved(config)
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            return _started(config, cell)
    except (StepFailed, SingularMatrix, FloatingPointError) as error:
        raise InvalidInput(
            f"the parameters must allow an initial cell at rest, these do not: {error}"
        ) from None


def _started(config: Config, cell: InitialCell | None) -> Step:
    begin = initial_condition(config, cell)
    model, state = begin.model, begin.state
    flow, dt = first_flow(model, state)
    rate, _ = relative_rate(model, state, flow)
    next_dt = dt / max(1.0, rate)
    return Step(0, model, (state,), flow, next_dt, 0, rate, adapted=begin.adapted)


def evolve(first: Step, time: Time, events: Sequence[Event] = ()) -> Iterator[Step]:
    """Yield the steps after `first` until one of them has `ended` set.

    It ends by `events`, or by what `time` declares. A run continued from any step continues exactly
    as the uninterrupted one. Raises Diverged if no step, however short, can be made.
    """
    given, inputs = first.model.given, first.model.inputs
    acting = {} if inputs is None else {"changes": inputs.changes, "cue": inputs.cue}
    noise = first.model.noise or Noise()
    time = resolved(Config(parameters=given, time=time, noise=noise, **acting)).time
    every = [*events, *events_of(time)]
    step = first
    while step.state.t < time.end:
        with one_thread:
            step = next_step(step, time)
            step = replace(step, ended=reason(step, every))
        yield step
        if step.ended:
            return
