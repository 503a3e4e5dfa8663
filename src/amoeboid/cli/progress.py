"""Progress of long commands: one line on standard error, and only on a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from amoeboid.cli.tables import number
from amoeboid.terminal import shown_line

if TYPE_CHECKING:
    from amoeboid.axisymmetric.progress import Progress, Watch


@contextmanager
def shown() -> Iterator[Watch]:
    """A watch that shows each step; what it wrote is erased at the end."""
    from amoeboid.axisymmetric.progress import unwatched

    with shown_line() as show:
        if show is None:
            yield unwatched
        else:
            yield lambda step: show(line(step))


def line(step: Progress) -> tuple[str, ...]:
    """The parts of the line for one step."""
    return (
        f"{step.task}: {step.name} = {number(step.value)}",
        *([f"{step.modes} modes"] if step.modes else []),
        *([f"point {step.points}"] if step.points else []),
    )
