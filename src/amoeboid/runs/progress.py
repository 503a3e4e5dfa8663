"""Progress of a run: one line with the time reached, the speed, the step and the time left."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from amoeboid.model.parameters import Parameters
from amoeboid.simulation.rows import Row
from amoeboid.studies.columns import magnitude, text
from amoeboid.terminal import shown_line
from amoeboid.validation import InvalidInput

QUIET = 2.0  # seconds; a run that is over by then shows nothing from Python

Report = Callable[[Row | None], None]


def unreported(_: Row | None) -> None:
    """No-op callback."""


@contextmanager
def reported(start: float, end: float, p: Parameters, after: float = 0.0) -> Iterator[Report]:
    """A function that takes rows of the time series of a run from time `start` to `end`."""
    began = time.monotonic()
    with shown_line(after) as show:
        if show is None:
            yield unreported
            return

        def report(row: Row | None) -> None:
            if row is not None:
                show(_parts(row, start, end, time.monotonic() - began, p))

        yield report


def check_progress(progress: Any) -> None:
    """Raise InvalidInput for what `wanted` does not take."""
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise InvalidInput(
            "progress must be None, True, False or a function of a row of the time series, got "
            f"{progress!r}"
        )


@contextmanager
def wanted(progress: Any, start: float, end: float, p: Parameters) -> Iterator[Report]:
    """What the keyword `progress` asks for: None, after a while; True, at once; False, nothing.

    It was checked by `check_progress`, before a run leaves anything in a folder.
    """
    if progress is False:
        yield unreported
    elif callable(progress):
        yield lambda row: None if row is None else progress(dict(row))
    else:
        with reported(start, end, p, 0.0 if progress else QUIET) as report:
            yield report


def _parts(row: Row, start: float, end: float, elapsed: float, p: Parameters) -> tuple[str, ...]:
    done = max(row["t"] - start, 0.0) / (end - start)
    left = elapsed * (1.0 / done - 1.0) if done > 0.0 else math.inf
    speed = row.get("max_retrograde_speed")
    return (
        f"t = {magnitude(p, row['t'], 'T'):.4g} of at most {text(p, end, 'T')}",
        *([] if speed is None else [f"speed {text(p, speed, 'L/T', '.4g')}"]),
        f"dt {text(p, row['dt'], 'T', '.3g')}",
        f"at most {_duration(left)} left",
    )


def _duration(seconds: float) -> str:
    """Hours, minutes and seconds."""
    if not seconds < 1e6:
        return "some time"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"
