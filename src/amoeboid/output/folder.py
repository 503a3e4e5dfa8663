"""A run's folder: manifest, configuration, time series, frames, checkpoint.

    manifest.json        status, parameters, units, versions, platform, seed, summary
    config.toml          the configuration as given; `amoeboid run config.toml` repeats the run
    initial_*            copy of the surface or frame the run started from, if it did from a file
    timeseries.csv       one row an accepted step, of the explicit scheme one a frame
    frames.pvd           the frames with their times; open it in ParaView
    frames/*.vtp         surface, concentration and velocities; also for pyvista.read
    checkpoint.npz       what `--resume` continues from
    .lock                while a process writes to the folder, see `amoeboid.output.lock`

Files are written under a temporary name and renamed, so that a killed run leaves none of them
half-written. Time series and list of frames grow in place by what is new, at a cost that does not
depend on their length; a resumed run writes both anew, up to its checkpoint.
"""

from __future__ import annotations

import itertools
import json
import platform
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from amoeboid.assignments import SECTIONS
from amoeboid.config import (
    Config,
    anchored,
    config_from_toml,
    config_to_toml,
    resolved,
)
from amoeboid.meshes.cells import InitialCell
from amoeboid.model.units import NO_DIMENSION, Units, customary_unit
from amoeboid.output.atomic import remove_partial, write_atomically, write_text
from amoeboid.output.checkpoint import CheckpointFile, read_checkpoint
from amoeboid.output.frames import FrameFiles, write_initial
from amoeboid.output.lock import FolderLock
from amoeboid.output.manifest import (
    FORMAT,
    adapted_shape,
    stored_manifest,
    stored_units,
    unit_sizes,
)
from amoeboid.output.reading import checked as checked_file
from amoeboid.output.reading import text_in, within
from amoeboid.output.timeseries import TimeSeriesFile
from amoeboid.output.versions import installed_versions
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.loop import start
from amoeboid.simulation.rows import Row, Rows
from amoeboid.simulation.step import Step
from amoeboid.simulation.writers import checked, finish, take
from amoeboid.surface.initial import Adaptation
from amoeboid.validation import InvalidInput

MAX_LISTED = 100_000
"""Frames that the manifest lists; of more, frames.pvd does."""

# Names of the copies of the files that a run starts from.
COPIES = {"surface": "initial_surface", "from_frame": "initial_frame"}

CHECKPOINT = "checkpoint.npz"
RUNNING = "running"
"""The status of a run that has not ended, or was killed."""


class RunFolder:
    """A run's folder, open for appending. Made by `new_run`, `resumed_run` or `restarted_run`.

    `given` is the configuration with automatic fields left open, so that they follow the scheme
    and the parameters where it is used again; `config` has every value that the run is made with.
    `writers` are the user's own, `observe` the names of the observables, all if None.
    """

    def __init__(
        self,
        folder: Path,
        given: Config,
        writers: Iterable[Any] = (),
        observe: Iterable[str] | None = None,
    ) -> None:
        self.folder = folder
        self.given, self.config = given, resolved(given)
        output = self.config.output
        self.frames = FrameFiles(folder, Schedule(output.interval, output.times))
        self.series = TimeSeriesFile(folder / "timeseries.csv", self._has_row, observe, given)
        self.checkpoint = CheckpointFile(
            folder / CHECKPOINT, given, self.series, self.frames, Schedule(output.interval)
        )
        self.writers = (self.series, self.frames, *checked(writers), self.checkpoint)
        self.adapted: dict[str, Any] | None = None  # what was done to a shape from a file
        self._last: Step | None = None
        self._lock = FolderLock(folder)
        # identity of the checkpoint that the run goes on from
        self._read: tuple[int, int, int] | None = None

    @property
    def begun(self) -> bool:
        """Whether a step has been taken up."""
        return self._last is not None

    @property
    def rows(self) -> Rows:
        """The rows of the time series."""
        return self.series.rows

    @property
    def units(self) -> dict[str, str | None]:
        """The columns of the time series and their dimensions."""
        return self.series.units

    @property
    def frame_times(self) -> list[tuple[float, str]]:
        """Times and names of the frames written so far."""
        return self.frames.written

    def _has_row(self, step: Step) -> bool:
        return self.config.time.scheme != "explicit" or self.checkpoint.due(step)

    def begin(self) -> None:
        """Write the configuration and a manifest that says the run is under way.

        What a run that was killed left half-written is removed. From here on until the end of the
        run, no other process may begin in this folder: raises InvalidInput where one has.
        """
        frames = within(self.folder, "frames")
        if frames.exists() and not frames.is_dir():
            raise InvalidInput(f"{str(frames)!r} must be a folder or not exist; remove it")
        self._lock.take()
        if self._read is not None and _identity(self.folder / CHECKPOINT) != self._read:
            self._lock.release()
            raise InvalidInput(
                "only one process may write to a run at a time, another has continued "
                f"{str(self.folder)!r} since it was read; resume it again"
            )
        remove_partial(self.folder)
        if self.rows:  # first the table: config.toml tells in which units it is
            self.series.flush()
        write_text(self.folder / "config.toml", config_to_toml(self.given))
        self.write_manifest(RUNNING)

    def take(self, step: Step) -> Row | None:
        """Take up the next step, with the frames that were due within it; returns its row, if any.

        Every step has a row, of the explicit scheme every one within which a frame was due.
        """
        count = len(self.rows)
        take(self.writers, self._last, step)
        self._last = step
        return self.rows[-1] if len(self.rows) > count else None

    def append(self, step: Step) -> None:
        """Add the row of a step to the time series, and nothing else."""
        self.series.write(step)
        self._last = step

    def save(self, step: Step) -> None:
        """Write row, frame and checkpoint of the latest step, unless they have been written."""
        finish(self.writers, step)

    @contextmanager
    def failure_recorded(self) -> Iterator[None]:
        """Note in the manifest that something has ended the run (a full disk, an observable that
        raises), if that is still possible; the exception continues."""
        try:
            yield
        except BaseException as error:
            interrupted = isinstance(error, KeyboardInterrupt)
            t = self.rows[-1]["t"] if self.rows else 0.0
            why = "interrupted" if interrupted else str(error) or type(error).__name__
            with suppress(OSError):
                self.write_manifest("interrupted" if interrupted else "failed", ended=why, t=t)
            raise
        finally:
            self._lock.release()

    @property
    def _units_in_timeseries(self) -> dict[str, str]:
        units = {n: d for n, d in self.units.items() if d not in NO_DIMENSION}
        return {name: customary_unit(str(dimension)) for name, dimension in units.items()}

    @cached_property
    def _versions(self) -> dict[str, str]:
        return installed_versions()

    def write_manifest(self, status: str, **more: Any) -> None:
        """Write manifest.json; `status` is running, finished, interrupted, diverged or failed.

        With any other status than running, the folder is free for another process.
        """
        frames, sizes = self.frames.list_anew(), self.config.parameters.units
        listed = {} if len(frames) > MAX_LISTED else {
            "frames": [{"t": t, "file": f"frames/{name}"} for t, name in frames]
        }  # fmt: skip
        manifest = {
            "format": FORMAT,
            "status": status,
            **more,
            "parameters": self.config.parameters.as_dict(),
            **{s: self.config.section(s) for s in SECTIONS if s != "parameters"},
            **({} if self.adapted is None else {"initial_shape": self.adapted}),
            "units": self.units,
            **({} if sizes is None else {"units_in_timeseries": self._units_in_timeseries}),
            **({} if sizes is None else {"unit_sizes": asdict(sizes)}),
            "seed": self.config.initial.seed,
            "versions": self._versions,
            "python": platform.python_version(),
            "platform": platform.platform(),
            **listed,
        }
        write_text(self.folder / "manifest.json", json.dumps(manifest, indent=2, allow_nan=False))
        if status != RUNNING:
            self._lock.release()


def new_folder(requested: Path | None) -> Path:
    """The folder to write to: `requested`, or the first free of amoeboid-run, amoeboid-run-2, ...

    Raises InvalidInput if `requested` already holds something or cannot be made.
    """
    if requested is None:
        return _numbered_folder()
    if requested.exists() and (not requested.is_dir() or any(requested.iterdir())):
        of_a_run = (requested / "config.toml").is_file()
        raise InvalidInput(
            f"the output folder must be new or empty, {str(requested)!r} is not; choose another "
            f"with -o{', or continue the run in it with --resume' if of_a_run else ''}"
        )
    try:
        requested.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(f"the output folder cannot be created: {error}") from None
    return requested


def _numbered_folder() -> Path:
    names = (f"amoeboid-run-{count}" for count in itertools.count(2))
    for name in itertools.chain(["amoeboid-run"], names):
        try:
            Path(name).mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise InvalidInput(f"the output folder cannot be created: {error}") from None
        break
    return Path(name)


def new_run(
    folder: Path,
    config: Config,
    adapted: Adaptation | None = None,
    writers: Iterable[Any] = (),
    observe: Iterable[str] | None = None,
    cell: InitialCell | None = None,
) -> RunFolder:
    """Start a run in an empty folder; the files that the configuration names are copied into it.

    `adapted`: what was done to a shape from a file, for the manifest; `cell`: what the run starts
    as, if not as the configuration says. Raises InvalidInput, before
    anything is written, for a law, a change or a cue that no file can hold and for observables with
    the names of other columns.
    """
    config_to_toml(config)
    RunFolder(folder, config, writers, observe)
    run = RunFolder(folder, _with_own_files(folder, config, cell), writers, observe)
    run.adapted = None if adapted is None else asdict(adapted)
    run.begin()
    return run


def _with_own_files(folder: Path, config: Config, cell: InitialCell | None) -> Config:
    """`config` with copies in `folder` of the files it names, by their names there.

    A cell to start as becomes such a file.
    """
    if cell is not None:
        name = f"{COPIES['from_frame']}.vtp"
        write_atomically(folder / name, lambda p: write_initial(p, cell))
        return replace(config, initial=replace(config.initial, from_frame=name))
    copies: dict[str, Any] = {}
    for field in COPIES:
        source = getattr(config.initial, field)
        if source is not None:
            copies[field] = f"{COPIES[field]}{Path(source).suffix.lower()}"
            _copy(Path(source), folder / copies[field])
    return replace(config, initial=replace(config.initial, **copies))


def _copy(source: Path, target: Path) -> None:
    def write(temporary: Path) -> None:
        shutil.copyfile(source, temporary)

    write_atomically(target, write)


def stored_config(folder: Path) -> Config:
    """The configuration of a stored run. Raises InvalidInput if the folder holds none."""
    config = _written_config(folder)
    units = config.parameters.units or unit_sizes(stored_manifest(folder))
    return replace(config, parameters=replace(config.parameters, units=units))


def table_units(folder: Path) -> Units | None:
    """Size of the units of a stored run whose timeseries.csv is in um, s and the like.

    None where its numbers are those of the solver: of a cell without units, or of a version that
    stated the units in the manifest alone. Raises InvalidInput if the folder holds no run.
    """
    return _written_config(folder).parameters.units


def _written_config(folder: Path) -> Config:
    path = folder / "config.toml"
    if not path.is_file():
        raise InvalidInput(
            f"--resume needs the folder of a run, {str(folder)!r} has no config.toml"
        )
    return config_from_toml(text_in(folder, "config.toml"), repr(str(path)))


def has_checkpoint(folder: Path) -> bool:
    """Whether the run in a folder has come as far as its first checkpoint."""
    return (folder / CHECKPOINT).is_file()


def restarted_run(folder: Path, config: Config) -> tuple[RunFolder, Step]:
    """A stored run that ended before its first checkpoint, and its initial step; writes nothing.

    Raises InvalidInput if `config` is not the one it was begun with.
    """
    run = RunFolder(folder, config)
    _refuse_changes(resolved(stored_config(folder)), resolved(config))
    first = start(anchored(config, folder))
    run.adapted = None if first.adapted is None else asdict(first.adapted)
    return run, first


def resumed_run(
    folder: Path,
    config: Config,
    writers: Iterable[Any] = (),
    observe: Iterable[str] | None = None,
) -> tuple[RunFolder, Step]:
    """A stored run, ready to continue, and the step it stopped at; writes nothing.

    Raises InvalidInput if it cannot be read, or if `config` is not the one it was made with.
    """
    if not has_checkpoint(folder):
        raise InvalidInput(f"--resume needs a checkpoint, {str(folder)!r} has none")
    run = RunFolder(folder, config, writers, observe)
    manifest = stored_manifest(folder)
    try:
        run._read = _identity(folder / CHECKPOINT)
        saved = read_checkpoint(checked_file(folder, CHECKPOINT))
        run.series.continued(saved.step, stored_units(manifest), table_units(folder))
    except (OSError, InvalidInput) as error:
        raise InvalidInput(
            f"the run in {str(folder)!r} cannot be read: {error}; start a new one, from one of its "
            "frames with --set initial.from_frame=PATH"
        ) from None
    _refuse_changes(resolved(saved.config), resolved(config))
    run.adapted = adapted_shape(manifest)
    run.frames.continued(saved.frame_times, saved.step.state.t)
    run.checkpoint.schedule.latest = saved.step.state.t
    run._last = saved.step
    return run, saved.step


def _identity(path: Path) -> tuple[int, int, int]:
    """What changes when a file is written anew: each is renamed into its place."""
    found = path.stat()
    return found.st_ino, found.st_mtime_ns, found.st_size


def _refuse_changes(made_with: Config, wanted: Config) -> None:
    for section in ("parameters", "mesh", "initial", "changes", "cue", "environment", "noise"):
        before, now = made_with.section(section), wanted.section(section)
        for name in {**before, **now}:
            was, is_ = before.get(name), now.get(name)
            if was != is_:
                raise InvalidInput(
                    f"--resume keeps [{section}] unchanged, {name} = {was}, got {is_}; only "
                    "time.* and output.* may change; start a new run for other changes"
                )
