"""Progress of long commands: one line on standard error, and only on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from amoeboid.axisymmetric.progress import Progress, Watch


@contextmanager
def shown() -> Iterator[Watch]:
    """A watch that shows each step; what it wrote is erased at the end."""
    from amoeboid.axisymmetric.progress import unwatched

    if not sys.stderr.isatty():
        yield unwatched
        return
    from rich.console import Console

    with Console(file=sys.stderr).status("starting") as status:
        yield lambda step: status.update(line(step))


def line(step: Progress) -> str:
    """The text for one step."""
    return f"{step.task}: {step.name} = {step.value:.6g}, {step.modes} modes, point {step.points}"
