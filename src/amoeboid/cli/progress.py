"""Progress of long commands: one line on standard error, and only on a terminal."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from amoeboid.cli.output import ERASE, is_terminal, write
from amoeboid.cli.tables import number

if TYPE_CHECKING:
    from amoeboid.axisymmetric.progress import Progress, Watch

Show = Callable[[Sequence[str]], None]

BETWEEN = 0.1  # seconds between two lines, so that writing them takes no time


@contextmanager
def shown_line() -> Iterator[Show | None]:
    """A function that shows a line made of parts; None where there is no terminal for it.

    Parts that do not fit are left out from the last; none is cut. The line is erased at the end.
    """
    stream = sys.stderr
    if not is_terminal(stream):
        yield None
        return
    latest = -BETWEEN

    def show(parts: Sequence[str]) -> None:
        nonlocal latest
        if time.monotonic() - latest < BETWEEN:
            return
        latest = time.monotonic()
        with suppress(OSError):
            write(stream, ERASE + fitting(parts, shutil.get_terminal_size().columns - 1))

    try:
        yield show
    finally:
        with suppress(OSError):
            write(stream, ERASE)


def fitting(parts: Sequence[str], limit: int) -> str:
    """The first parts, two blanks apart, that fit into `limit` columns; none is cut."""
    line = ""
    for part in parts:
        longer = f"{line}  {part}" if line else part
        if len(longer) > limit:
            break
        line = longer
    return line


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
