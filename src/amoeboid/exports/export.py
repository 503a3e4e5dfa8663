"""`export`: from a run and a path to files."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any

from amoeboid import exports
from amoeboid.exports.job import FPS, Format, Job, Write, untold
from amoeboid.output.atomic import write_atomically
from amoeboid.runs.progress import QUIET
from amoeboid.runs.run import Run
from amoeboid.terminal import shown_line
from amoeboid.validation import InvalidInput, path_of

SLICE = re.compile(r"\s*([+-]?\d{1,9})?\s*(:)?\s*([+-]?\d{1,9})?\s*(?::\s*([+-]?\d{1,9})?\s*)?")
# The files of a run, which no export replaces.
OWN = re.compile(r"(manifest\.json|config\.toml|timeseries\.csv|frames\.pvd|checkpoint\.npz"
                 r"|initial_.*)")  # fmt: skip


def export(
    run: Run,
    path: str | os.PathLike[str] | None = None,
    to: str | None = None,
    *,
    frames: Any = None,
    force: bool = False,
    follow: bool = False,
    fps: float | None = None,
) -> list[Path]:
    """Write a run in the format `to`, by default the one that the ending of `path` names.

    `path`: the file, if it ends as files of the format do, or a folder for them; by default one in
    the working folder with the name of the run. `frames`: a slice, a number, or a text such as
    "0:100:10" or "-1"; all if None. `follow` keeps the cell in the middle; `fps`: frames a second
    of a movie. Files that are there are not replaced without `force`, those of the run never.
    Returns the paths of the files. Raises InvalidInput, also where a package is missing, and
    OSError.
    """
    given = None if path is None else path_of(path, "the path of an export")
    name = to or _format_of(given)
    chosen = exports.named(name)
    wanted = {"follow": follow, "fps": fps is not None}
    chosen.check(name, [option for option, on in wanted.items() if on])
    rate = _checked_fps(fps, chosen.max_fps)
    with shown_line(QUIET) as show:
        numbers = selected(frames, len(run.frames))
        job = Job(run, _name(run), numbers, follow, rate, show or untold)
        if (chosen.frames or frames is not None) and not len(job.numbers):
            raise InvalidInput(
                f"an export to {name} needs frames, but {_chosen(frames, len(run.frames))}"
            )
        if chosen.series and not job.has_series:
            if not len(job.numbers):
                raise InvalidInput(
                    f"an export to {name} needs a time series or frames, the run has none"
                )
            warnings.warn("the run has no time series; only its frames are exported", stacklevel=2)
        targets = _targets(chosen, job, name, given)
        _check(run, targets, force)
        for target, write in targets.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(target, write)
    return list(targets)


def selected(frames: Any, count: int) -> range:
    """The numbers of frames that a slice, a number or a text names. Raises InvalidInput."""
    every = range(count)
    if frames is None:
        return every
    chosen = _read(frames) if isinstance(frames, str) else frames
    if isinstance(chosen, slice):
        try:
            return every[chosen]
        except (TypeError, ValueError):
            raise _unknown(frames) from None
    if isinstance(chosen, bool) or not isinstance(chosen, Integral):
        raise _unknown(frames)
    number = int(chosen)
    if not count:
        raise InvalidInput(f"a frame must be one of the run, which has no frames, got {number}")
    if not -count <= number < count:
        raise InvalidInput(
            f"a frame must be a number from 0 to {count - 1}, or -{count} to -1 from the end, got "
            f"{number}"
        )
    return every[number % count : number % count + 1]


def _read(text: str) -> Any:
    found = SLICE.fullmatch(text)
    if found is None or not text.strip():
        raise _unknown(text)
    start, colon, stop, step = found.groups()
    if colon is None:
        if start is None or stop is not None:
            raise _unknown(text)
        return int(start)
    return slice(*(None if part is None else int(part) for part in (start, stop, step)))


def _unknown(frames: Any) -> InvalidInput:
    return InvalidInput(
        "frames must be a number or a slice of whole numbers such as 0:100:10, ::2 or -1, with a "
        "step that is not 0, got "
        f"{str(frames)[:60]!r}"
    )


def _chosen(frames: Any, count: int) -> str:
    if not count:
        return "the run has no frames"
    return f"{str(frames)[:60]!r} selects none of the {count} frames of the run"


def _checked_fps(fps: Any, most: float) -> float:
    """Frames a second, FPS if None. Raises InvalidInput."""
    if fps is None:
        return FPS
    if isinstance(fps, bool) or not isinstance(fps, Real) or not 0.0 < float(fps) <= most:
        raise InvalidInput(f"fps must be a number > 0 and <= {most:g} here, got {fps!r}")
    return float(fps)


def _format_of(path: Path | None) -> str:
    """The format that the ending of a path names."""
    ending = "" if path is None else path.suffix.lower()
    found = [name for name in exports.names() if ending and exports.named(name).suffix == ending]
    plain = [name for name in found if f".{name}" == ending] or found
    if not plain:
        raise InvalidInput(
            f"the format must be one of {', '.join(exports.names())}, or follow from the "
            f"extension of the path, got {'no path' if path is None else repr(str(path))}"
        )
    return plain[0]


def _endings() -> set[str]:
    """The endings of the files of all formats."""
    return {exports.named(name).suffix for name in exports.names()}


def _name(run: Run) -> str:
    """The name of the folder of a run."""
    folder = getattr(run, "folder", None)
    return (folder.resolve().name if folder is not None else "") or "run"


def _targets(chosen: Format, job: Job, name: str, given: Path | None) -> dict[Path, Write]:
    """Where the files are written."""
    files: Mapping[str, Write] = chosen.files(job)
    if given is not None and given.suffix.lower() == chosen.suffix and not given.is_dir():
        if len(files) != 1:
            shown = ", ".join([*list(files)[:2], *(["..."] if len(files) > 2 else [])])
            remedy = "; or choose one frame" if chosen.one_per_frame else ""
            raise InvalidInput(
                f"an export to {name} consists of {len(files)} files here ({shown}) and needs the "
                f"path of a folder, got {str(given)!r}{remedy}"
            )
        return dict(zip([given], files.values(), strict=True))
    if given is not None and given.suffix.lower() in _endings() and not given.is_dir():
        raise InvalidInput(
            f"a file of an export to {name} must have the extension {chosen.suffix}, and a folder "
            f"must have no file extension, got {str(given)!r}"
        )
    if given is None:
        given = Path() if len(files) == 1 else Path(f"{job.name}-{name}")
    return {given / file: write for file, write in files.items()}


def _check(run: Run, targets: Mapping[Path, Write], force: bool) -> None:
    """Raise InvalidInput for files that must not be written."""
    folder = getattr(run, "folder", None)
    kept = None if folder is None else folder.resolve()
    for target in targets:
        parent = target.parent.resolve()
        if (parent == kept and OWN.fullmatch(target.name)) or (kept and parent == kept / "frames"):
            raise InvalidInput(
                f"an export must not replace the files of the run, got {str(target)!r}; choose "
                "another folder"
            )
        around = next(p for p in target.parents if os.path.lexists(p))
        if not around.is_dir():
            raise InvalidInput(
                f"an export must lie in a folder, {str(around)!r} is a file; choose another path"
            )
        if target.is_dir():
            raise InvalidInput(f"an export must be a file, {str(target)!r} is a folder")
        if not force and os.path.lexists(target):
            raise InvalidInput(
                f"an export must not replace files, {str(target)!r} exists; choose another path, "
                "or replace it with --force (force=True)"
            )
