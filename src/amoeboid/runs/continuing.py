"""Whether a run can be continued."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from amoeboid.config import Config, shortest_step
from amoeboid.sections import Time
from amoeboid.simulation.events import Event, declared, events_of, reason
from amoeboid.simulation.step import Step
from amoeboid.validation import InvalidInput


def ended_by(config: Config, until: Any) -> tuple[Config, tuple[Event, ...]]:
    """The configuration with the events of `until` in it, and those that only Python can hold.

    Raises InvalidInput, also for steady() where shot noise leaves no cell steady.
    """
    section, events = declared(config.time, until, config.parameters)
    if config.noise.acts and until is not None and section.stop_when_steady:
        raise InvalidInput(
            "until must not be steady() with shot noise (noise.filaments > 0), because the cell "
            "never becomes steady; use amoeboid.time(t) or amoeboid.when(...)"
        )
    return replace(config, time=section), events


def least_end(first: Step, time: Time) -> float:
    """The time [T] that a run which stands at a step must at least continue to; exclusive."""
    return first.state.t + shortest_step(Config(parameters=first.model.parameters, time=time))


def ended_already(first: Step, time: Time, events: Sequence[Event] = ()) -> str | None:
    """The event, but for the end of time, by which a run has ended at a step, None if it has not.

    `time` is resolved.
    """
    return reason(first, [*events, *events_of(time)[:-1]])


def check_continues(first: Step, time: Time, events: Sequence[Event] = ()) -> None:
    """Raise InvalidInput if a run that stands at a step would end at once."""
    why = ended_already(first, time, events)

    def shown(t: float) -> Any:
        return first.model.parameters.quantity(t, "T")

    if why:
        raise InvalidInput(
            f"the run has ended at t = {shown(first.state.t):g}: {why}; to continue, resume it "
            "until another event, such as until=amoeboid.time(t)"
        )
    least = least_end(first, time)
    if not time.end > least:
        raise InvalidInput(
            f"to continue, the run must end after t = {shown(least):.9g}, got "
            f"{shown(time.end):.9g}; resume it "
            "with until=amoeboid.time(t) and a later t"
        )
