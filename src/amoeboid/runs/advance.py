"""From the first step of a run to its end, into memory or into a folder, as the command does."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from amoeboid.observables import units as observable_units
from amoeboid.output.folder import RunFolder
from amoeboid.runs.progress import Report, unreported
from amoeboid.runs.snapshot import Snapshot
from amoeboid.sections import Time
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.events import Event
from amoeboid.simulation.loop import evolve
from amoeboid.simulation.rows import Row
from amoeboid.simulation.step import Step
from amoeboid.simulation.step_length import Diverged
from amoeboid.simulation.timeseries import TimeSeries
from amoeboid.simulation.writers import checked, finish, take
from amoeboid.studies.columns import physical_number, unit

SUMMARY = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "area_error")
RATES = ("growth_rate", "growth_rate_error", "rate_of_change", "speed_growth")
INTERRUPTION = "interrupted"
FINISHED, DIVERGED, INTERRUPTED = "finished", "diverged", "interrupted"


@dataclass(frozen=True, eq=False)
class Outcome:
    """The last good step of a run, its status and why it ended."""

    last: Step
    status: str
    ended: str


class FramesInMemory:
    """Keeps the cell at the times of a schedule, and the last one: a writer."""

    def __init__(self, schedule: Schedule, kept: Iterable[Snapshot] = ()) -> None:
        self.schedule, self.kept = schedule, list(kept)

    def due(self, step: Step) -> list[float]:
        """Times of the frames within a step."""
        return self.schedule.due(step.state.t)

    def write(self, step: Step) -> None:
        """Keep the cell."""
        self.kept.append(Snapshot(step.model, step.state, step.flow))
        self.schedule.latest = step.state.t

    def finish(self, step: Step) -> None:
        """Keep the last cell, unless the frames are at times that were asked for."""
        if not self.schedule.times and (not self.kept or self.kept[-1].state.t < step.state.t):
            self.write(step)


class Record:
    """Time series and frames of a run in memory, and the user's own writers."""

    def __init__(self, series: TimeSeries, frames: FramesInMemory, writers: Iterable[Any]) -> None:
        self.series, self.frames = series, frames
        self.writers = (series, frames, *checked(writers))
        self._last: Step | None = None

    def continued(self, last: Step) -> None:
        """Take up a run that stands at a step."""
        self._last = last
        self.frames.schedule.latest = last.state.t

    @property
    def begun(self) -> bool:
        """Whether a step has been taken up."""
        return self._last is not None

    def take(self, step: Step) -> Row:
        """Take up the next step; returns its row."""
        take(self.writers, self._last, step)
        self._last = step
        return self.series.rows[-1]

    def save(self, step: Step) -> None:
        """Take up the last step."""
        finish(self.writers, step)


def advance(
    into: Record | RunFolder,
    first: Step,
    time: Time,
    events: Sequence[Event] = (),
    report: Report = unreported,
) -> Outcome:
    """Make the steps after `first` until an event ends the run; `time` is resolved."""
    last, status, why = first, FINISHED, ""
    if not into.begun:
        into.take(first)
    try:
        for step in evolve(first, time, events):
            last, why = step, step.ended or ""
            report(into.take(step))
    except Diverged as error:
        status, why = DIVERGED, str(error)
    if why == INTERRUPTION:
        status, why = INTERRUPTED, f"stopped at t = {shown_time(last):.6g}"
    into.save(last)
    return Outcome(last, status, why)


def advance_in_folder(
    run: RunFolder,
    first: Step,
    events: Sequence[Event] = (),
    report: Report = unreported,
    began: float | None = None,
) -> tuple[Outcome, dict[str, Any]]:
    """The same into a folder, whose manifest tells how it ended; also gives its summary.

    `began`: when the work began, of time.perf_counter.
    """
    begin = time.perf_counter() if began is None else began
    with run.failure_recorded():
        outcome = advance(run, first, run.config.time, events, report)
        return outcome, concluded(run, outcome, begin)


def concluded(run: RunFolder, outcome: Outcome, begin: float) -> dict[str, Any]:
    """Write how a run ended into the manifest of its folder; gives its summary.

    `begin`: when the work began, of time.perf_counter.
    """
    found = summary(run.rows, outcome.last) | {
        "wall_s": round(time.perf_counter() - begin, 3),
        "output": str(run.folder),
    }
    t = outcome.last.state.t
    run.write_manifest(outcome.status, ended=outcome.ended, t=t, summary=found)
    return found


def summary(rows: Sequence[Row], last: Step) -> dict[str, Any]:
    """What a run led to; the latest row is that of `last`, whatever the observables of the run.

    For a cell with units numbers are in those that `units` of it names.
    """
    row, p = rows[-1], last.model.parameters
    found: dict[str, Any] = {name: row[name] for name in SUMMARY if name in row} | {
        "steps": last.number,
        "steady": last.steady,
        "stability": last.stability,
        "stability_problem": last.stability_problem or None,
        "growth_rate": last.growth,
        "growth_rate_error": last.growth_error,
        "rate_of_change": last.rate * last.model.rate,
        "speed_growth": _speed_growth(rows, 1.0 / last.model.rate),
    }
    if p.units is None:
        return found
    dimensions = observable_units(n for n in SUMMARY if n in row) | dict.fromkeys(RATES, "1/T")
    for name, dimension in dimensions.items():
        if found[name] is not None:
            found[name] = physical_number(p, found[name], dimension)
    units = {name: unit(p, dimension) for name, dimension in dimensions.items()}
    return found | {"units": {name: word for name, word in units.items() if word}}


def shown_time(step: Step) -> Any:
    """The time of a step, with its unit if the cell has physical ones."""
    return step.model.parameters.quantity(step.state.t, "T")


def _speed_growth(rows: Sequence[Row], unit: float) -> float | None:
    """Relative growth of max_retrograde_speed at the end [1/T], None for a cell without flow.

    Over the last half of a unit of time: the last step may be too short to tell.
    """
    known = [row for row in rows if "max_retrograde_speed" in row]
    if not known:
        return None
    last = known[-1]
    first = next((row for row in reversed(known) if row["t"] <= last["t"] - 0.5 * unit), known[0])
    a, b = (row["max_retrograde_speed"] for row in (first, last))
    if min(a, b) <= 0.0 or not last["t"] > first["t"]:
        return None
    return math.log(b / a) / (last["t"] - first["t"])
