"""`load`: a run that was stored in a folder, read as far as it is asked for."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, overload

from amoeboid.config import Config, resolved
from amoeboid.display import html_table
from amoeboid.model.parameters import Parameters
from amoeboid.output.checkpoint import read_checkpoint
from amoeboid.output.folder import resumed_run, stored_config, table_units
from amoeboid.output.frame_reader import read_frame
from amoeboid.output.manifest import stored_manifest, stored_units, told
from amoeboid.output.reading import checked, text_in, within
from amoeboid.output.scale import Scale
from amoeboid.output.timeseries import read_table
from amoeboid.runs.advance import INTERRUPTED, advance_in_folder
from amoeboid.runs.continuing import check_continues, ended_by
from amoeboid.runs.interruption import Interrupted, interruptible_from_python
from amoeboid.runs.progress import check_progress, wanted
from amoeboid.runs.run import Run
from amoeboid.runs.snapshot import Snapshot
from amoeboid.simulation.rows import Rows
from amoeboid.simulation.step import Step
from amoeboid.simulation.timeseries import column_units
from amoeboid.validation import InvalidInput, path_of

_ENTRY = re.compile(r'timestep="([^"]+)" part="0" file="frames/(frame_\d+\.vtp)"')


class StoredFrames(Sequence[Snapshot]):
    """The frames of a stored run; each is read when it is asked for. `times` [T] are known."""

    def __init__(self, folder: Path, config: Config, entries: Sequence[tuple[float, str]]):
        self.folder, self.config, self.entries = folder, config, tuple(entries)

    @property
    def times(self) -> list[float]:
        """Times of the frames [T]."""
        return [t for t, _ in self.entries]

    @overload
    def __getitem__(self, index: int) -> Snapshot: ...
    @overload
    def __getitem__(self, index: slice) -> StoredFrames: ...
    def __getitem__(self, index: int | slice) -> Snapshot | StoredFrames:
        """A frame, read now; of a slice, frames that are read later. Raises InvalidInput."""
        if isinstance(index, slice):
            return StoredFrames(self.folder, self.config, self.entries[index])
        name = f"frames/{self.entries[index][1]}"
        try:
            path = checked(self.folder, name)
        except OSError as error:
            raise InvalidInput(
                f"the frame {str(self.folder / name)!r} cannot be read: {error.strerror}"
            ) from None
        found = read_frame(path, self.config.parameters, self.config.inputs)
        return Snapshot(found.model, found.state, found.flow)

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        span = (
            f", t = {self.entries[0][0]:.6g} to {self.entries[-1][0]:.6g}" if self.entries else ""
        )
        return f"StoredFrames({len(self)} frames{span})"


@dataclass(frozen=True, eq=False, repr=False)
class StoredRun(Run):
    """A run in a folder, see `Run`. Nothing is read until it is asked for, and then kept.

    `load` makes it anew where the run has gone on meanwhile.
    """

    folder: Path

    @cached_property
    def config(self) -> Config:
        """The configuration that the run was made with."""
        return stored_config(self.folder)

    @property
    def parameters(self) -> Parameters:
        """The parameters of the cell."""
        return self.config.parameters

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What manifest.json says: status, versions, summary; empty if it is damaged.

        Raises InvalidInput for a folder that a newer version has written.
        """
        return stored_manifest(self.folder)

    @cached_property
    def _table(self) -> tuple[dict[str, str | None], Rows]:
        scale = Scale(table_units(self.folder))
        known = {} if scale.units is None else self._dimensions
        try:
            path = checked(self.folder, "timeseries.csv")
            columns, rows = read_table(path, units=known, scale=scale)
        except FileNotFoundError:
            return {}, Rows()
        except (OSError, InvalidInput) as error:
            raise InvalidInput(f"the run in {str(self.folder)!r} cannot be read: {error}") from None
        return {name: self._dimensions.get(name) for name in columns}, rows

    @cached_property
    def _dimensions(self) -> dict[str, str | None]:
        """Of the columns of a time series, also where the manifest is damaged."""
        return column_units(None, self.config) | stored_units(self.manifest)

    @property
    def rows(self) -> Rows:
        """The rows of the time series in plain numbers."""
        return self._table[1]

    @property
    def units(self) -> Mapping[str, str | None]:
        """The columns of the time series and their dimensions."""
        return self._table[0]

    @cached_property
    def frames(self) -> StoredFrames:
        """The frames, each read when asked for. Raises InvalidInput where they cannot be."""
        try:
            entries = _entries(text_in(self.folder, "frames.pvd"))
            there = set(os.listdir(within(self.folder, "frames"))) if entries else set()
        except FileNotFoundError:
            entries, there = [], set()
        except OSError as error:
            raise InvalidInput(
                f"the frames of {str(self.folder)!r} cannot be read: {error}"
            ) from None
        kept = [(t, name) for t, name in entries if name in there]
        return StoredFrames(self.folder, self.config, kept)

    @cached_property
    def last(self) -> Step:
        """The step of the checkpoint, from which `resume` continues. Raises InvalidInput."""
        path = self.folder / "checkpoint.npz"
        if not path.is_file():
            raise InvalidInput(
                f"the run in {str(self.folder)!r} has no checkpoint.npz: it ended before its "
                "first checkpoint, or the file was removed"
            )
        try:
            step = read_checkpoint(checked(self.folder, path.name)).step
        except (OSError, InvalidInput) as error:
            raise InvalidInput(f"the run in {str(self.folder)!r} cannot be read: {error}") from None
        # a checkpoint holds plain numbers, the manifest the size of their units
        p = replace(step.model.parameters, units=self.parameters.units)
        return replace(step, model=replace(step.model, parameters=p))

    @property
    def status(self) -> str:
        """How the run ended: "finished", "diverged", "interrupted", "failed", or "running"."""
        return told(self.manifest, "status", "unknown")

    @property
    def ended(self) -> str:
        """Why the run ended, empty where it has not."""
        return told(self.manifest, "ended", "")

    def resume(
        self,
        until: Any = None,
        *,
        progress: Any = None,
        writers: Iterable[Any] = (),
        observe: Iterable[str] | None = None,
    ) -> StoredRun:
        """The run continued in its folder, as by `amoeboid run --resume`; gives it as it is then.

        `until`, `writers` and `observe` are those of `simulate`. Raises InvalidInput where it
        cannot be read, or would end at once, and after Ctrl-C the KeyboardInterrupt of `simulate`,
        Interrupted.
        """
        check_progress(progress)
        config, events = ended_by(self.config, until)
        run, first = resumed_run(self.folder, config, writers, observe)
        check_continues(first, resolved(config).time, events)
        run.begin()
        with (
            interruptible_from_python() as interruption,
            wanted(progress, first.state.t, run.config.time.end, config.parameters) as report,
        ):
            outcome, _ = advance_in_folder(run, first, [*events, interruption], report)
        if outcome.status == INTERRUPTED:
            raise Interrupted(StoredRun(self.folder))
        return StoredRun(self.folder)

    def __getstate__(self) -> dict[str, Any]:
        """What a pickle holds: the folder, from which the rest is read."""
        return {"folder": self.folder}

    def __repr__(self) -> str:
        name = str(self.folder)
        name = name if len(name) <= 200 else f"...{name[-196:]}"
        try:
            return f"StoredRun({name!r}, {self._end})"
        except InvalidInput as problem:
            return f"StoredRun({name!r}, unreadable: {str(problem)[:300]})"

    def _repr_html_(self) -> str:
        try:
            return super()._repr_html_()
        except InvalidInput:
            return html_table(repr(self), [])


def _entries(text: str) -> list[tuple[float, str]]:
    """Times and names of the frames that a list names. Raises InvalidInput."""
    found = _ENTRY.findall(text)
    try:
        times = [float(t) for t, _ in found]
    except ValueError as error:
        raise InvalidInput(f"the times in frames.pvd must be numbers: {error}") from None
    if not all(map(math.isfinite, times)) or any(a >= b for a, b in pairwise(times)):
        raise InvalidInput("frames.pvd must list frames in the order of time")
    return list(zip(times, (name for _, name in found), strict=True))


def load(folder: str | os.PathLike[str]) -> StoredRun:
    """The run in a folder, of `amoeboid run` or `simulate(..., folder=...)`.

    Raises InvalidInput for a folder that holds no run.
    """
    path = path_of(folder, "the folder of a run")
    if not (path / "config.toml").is_file():
        raise InvalidInput(
            f"load needs the folder of a run, {str(path)!r} has no config.toml; give the output "
            "folder of amoeboid run"
        )
    return StoredRun(path)
