"""What ends a run: events with names.

An event is any function of a `Step` that says whether the run ends there. Its name is then the
reason; an event may also return a text instead of True, which is then the reason. Those of this
module are what `until` of `simulate` takes as well:

    simulate(p, until=[steady(), time(100), when("polarity > 0.5"), my_event])
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

from amoeboid.conditions import condition, holds
from amoeboid.model.parameters import Parameters
from amoeboid.model.units import measured
from amoeboid.sections import Time
from amoeboid.simulation.step import Step
from amoeboid.validation import InvalidInput

Event = Callable[[Step], "bool | str | None"]

END_OF_TIME = "end of time"
SOLVED = "steady, solved for"


@dataclass(frozen=True)
class Steady:
    """The cell is steady: nothing changes, and no small perturbation is known to grow.

    `solve`: once the cell is near a steady one that is stable, this is solved for instead of waited
    for; see `amoeboid.simulation.finish`.
    """

    solve: bool = False
    name = "steady"

    def __call__(self, step: Step) -> bool | str:
        """Whether the run ends at a step, and how the cell became steady if it was solved for."""
        return SOLVED if step.solved else step.steady


@dataclass(frozen=True)
class At:
    """The simulated time `t` is reached; the last step ends exactly there."""

    t: Any
    name = END_OF_TIME

    def __call__(self, step: Step) -> bool:
        """Whether the run ends at a step."""
        return bool(step.state.t >= time_of(self.t, step.model.parameters, "time"))


@dataclass(frozen=True)
class When:
    """A condition such as "polarity > 0.5" holds, see `amoeboid.conditions`."""

    condition: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "condition", condition(self.condition))

    @property
    def name(self) -> str:
        """The condition."""
        return self.condition

    def __call__(self, step: Step) -> bool:
        """Whether the run ends at a step."""
        return holds(self.condition, step.cell, step.state.t)


def steady(solve: bool = False) -> Steady:
    """The event that the cell is steady; a run without `time` ends after 200/rate at the latest.

    `solve`: once the cell is near a steady one, on a straight path, a circle or a helix, that one
    is solved for, and if it is stable the run ends with it: at the time at which it was near, with
    the reason "steady, solved for". It is the same cell but for where its nodes lie: observables
    differ by the error of the mesh, and by what a run leaves when nothing seems to change. Raises
    nothing.
    """
    return Steady(solve)


def time(t: Any) -> At:
    """The event that the simulated time t [T] is reached; for cells with units also "300 s".

    Raises InvalidInput for a number that is no time; a quantity is checked when a run begins.
    """
    if isinstance(t, int | float):
        Time(end=t)  # rejects a value that is not a time
    return At(t)


def when(text: str) -> When:
    """The event that the condition `text` holds: "polarity > 0.5", "c_front < 0.1*c0 and t > 5".

    It compares expressions of observables, yours included, of parameters (`law.n` of your own
    law), of the time t and of numbers. The run ends with the first step at whose end it holds.
    Raises InvalidInput.

    >>> import amoeboid as am
    >>> am.simulate(mesh=am.Icosphere(1), until=am.when("c_rear > 4*c0"))
    Solution(c_rear > 4 * c0 at t = 0.5519, 15 steps, 42 nodes)
    """
    return When(text)


def named(event: Any) -> str:
    """The name of an event: its `name`, or that of the function."""
    return str(getattr(event, "name", None) or getattr(event, "__name__", type(event).__name__))


MAKERS = (steady, time, when)
"""The functions that make events; a run that is given one of them misses its brackets."""


def events_of(time: Time) -> list[Event]:
    """The events that a resolved section [time] declares, in the order of reporting."""
    found: list[Event] = [Steady(time.finish == "solve")] if time.stop_when_steady else []
    found += [When(text) for text in time.until]
    return [*found, At(time.end)]


def reason(step: Step, events: Iterable[Event]) -> str | None:
    """Why a run ends at a step, by the first event that says so; None if it continues.

    Raises InvalidInput for an event that gives neither a truth value nor a text.
    """
    for event in events:
        found = event(step)
        try:
            ends = bool(found)
        except Exception as error:  # of an array of several numbers, for one
            raise InvalidInput(
                f"an event must return true, false or a text, {named(event)} returned "
                f"{str(found)[:100]!r}: {error}"
            ) from error
        if ends:
            return found if isinstance(found, str) else named(event)
    return None


def time_of(given: Any, p: Parameters, name: str) -> float:
    """A time as a number [T]: a number, or a quantity such as "300 s" for a cell with units.

    Raises InvalidInput, naming `name`.
    """
    if isinstance(given, Real) and not isinstance(given, bool):
        return float(given)
    if p.units is None:
        raise InvalidInput(
            f"{name} must be a number in the units of the parameters, got {given!r}; for "
            "quantities with units start from Parameters.physical"
        )
    return measured(name, given, "T", "300 s") / p.units.of("T")


def times_of(given: Any, p: Parameters, name: str) -> tuple[float, ...]:
    """At least one time as numbers [T], each given as to `time_of`. Raises InvalidInput."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InvalidInput(f"{name} must be a list of times, got {given!r}; write [{given!r}]")
    found = tuple(time_of(t, p, name) for t in given)
    if not found:
        raise InvalidInput(
            f"{name} must hold at least one time, got none; leave it out to use the interval"
        )
    return found


def declared(time: Time, until: Any, p: Parameters) -> tuple[Time, tuple[Event, ...]]:
    """A section [time] with the events of `until` in it, and those that only Python can hold.

    `until` is an event or several; it replaces what ends a run by itself. Raises InvalidInput.
    """
    if until is None:
        return time, ()
    events = list(until) if isinstance(until, list | tuple) else [until]
    for event in events:
        if any(event is make for make in MAKERS):
            raise InvalidInput(
                f"until must be an event, got the function {event.__name__} that makes one; write "
                f"amoeboid.{event.__name__}(...)"
            )
        if not callable(event):
            raise InvalidInput(
                "until must be an event or a list of events, such as amoeboid.steady(), "
                f"amoeboid.time(100), amoeboid.when({'polarity > 0.5'!r}) or a function of a step, "
                f"got {event!r}"
            )
    ends = [time_of(event.t, p, "time") for event in events if isinstance(event, At)]
    conditions = tuple(event.condition for event in events if isinstance(event, When))
    own = tuple(e for e in events if not isinstance(e, Steady | At | When))
    steadies = [event for event in events if isinstance(event, Steady)]
    finish = "solve" if any(event.solve for event in steadies) else "wait"
    time = replace(time, stop_when_steady=bool(steadies), finish=finish, until=conditions)
    return (replace(time, end=min(ends)) if ends else time), own
