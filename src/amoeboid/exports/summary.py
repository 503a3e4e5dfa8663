"""What a run is and how it ended, as text, and its picture drawn again."""

from __future__ import annotations

import os
from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from amoeboid.display import html_table, text_table
from amoeboid.exports.job import Job
from amoeboid.plotting.cell import save_picture
from amoeboid.plotting.cell_painter import NoPicture
from amoeboid.runs.run import Run
from amoeboid.runs.snapshot import SHOWN
from amoeboid.runs.stored import StoredFrames, StoredRun
from amoeboid.runs.words import environment, per_time, stability
from amoeboid.studies.columns import text, unit
from amoeboid.surface.cell import SurfaceCell
from amoeboid.validation import InvalidInput

PICTURE = "cell.png"
RATES = (("t", "T"), ("growth_rate", "1/T"), ("growth_rate_error", "1/T"))


@dataclass(frozen=True, eq=False, repr=False)
class Summary:
    """What a run is: a description, rows of names and texts, sentences, and where its picture is.

    `problems` say what could not be read or drawn. `repr` is the summary as text; notebooks show
    the picture too.
    """

    description: str
    rows: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    problems: tuple[str, ...]
    picture: Path | None

    @property
    def lines(self) -> list[str]:
        """The summary as lines of text."""
        where = [] if self.picture is None else [f"picture in {self.picture}"]
        table = text_table(("", ""), self.rows, "<<")
        return [self.description, "", *table, *self.notes, *where]

    def __repr__(self) -> str:
        return "\n".join([*self.lines, *self.problems])

    def _repr_html_(self) -> str:
        table = html_table(self.description, self.rows, notes=[*self.notes, *self.problems])
        if self.picture is None or not self.picture.is_file():
            return table
        data = b64encode(self.picture.read_bytes()).decode()
        return f'{table}<img width="500" src="data:image/png;base64,{data}">'


def summary(run: Run, picture: str | os.PathLike[str] | None = None) -> Summary:
    """The summary of a run, with the picture of its last cell drawn again.

    `picture`: the file of the picture (.png); by default `cell.png` in the folder of a stored run,
    and none of a run in memory. Raises InvalidInput where nothing of a run can be read.
    """
    problems: list[str] = []
    cell = last_cell(run, problems)
    if isinstance(run, StoredRun) and not run.rows:
        problems.append(f"the run in {str(run.folder)!r} has no row in timeseries.csv")
    path = _picture_path(run, picture)
    drawn = path is not None and cell is not None and _drawn(path, cell, problems)
    return Summary(
        run.parameters.description,
        tuple(_rows(run, cell)),
        tuple(_notes(run, problems)),
        tuple(problems),
        path if drawn else None,
    )


def last_cell(run: Run, problems: list[str] | None = None) -> SurfaceCell | None:
    """The cell at the end; of a run without a checkpoint that of its last frame, if it has one.

    What cannot be read is added to `problems`.
    """
    told = [] if problems is None else problems
    try:
        return run.final.cell
    except InvalidInput as problem:
        told.append(str(problem))
    try:
        return run.frames[-1].cell if len(run.frames) else None
    except InvalidInput as problem:
        told.append(str(problem))
        return None


def table(run: Run) -> list[tuple[str, str]]:
    """The key observables at the end, with their units: names and texts."""
    row = run.rows[-1] if run.rows else {}
    found = []
    for name in SHOWN:
        if name in row:
            dimension = run.units.get(name)
            number = text(run.parameters, row[name], dimension)
            plain = run.parameters.units is None
            found.append((name, f"{number} {unit(run.parameters, dimension) if plain else ''}"))
    return [(name, words.rstrip()) for name, words in found]


def _rows(run: Run, cell: SurfaceCell | None) -> list[tuple[str, str]]:
    how = (
        run.ended if run.status == "finished" else f"{run.status}: {run.ended or 'reason unknown'}"
    )
    if run.status in ("running", "unknown"):
        how = run.status
    rows = [("ended", how)]
    if run.rows:
        t = _with_unit(run, run.rows[-1]["t"], "T")
        rows += [("t", t), ("steps", str(run.rows[-1]["step"]))]
    if cell is not None:
        rows.append(("nodes", str(len(cell.c))))
    rows.append(("frames", _frames(run)))
    path = environment(run.config)
    if path:
        rows.append(("path in", path))
    if isinstance(run, StoredRun):
        rows.append(("written by", _writer(run)))
    return [*rows, *table(run)]


def _with_unit(run: Run, value: float, dimension: str) -> str:
    return f"{Job(run, '', range(0)).shown(value, dimension):.6g} {unit(run.parameters, dimension)}"


def _frames(run: Run) -> str:
    frames = run.frames
    if not len(frames):
        return "none"
    known = frames.times if isinstance(frames, StoredFrames) else [f.state.t for f in frames]
    ends = (_with_unit(run, known[0], "T"), _with_unit(run, known[-1], "T"))
    return f"{len(known)}, from t = {ends[0]} to {ends[1]}"


def _writer(run: StoredRun) -> str:
    versions = run.manifest.get("versions")
    known = versions.get("amoeboid") if isinstance(versions, dict) else None
    return f"amoeboid {known}" if isinstance(known, str) else "unknown"


def _notes(run: Run, problems: list[str]) -> list[str]:
    if problems:
        return []
    p = run.parameters
    return [stability(run.last, per_time(p), float(Job(run, "", range(0)).shown(1.0, "1/T")))]


def _picture_path(run: Run, picture: str | os.PathLike[str] | None) -> Path | None:
    if picture is None:
        return run.folder / PICTURE if isinstance(run, StoredRun) else None
    path = Path(picture)
    if path.suffix.lower() != ".png":
        raise InvalidInput(f"the picture of a cell must be a file of type .png, got {str(path)!r}")
    return path


def _drawn(path: Path, cell: SurfaceCell, problems: list[str]) -> bool:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_picture(path, cell)
    except (NoPicture, OSError) as error:
        problems.append(f"the picture {str(path)!r} could not be drawn: {error}")
        return False
    return True


def document(run: Run, found: Summary) -> dict[str, Any]:
    """The same as a JSON object: plain numbers in the units that `units` names."""
    row = run.rows[-1] if run.rows else {}
    job = Job(run, "", range(0))
    readable = not found.problems
    rate, error = (run.last.growth, run.last.growth_error) if readable else (None, None)
    numbers = {name: float(job.shown(row[name], run.units.get(name) or "1")) for name in SHOWN
               if name in row}  # fmt: skip
    units = {name: unit(run.parameters, run.units.get(name)) or "1" for name in numbers}
    return {
        "parameters": found.description,
        "status": run.status,
        "ended": run.ended,
        "t": float(job.shown(row["t"], "T")) if row else None,
        "steps": row.get("step"),
        "frames": len(run.frames),
        "environment": environment(run.config) or None,
        **numbers,
        "stability": run.stability if readable else "unknown",
        "growth_rate": None if rate is None else float(job.shown(rate, "1/T")),
        "growth_rate_error": None if error is None else float(job.shown(error, "1/T")),
        "units": units | {name: job.unit(d) for name, d in RATES},
        "picture": None if found.picture is None else str(found.picture),
        "problems": list(found.problems),
    }
