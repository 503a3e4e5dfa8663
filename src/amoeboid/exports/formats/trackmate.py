"""The trajectory as a table of spots with the columns of TrackMate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.tables import write_rows

# Key of a column, its name, its short name, and its dimension, or what stands for it.
COLUMNS = (
    ("LABEL", "Label", "Label", ""),
    ("ID", "Spot ID", "Spot ID", ""),
    ("TRACK_ID", "Track ID", "Track ID", ""),
    ("QUALITY", "Quality", "Quality", "(quality)"),
    ("POSITION_X", "X", "X", "L"),
    ("POSITION_Y", "Y", "Y", "L"),
    ("POSITION_Z", "Z", "Z", "L"),
    ("POSITION_T", "T", "T", "T"),
    ("FRAME", "Frame", "Frame", ""),
    ("RADIUS", "Radius", "R", "L"),
    ("VISIBILITY", "Visibility", "Visibility", ""),
)
NAMES = {"um": "micron", "s": "sec"}
TRACK = 0


def head(job: Job) -> list[list[str]]:
    """Four lines: keys, names, short names and units."""
    units = [f"({_unit(job, d)})" if d in ("L", "T") else d for *_, d in COLUMNS]
    return [*([column[k] for column in COLUMNS] for k in range(3)), units]


def _unit(job: Job, dimension: str) -> str:
    return NAMES.get(job.unit(dimension), job.unit(dimension))


def rows(job: Job) -> Iterator[list[Any]]:
    """One spot a frame, all of one track."""
    for count, (_, cell) in enumerate(job.cells("spots")):
        place = [float(x) for x in job.center(cell)]
        t, radius = float(job.shown(cell.t, "T")), float(job.shown(cell.radius, "L"))
        yield [f"ID{count}", count, TRACK, 1.0, *place, t, count, radius, 1]


def write(job: Job, path: Path) -> None:
    """Write the table."""
    write_rows(path, head(job), rows(job))


def files(job: Job) -> Mapping[str, Write]:
    """One table."""
    return {f"{job.name}-spots.csv": lambda path: write(job, path)}


FORMAT = Format("the trajectory as a table of spots with the columns of TrackMate", ".csv", files)
