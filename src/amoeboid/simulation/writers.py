"""What is kept or written during a run: writers, which are asked at every step.

A writer of your own is any object with the two methods of `Writer`; `simulate(..., writers=[...])`
takes it. One that has a method `finish(step)` is called with the last step of the run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from amoeboid.simulation.dense_output import between
from amoeboid.simulation.step import Step
from amoeboid.validation import InvalidInput


class Writer(Protocol):
    """Writes or keeps something of a run."""

    def due(self, step: Step) -> bool | Iterable[float]:
        """Whether a step is to be written, or the times within it at which the cell is."""

    def write(self, step: Step) -> None:
        """Write a step, or the cell at a time within it: a step that `between` gives."""


def checked(writers: Iterable[Any]) -> tuple[Any, ...]:
    """The writers. Raises InvalidInput for an object without the methods of one."""
    found = tuple(writers)
    for writer in found:
        for method in ("due", "write"):
            if not callable(getattr(writer, method, None)):
                raise InvalidInput(
                    f"a writer must have the methods due(step) and write(step), {writer!r} has no "
                    f"{method}; see amoeboid.simulation.writers"
                )
    return found


def take(writers: Sequence[Writer], before: Step | None, step: Step) -> None:
    """Let the writers take up the next step, in their order; `before` is the step before it.

    All are asked before any writes. Raises InvalidInput for times that lie outside the step.
    """
    begin = step.state.t if before is None else before.state.t
    plans = [(writer, _times(writer, writer.due(step), begin, step.state.t)) for writer in writers]
    for writer, times in plans:
        for t in times:
            here = before is None or t == step.state.t
            writer.write(step if here or before is None else between(before, step, t))


def finish(writers: Iterable[Any], step: Step) -> None:
    """Tell the writers that have a method for it the last step of a run."""
    for writer in writers:
        if hasattr(writer, "finish"):
            writer.finish(step)


def _times(writer: Any, due: bool | Iterable[float], begin: float, end: float) -> list[float]:
    """When a writer writes within the step from `begin` to `end`. Raises InvalidInput."""
    if not isinstance(due, Iterable):
        return [end] if due else []
    try:
        times = [] if isinstance(due, str) else [float(t) for t in due]
    except (TypeError, ValueError):
        times = [math.nan]
    if isinstance(due, str) or not all(begin <= t <= end for t in times):
        raise InvalidInput(
            f"due(step) of a writer must return true, false or times from {begin:g} to {end:g}, "
            f"{type(writer).__name__} returned {str(due)[:100]}"
        )
    return times
