"""A run's folder: manifest, configuration, time series, frames, checkpoint.

    manifest.json        status, parameters, units, versions, platform, seed, summary
    config.toml          the configuration as given; `amoeboid run config.toml` repeats the run
    initial_*            copy of the surface or frame the run started from, if it did from a file
    timeseries.csv       one row an accepted step, of the explicit scheme one a frame
    frames.pvd           the frames with their times; open it in ParaView
    frames/*.vtp         surface, concentration and velocities; also for pyvista.read
    checkpoint.npz       what `--resume` goes on from

Files are written under a temporary name and renamed, so that a killed run leaves none of them
half-written. Time series and list of frames grow in place by what is new, at a cost that does not
depend on their length; a resumed run writes both anew, up to its checkpoint.
"""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
import os
import platform
import shutil
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from amoeboid.config import (
    SECTIONS,
    Config,
    anchored,
    config_from_toml,
    config_to_toml,
    resolved,
)
from amoeboid.observables import OBSERVABLES, VECTORS, components, observed, retrograde_flow
from amoeboid.observables import units as observable_units
from amoeboid.output.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from amoeboid.output.versions import installed_versions
from amoeboid.simulation.changes import input_units, input_values
from amoeboid.simulation.loop import Step, between, due_times, start
from amoeboid.surface.initial import Adaptation
from amoeboid.validation import InvalidInput

# Columns of `State.position`: the way of a cell with all drag on its cortex.
POSITION = ("cortex_drag_x", "cortex_drag_y", "cortex_drag_z")
# Columns of a step beside its observables, and their dimensions; `rate` is in units of
# Parameters.rate.
STEP_UNITS: dict[str, str | None] = {
    "step": "1",
    "t": "T",
    "dt": "T",
    "rejected": "1",
    "rate": "1",
    **dict.fromkeys(POSITION, "L"),
}
# Names of the copies of the files that a run starts from.
COPIES = {"surface": "initial_surface", "from_frame": "initial_frame"}


def write_atomically(path: Path, write: Callable[[Path], None]) -> None:
    """Let `write` make a file under a temporary name beside `path`, then rename it."""
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        write(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically."""
    write_atomically(path, lambda p: _write(p, text))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def text_of(path: Path) -> str:
    """A text file in UTF-8, with or without byte order mark. Raises InvalidInput, OSError."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidInput(f"{str(path)!r} must be a text file in UTF-8") from None


class Run:
    """A run's folder, open for appending. Made by `new_run`, `resumed_run` or `restarted_run`.

    `given` is the configuration with automatic fields left open, so that they follow the scheme
    and the parameters where it is used again; `config` has every value that the run is made with.
    `units`: the columns of the time series, that is all observables there are now and the
    parameters that change, and their dimensions.
    """

    def __init__(self, folder: Path, given: Config) -> None:
        self.folder = folder
        self.given, self.config = given, resolved(given)
        self.units = _columns(given)
        self.rows: list[dict[str, float]] = []
        self.frame_times: list[tuple[float, str]] = []
        self.adapted: dict[str, Any] | None = None  # what was done to a shape from a file
        self._times = array("d")
        self._begins_after = -math.inf
        self._last: Step | None = None
        self._table = _GrowingFile(folder / "timeseries.csv")
        self._collection = _GrowingFile(folder / "frames.pvd", _COLLECTION_END)
        self._rows_written = 0

    def begin(self) -> None:
        """Write the configuration and a manifest that says the run is under way."""
        write_text(self.folder / "config.toml", config_to_toml(self.given))
        self.write_manifest("running")

    def take(self, step: Step) -> dict[str, float] | None:
        """Take up the next step, with the frames that were due within it; returns its row, if any.

        Every step has a row, of the explicit scheme every one within which a frame was due. Frames
        are at multiples of output.interval, by `simulation.between`.
        """
        before, due = self._last, self.frames_due(step)
        every = self.config.time.scheme != "explicit"
        row = self.append(step) if every or due else None
        self._last = step
        for t in due:
            self._write_frame(
                step if before is None or t == step.state.t else between(before, step, t)
            )
        if due:
            self._checkpoint(step)
        return row

    def append(self, step: Step) -> dict[str, float]:
        """Add the row of a step to the time series; returns it."""
        position = (float(x) for x in step.state.position)
        found = {
            "step": step.number,
            "t": step.state.t,
            "dt": step.dt,
            "rejected": step.rejected,
            "rate": step.rate,
            **dict(zip(POSITION, position, strict=True)),
            **observed(step.model, step.state, step.flow),
            **components(step.model, step.state, step.flow),
            **input_values(step.model),
        }
        row = {name: found[name] for name in self.units}
        self.rows.append(row)
        self._last = step
        return row

    def frames_due(self, step: Step) -> list[float]:
        """Times of the frames that are due up to a step: multiples of output.interval."""
        if not self.frame_times:
            return [step.state.t]
        after = max(self.frame_times[-1][0], self._begins_after)
        return list(due_times(after, step.state.t, self.config.output.interval))

    def save(self, step: Step) -> None:
        """Write row, frame and checkpoint of the latest step, unless they have been written."""
        if not self.rows or self.rows[-1]["step"] < step.number:
            self.append(step)
        if not self.frame_times or self.frame_times[-1][0] < step.state.t:
            self._write_frame(step)
        self._checkpoint(step)

    def _write_frame(self, step: Step) -> None:
        name = _frame_name(len(self.frame_times))
        (self.folder / "frames").mkdir(exist_ok=True)
        write_atomically(self.folder / "frames" / name, lambda p: write_frame(p, step))
        self.frame_times.append((step.state.t, name))
        self._times.append(step.state.t)
        entry = _entry(step.state.t, name)
        self._collection.extend(entry, lambda: _collection(self.frames()))

    def _checkpoint(self, step: Step) -> None:
        new = self.rows[self._rows_written :]
        self._table.extend(_lines(new), lambda: _table(tuple(self.units), self.rows))
        self._rows_written = len(self.rows)
        checkpoint = Checkpoint(self.given, step, self._times)
        path = self.folder / "checkpoint.npz"
        write_atomically(path, lambda p: write_checkpoint(p, checkpoint))

    def frames(self) -> list[tuple[float, str]]:
        """Times and names of the frames that are still there; the user may delete some."""
        return [
            (t, name) for t, name in self.frame_times if (self.folder / "frames" / name).is_file()
        ]

    @contextmanager
    def failure_recorded(self) -> Iterator[None]:
        """Note in the manifest that something has ended the run (a full disk, an observable that
        raises), if that is still possible; the exception goes on."""
        try:
            yield
        except BaseException as error:
            interrupted = isinstance(error, KeyboardInterrupt)
            t = self.rows[-1]["t"] if self.rows else 0.0
            why = "interrupted" if interrupted else str(error) or type(error).__name__
            with suppress(OSError):
                self.write_manifest("interrupted" if interrupted else "failed", ended=why, t=t)
            raise

    def write_manifest(self, status: str, **more: Any) -> None:
        """Write manifest.json; `status` is running, finished, interrupted, diverged or failed."""
        frames = self.frames()
        if frames:
            self._collection.write(_collection(frames))
        manifest = {
            "status": status,
            **more,
            "parameters": self.config.parameters.as_dict(),
            **{s: self.config.section(s) for s in SECTIONS if s != "parameters"},
            **({} if self.adapted is None else {"initial_shape": self.adapted}),
            "units": self.units,
            "seed": self.config.initial.seed,
            "versions": installed_versions(),
            "python": platform.python_version(),
            "platform": platform.platform(),
            "frames": [{"t": t, "file": f"frames/{name}"} for t, name in frames],
        }
        write_text(self.folder / "manifest.json", json.dumps(manifest, indent=2, allow_nan=False))


def _columns(config: Config) -> dict[str, str | None]:
    """The columns of the time series and their dimensions."""
    return STEP_UNITS | observable_units() | input_units(config)


class _GrowingFile:
    """A text file of which one end is always the same, written once and then only extended."""

    def __init__(self, path: Path, end: str = "") -> None:
        self.path, self.end = path, end
        self._place: int | None = None

    def write(self, text: str) -> None:
        """Write all of it, atomically; `text` ends with `end`."""
        self._place = None
        write_text(self.path, text)
        self._place = len(text.encode()) - len(self.end.encode())

    def extend(self, text: str, whole: Callable[[], str]) -> None:
        """Add `text` before the end in one piece; `whole` is what the file shall be after it.

        All of it is written the first time, and where the file is no longer what was written.
        """
        place, self._place = self._place, None
        if place is None or not _has_size(self.path, place + len(self.end.encode())):
            self.write(whole())
            return
        data = text.encode()
        with self.path.open("r+b", buffering=0) as file:
            file.seek(place)
            rest = memoryview(data + self.end.encode())
            while rest:
                rest = rest[file.write(rest) or 0 :]
        self._place = place + len(data)


def _has_size(path: Path, size: int) -> bool:
    try:
        return path.stat().st_size == size
    except FileNotFoundError:
        return False


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
        raise InvalidInput(f"the output folder cannot be made: {error}") from None
    return requested


def _numbered_folder() -> Path:
    names = (f"amoeboid-run-{count}" for count in itertools.count(2))
    for name in itertools.chain(["amoeboid-run"], names):
        try:
            Path(name).mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise InvalidInput(f"the output folder cannot be made: {error}") from None
        break
    return Path(name)


def new_run(folder: Path, config: Config, adapted: Adaptation | None = None) -> Run:
    """Start a run in an empty folder; the files that the configuration names are copied into it.

    `adapted`: what was done to a shape from a file, for the manifest. Raises InvalidInput, before
    anything is written, for a law that no file can hold and for observables with the names of other
    columns.
    """
    config_to_toml(config)
    _check_names(config)
    run = Run(folder, _with_own_files(folder, config))
    run.adapted = None if adapted is None else asdict(adapted)
    run.begin()
    return run


def _with_own_files(folder: Path, config: Config) -> Config:
    """`config` with copies in `folder` of the files it names, by their names there."""
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
    path = folder / "config.toml"
    if not path.is_file():
        raise InvalidInput(
            f"--resume needs the folder of a run, {str(folder)!r} has no config.toml"
        )
    return config_from_toml(text_of(path), repr(str(path)))


def has_checkpoint(folder: Path) -> bool:
    """Whether the run in a folder has come as far as its first checkpoint."""
    return (folder / "checkpoint.npz").is_file()


def restarted_run(folder: Path, config: Config) -> tuple[Run, Step]:
    """A stored run that ended before its first checkpoint, and its initial step; writes nothing.

    Raises InvalidInput if `config` is not the one it was begun with.
    """
    _check_names(config)
    _refuse_changes(resolved(stored_config(folder)), resolved(config))
    run, first = Run(folder, config), start(anchored(config, folder))
    run.adapted = None if first.adapted is None else asdict(first.adapted)
    return run, first


def resumed_run(folder: Path, config: Config) -> tuple[Run, Step]:
    """A stored run, ready to go on, and the step it stopped at; writes nothing.

    Raises InvalidInput if it cannot be read, or if `config` is not the one it was made with.
    """
    if not has_checkpoint(folder):
        raise InvalidInput(f"--resume needs a checkpoint, {str(folder)!r} has none")
    _check_names(config)
    run = Run(folder, config)
    try:
        saved = read_checkpoint(folder / "checkpoint.npz")
        columns = tuple(_columns(saved.config))
        rows = _read_table(folder / "timeseries.csv", saved.step, columns)
    except (OSError, InvalidInput) as error:
        raise InvalidInput(
            f"the run in {str(folder)!r} cannot be read: {error}; start a new one, from one of its "
            "frames with --set initial.from_frame=PATH"
        ) from None
    _refuse_changes(resolved(saved.config), resolved(config))
    run.rows = rows
    run.adapted = _adapted(folder)
    run.frame_times = [(t, _frame_name(count)) for count, t in enumerate(saved.frame_times)]
    run._times = array("d", saved.frame_times)
    run._last, run._begins_after = saved.step, saved.step.state.t
    return run, saved.step


def _adapted(folder: Path) -> dict[str, Any] | None:
    """What the manifest of a stored run says was done to its initial shape, if it can be read."""
    try:
        shape = json.loads(text_of(folder / "manifest.json"))["initial_shape"]
        repairs, scaling = shape["repairs"], shape["scaling"]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None
    texts = [*repairs, scaling or ""] if isinstance(repairs, list) else [None]
    return {"repairs": repairs, "scaling": scaling} if _are_texts(texts) else None


def _are_texts(values: list[Any]) -> bool:
    return all(isinstance(value, str) for value in values)


def _check_names(config: Config) -> None:
    """Raise InvalidInput for an observable that has the name of another column."""
    vectors = [f"{name}_{axis}" for name in VECTORS for axis in "xyz"]
    columns = [*STEP_UNITS, *OBSERVABLES, *vectors, *input_units(config)]
    twice = [name for name in columns if columns.count(name) > 1]
    if twice:
        raise InvalidInput(
            f"an observable must have a name of its own, {twice[0]!r} is another column of the "
            "time series; rename it"
        )


def _refuse_changes(made_with: Config, wanted: Config) -> None:
    for section in ("parameters", "mesh", "initial", "changes", "cue"):
        before, now = made_with.section(section), wanted.section(section)
        for name in {**before, **now}:
            was, is_ = before.get(name), now.get(name)
            if was != is_:
                raise InvalidInput(
                    f"--resume keeps [{section}] as it was, {name} = {was}, got {is_}; only "
                    "time.* and output.* may change, start a new run for the rest"
                )


def write_frame(path: Path, step: Step) -> None:
    """Write one step as VTK PolyData (.vtp): nodes, triangles, and node fields.

    Fields: c, v_p, v_c, v (frame of the nodes), retrograde_flow (frame of the cell), normal.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    state, flow, faces = step.state, step.flow, step.model.mesh.faces
    surface = vtkPolyData()
    points = vtkPoints()
    points.SetData(numpy_to_vtk(state.r, deep=True))
    surface.SetPoints(points)
    cells = vtkCellArray()
    triangles = np.column_stack([np.full(len(faces), 3), faces]).ravel()
    cells.ImportLegacyFormat(numpy_to_vtkIdTypeArray(triangles, deep=True))
    surface.SetPolys(cells)
    fields = {
        "c": state.c,
        "v_p": flow.v_p,
        "v_c": flow.v_c,
        "v": flow.v,
        "retrograde_flow": retrograde_flow(step.model, state, flow),
        "normal": flow.normals,
    }
    for name, values in fields.items():
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        surface.GetPointData().AddArray(array)
    surface.GetPointData().SetActiveScalars("c")
    for name, value in (
        ("t", [state.t]),
        ("zeta0", [state.zeta0]),
        ("cortex_drag_position", state.position),
    ):
        array = numpy_to_vtk(np.asarray(value, dtype=float), deep=True)
        array.SetName(name)
        surface.GetFieldData().AddArray(array)
    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(surface)
    if writer.Write() != 1:
        raise OSError(f"the frame {str(path)!r} could not be written")


def _frame_name(count: int) -> str:
    return f"frame_{count:05d}.vtp"


_COLLECTION_END = "  </Collection>\n</VTKFile>\n"


def _collection(frame_times: list[tuple[float, str]]) -> str:
    """ParaView's list of frames and their times (.pvd)."""
    return "".join(
        [
            '<?xml version="1.0"?>\n',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n',
            "  <Collection>\n",
            *(_entry(t, name) for t, name in frame_times),
            _COLLECTION_END,
        ]
    )


def _entry(t: float, name: str) -> str:
    return f'    <DataSet timestep="{t!r}" part="0" file={quoteattr(f"frames/{name}")}/>\n'


def _table(columns: Sequence[str], rows: Sequence[dict[str, float]]) -> str:
    return _csv([columns]) + _lines(rows)


def _lines(rows: Sequence[dict[str, float]]) -> str:
    return _csv([list(row.values()) for row in rows])


def _csv(lines: Sequence[Sequence[str | float]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


def _read_table(path: Path, last: Step, columns: Sequence[str]) -> list[dict[str, float]]:
    """The rows up to a step. Raises InvalidInput unless they are those of its run, OSError.

    What comes after that step is not read: a run that was killed may have left half a row.
    """
    rows: list[dict[str, float]] = []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            table = csv.reader(file, strict=True)
            _check_columns(next(table, []), columns)
            for line in table:
                if len(line) != len(columns):
                    raise ValueError(f"its columns are not {', '.join(columns)}")
                rows.append(_row(columns, line))
                if rows[-1]["step"] == last.number:
                    break
    except (ValueError, csv.Error) as error:
        raise InvalidInput(f"timeseries.csv must be a table as a run writes it: {error}") from None
    if not all(math.isfinite(x) for row in rows for x in row.values()):
        raise InvalidInput("timeseries.csv must hold finite numbers")
    if any(a["step"] >= b["step"] or a["t"] >= b["t"] for a, b in itertools.pairwise(rows)):
        raise InvalidInput("the rows of timeseries.csv must be in the order of time")
    if not rows or (rows[-1]["step"], rows[-1]["t"]) != (last.number, last.state.t):
        raise InvalidInput(f"timeseries.csv lacks step {last.number} of the checkpoint")
    return rows


def _row(columns: Sequence[str], line: Sequence[str]) -> dict[str, float]:
    whole = {"step", "rejected"}
    return {k: int(x) if k in whole else float(x) for k, x in zip(columns, line, strict=True)}


def _check_columns(found: Sequence[str], columns: Sequence[str]) -> None:
    """Raise ValueError unless a table has the columns that a run would add to."""
    if tuple(found) == tuple(columns):
        return
    missing, unknown = (
        [c for c in columns if c not in found],
        [c for c in found if c not in columns],
    )
    if found and found[0] == columns[0] and len(set(found)) == len(found) and (missing or unknown):
        parts = [f"it lacks the observables {', '.join(missing)}"] if missing else []
        parts += [f"{', '.join(unknown)} is no observable of this program"] if unknown else []
        detail = f": {' and '.join(parts)}; register the observables that the run began with"
    else:
        detail = ""
    raise ValueError(f"its columns are not {', '.join(columns)}{detail}")
