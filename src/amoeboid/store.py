"""A run's folder: manifest, configuration, time series, frames, checkpoint.

    manifest.json        status, parameters, versions, platform, seed, summary
    config.toml          the configuration as given; `amoeboid run config.toml` repeats the run
    initial_*            copy of the surface or frame the run started from, if it did from a file
    timeseries.csv       one row an accepted step, of the explicit scheme one a frame
    frames.pvd           the frames with their times; open it in ParaView
    frames/*.vtp         surface, concentration and velocities; also for pyvista.read
    checkpoint.npz       what `--resume` goes on from

Every file is written under a temporary name and renamed: a killed run leaves nothing half-written.
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
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from amoeboid.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from amoeboid.config import Config, config_from_toml, config_to_toml, resolved
from amoeboid.observables import COLUMNS as OBSERVED_COLUMNS
from amoeboid.observables import components, observed, retrograde_flow
from amoeboid.simulation import Step
from amoeboid.surface.initial import Adaptation
from amoeboid.validation import InvalidInput
from amoeboid.versions import installed_versions

STEP_COLUMNS = ("step", "t", "dt", "rejected", "rate", "x", "y", "z")
COLUMNS = (*STEP_COLUMNS, *OBSERVED_COLUMNS)
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
    """A run's folder, open for appending. Made by `new_run` or `resumed_run`.

    `given` is the configuration with automatic fields left open, so that they follow the scheme
    and the parameters where it is used again; `config` has every value that the run is made with.
    """

    def __init__(self, folder: Path, given: Config) -> None:
        self.folder = folder
        self.given, self.config = given, resolved(given)
        self.rows: list[dict[str, float]] = []
        self.frame_times: list[tuple[float, str]] = []
        self.adapted: dict[str, Any] | None = None  # what was done to a shape from a file

    def begin(self) -> None:
        """Write the configuration and a manifest that says the run is under way."""
        write_text(self.folder / "config.toml", config_to_toml(self.given))
        self.write_manifest("running")

    def append(self, step: Step) -> dict[str, float]:
        """Take up one step; returns its row of the time series."""
        position = dict(zip("xyz", (float(x) for x in step.state.position), strict=True))
        row = {
            "step": step.number,
            "t": step.state.t,
            "dt": step.dt,
            "rejected": step.rejected,
            "rate": step.rate,
            **position,
            **observed(step.model, step.state, step.flow),
            **components(step.model, step.state, step.flow),
        }
        self.rows.append(row)
        return row

    def row_due(self, step: Step) -> bool:
        """Whether the step belongs into the time series: of explicit ones those with a frame."""
        return self.config.time.scheme != "explicit" or self.frame_due(step)

    def frame_due(self, step: Step) -> bool:
        """Whether output.interval has passed since the last frame."""
        if not self.frame_times:
            return True
        return step.state.t >= self.frame_times[-1][0] + self.config.output.interval * (1 - 1e-9)

    def save(self, step: Step) -> None:
        """Write frame, time series and checkpoint of the latest step."""
        name = _frame_name(len(self.frame_times))
        (self.folder / "frames").mkdir(exist_ok=True)
        write_atomically(self.folder / "frames" / name, lambda p: write_frame(p, step))
        self.frame_times.append((step.state.t, name))
        write_text(self.folder / "frames.pvd", _collection(self.frames()))
        write_text(self.folder / "timeseries.csv", _table(self.rows))
        checkpoint = Checkpoint(self.given, step, tuple(t for t, _ in self.frame_times))
        path = self.folder / "checkpoint.npz"
        write_atomically(path, lambda p: write_checkpoint(p, checkpoint))

    def frames(self) -> list[tuple[float, str]]:
        """Times and names of the frames that are still there; the user may delete some."""
        return [
            (t, name) for t, name in self.frame_times if (self.folder / "frames" / name).is_file()
        ]

    def write_manifest(self, status: str, **more: Any) -> None:
        """Write manifest.json; `status` is running, finished, interrupted, diverged or failed."""
        manifest = {
            "status": status,
            **more,
            "parameters": self.config.parameters.as_dict(),
            **{s: asdict(getattr(self.config, s)) for s in ("mesh", "initial", "time", "output")},
            **({} if self.adapted is None else {"initial_shape": self.adapted}),
            "seed": self.config.initial.seed,
            "versions": installed_versions(),
            "python": platform.python_version(),
            "platform": platform.platform(),
            "frames": [{"t": t, "file": f"frames/{name}"} for t, name in self.frames()],
        }
        write_text(self.folder / "manifest.json", json.dumps(manifest, indent=2, allow_nan=False))


def new_folder(requested: Path | None) -> Path:
    """The folder to write to: `requested`, or the first free of amoeboid-run, amoeboid-run-2, ...

    Raises InvalidInput if `requested` already holds something or cannot be made.
    """
    if requested is None:
        return _numbered_folder()
    if requested.exists() and (not requested.is_dir() or any(requested.iterdir())):
        raise InvalidInput(
            f"the output folder must be new or empty, {str(requested)!r} is not; "
            "choose another with -o, or continue it with --resume"
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

    `adapted`: what was done to a shape from a file, for the manifest.
    """
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


def resumed_run(folder: Path, config: Config) -> tuple[Run, Step]:
    """A stored run, ready to go on, and the step it stopped at; writes nothing.

    Raises InvalidInput if it cannot be read, or if `config` is not the one it was made with.
    """
    path = folder / "checkpoint.npz"
    if not path.is_file():
        raise InvalidInput(f"--resume needs a checkpoint, {str(folder)!r} has none")
    try:
        saved = read_checkpoint(path)
        rows = _read_table(folder / "timeseries.csv", saved.step)
    except (OSError, InvalidInput) as error:
        raise InvalidInput(
            f"the run in {str(folder)!r} cannot be read: {error}; start a new one, from one of its "
            "frames with --set initial.from_frame=PATH"
        ) from None
    _refuse_changes(resolved(saved.config), resolved(config))
    run = Run(folder, config)
    run.rows = rows
    run.adapted = _adapted(folder)
    run.frame_times = [(t, _frame_name(count)) for count, t in enumerate(saved.frame_times)]
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


def _refuse_changes(made_with: Config, wanted: Config) -> None:
    for section in ("parameters", "mesh", "initial"):
        before, now = getattr(made_with, section), getattr(wanted, section)
        for f in fields(before):
            was, is_ = getattr(before, f.name), getattr(now, f.name)
            if was != is_:
                raise InvalidInput(
                    f"--resume keeps [{section}] as it was, {f.name} = {was}, got {is_}; only "
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
    for name, value in (("t", [state.t]), ("zeta0", [state.zeta0]), ("position", state.position)):
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


def _collection(frame_times: list[tuple[float, str]]) -> str:
    """ParaView's list of frames and their times (.pvd)."""
    rows = [
        f'    <DataSet timestep="{t!r}" part="0" file={quoteattr(f"frames/{name}")}/>'
        for t, name in frame_times
    ]
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
            "  <Collection>",
            *rows,
            "  </Collection>",
            "</VTKFile>",
            "",
        ]
    )


def _table(rows: list[dict[str, float]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _read_table(path: Path, last: Step) -> list[dict[str, float]]:
    """The rows up to a step. Raises InvalidInput unless they are those of its run, OSError."""
    whole = {"step", "rejected"}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            names, *table = csv.reader(file, strict=True)
        if tuple(names) != COLUMNS or any(len(line) != len(COLUMNS) for line in table):
            raise ValueError(f"its columns are not {', '.join(COLUMNS)}")
        rows: list[dict[str, float]] = [
            {k: int(x) if k in whole else float(x) for k, x in zip(COLUMNS, line, strict=True)}
            for line in table
        ]
    except (ValueError, csv.Error) as error:
        raise InvalidInput(f"timeseries.csv must be a table as a run writes it: {error}") from None
    rows = [row for row in rows if row["step"] <= last.number]
    if not all(math.isfinite(x) for row in rows for x in row.values()):
        raise InvalidInput("timeseries.csv must hold finite numbers")
    if any(a["step"] >= b["step"] or a["t"] >= b["t"] for a, b in itertools.pairwise(rows)):
        raise InvalidInput("the rows of timeseries.csv must be in the order of time")
    if not rows or (rows[-1]["step"], rows[-1]["t"]) != (last.number, last.state.t):
        raise InvalidInput(f"timeseries.csv lacks step {last.number} of the checkpoint")
    return rows
