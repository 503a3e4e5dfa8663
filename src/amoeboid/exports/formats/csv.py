"""Tables: the time series, and profiles along the axis of the cell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.tables import write_rows
from amoeboid.runs.analysis import along_axis, axis, towards
from amoeboid.simulation.rows import WHOLE
from amoeboid.studies.columns import titled
from amoeboid.validation import InvalidInput

ANGLES = 45


def timeseries(job: Job, path: Path) -> None:
    """Every column, its unit behind its name."""
    columns = job.run.columns
    head = [titled(name, column.unit) for name, column in columns.items()]
    values = [
        map(int, column.values) if name in WHOLE else column.values.tolist()
        for name, column in columns.items()
    ]
    write_rows(path, [head], zip(*values, strict=True))


def profiles(job: Job, path: Path) -> None:
    """Mean of c and of the flow towards the rear on circles around the axis, for each frame."""
    units = {"frame": None, "t": "T", "theta": None, "c": "N/L^2", "flow": "L/T"}
    head = [titled(name, job.unit(dimension)) for name, dimension in units.items()]
    head[2] = titled("theta", "rad")
    write_rows(path, [head], _profile_rows(job))


def _profile_rows(job: Job) -> Iterator[list[Any]]:
    """Rows; a cell of which a ray from the center leaves more than once has no numbers."""
    theta = (np.arange(ANGLES) + 0.5) * (np.pi / ANGLES)
    instead = axis(job.cell(job.numbers[-1]), np.array([0.0, 0.0, 1.0]))
    for number, cell in job.cells("profiles"):
        rear = axis(cell, instead)
        try:
            c = job.shown(along_axis(cell, rear, theta), "N/L^2")
            flow = job.shown(along_axis(cell, rear, theta, towards(cell, rear)), "L/T")
        except InvalidInput:
            c = flow = np.full(ANGLES, np.nan)
        t = float(job.shown(cell.t, "T"))
        for row in zip(theta.tolist(), c.tolist(), flow.tolist(), strict=True):
            yield [number, t, *row]


def files(job: Job) -> Mapping[str, Write]:
    """The time series, and profiles of the frames; what the run has of them."""
    found: dict[str, Write] = {}
    if job.has_series:
        found["timeseries.csv"] = lambda path: timeseries(job, path)
    if len(job.numbers):
        found["profiles.csv"] = lambda path: profiles(job, path)
    return found


FORMAT = Format(
    "timeseries.csv, and profiles.csv with c and flow over the angle from the rear",
    ".csv",
    files,
    frames=False,
    series=True,
)
