"""A run's folder: manifest, configuration, time series, frames, checkpoint.

    manifest.json        status, parameters, versions, platform, seed, summary
    config.toml          the configuration; `amoeboid run config.toml` repeats the run
    initial_*            copy of the surface or frame the run started from, if it did from a file
    timeseries.csv       one row an accepted step
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
import os
import platform
import re
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from amoeboid.config import Config, config_from_toml, config_to_toml, resolved
from amoeboid.observables import COLUMNS as OBSERVED_COLUMNS
from amoeboid.observables import components, observed, retrograde_flow
from amoeboid.simulation import Step
from amoeboid.surface.mesh import connectivity
from amoeboid.surface.model import Flow, Model, State
from amoeboid.validation import InvalidInput

Array = NDArray[Any]

STEP_COLUMNS = ("step", "t", "dt", "rejected", "rate", "x", "y", "z")
COLUMNS = (*STEP_COLUMNS, *OBSERVED_COLUMNS)
PACKAGES = ("amoeboid", "numpy", "scipy", "numba", "vtk", "pyvista")
# Names of the copies of the files that a run starts from.
COPIES = {"surface": "initial_surface", "from_frame": "initial_frame"}
_FRAME_NAME = re.compile(r"frame_\d{5,}\.vtp")


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
    """A run's folder, open for appending. Made by `new_run` or `resumed_run`."""

    def __init__(self, folder: Path, config: Config) -> None:
        self.folder = folder
        self.config = resolved(config)
        self.rows: list[dict[str, float]] = []
        self.frame_times: list[tuple[float, str]] = []

    def begin(self) -> None:
        """Write the configuration and a manifest that says the run is under way."""
        write_text(self.folder / "config.toml", config_to_toml(self.config))
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
        name = f"frame_{len(self.frame_times):05d}.vtp"
        (self.folder / "frames").mkdir(exist_ok=True)
        write_atomically(self.folder / "frames" / name, lambda p: write_frame(p, step))
        self.frame_times.append((step.state.t, name))
        write_text(self.folder / "frames.pvd", _collection(self.frame_times))
        write_text(self.folder / "timeseries.csv", _table(self.rows))
        write_atomically(self.folder / "checkpoint.npz", lambda p: _write_checkpoint(p, self, step))

    def write_manifest(self, status: str, **more: Any) -> None:
        """Write manifest.json; `status` is running, finished, interrupted or diverged."""
        manifest = {
            "status": status,
            **more,
            "parameters": self.config.parameters.as_dict(),
            **{s: asdict(getattr(self.config, s)) for s in ("mesh", "initial", "time", "output")},
            "seed": self.config.initial.seed,
            "versions": {name: version(name) for name in PACKAGES},
            "python": platform.python_version(),
            "platform": platform.platform(),
            "frames": [{"t": t, "file": f"frames/{name}"} for t, name in self.frame_times],
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


def new_run(folder: Path, config: Config) -> Run:
    """Start a run in an empty folder; the files that the configuration names are copied into it."""
    run = Run(folder, _with_own_files(folder, config))
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
    return config_from_toml(text_of(path))


def resumed_run(folder: Path, config: Config) -> tuple[Run, Step]:
    """A stored run, ready to go on, and the step it stopped at; writes nothing.

    Raises InvalidInput if it cannot be read, or if `config` is not the one it was made with.
    """
    path = folder / "checkpoint.npz"
    if not path.is_file():
        raise InvalidInput(f"--resume needs a checkpoint, {str(folder)!r} has none")
    try:
        made_with, step, frame_times = _read_checkpoint(path)
        rows = _read_table(folder / "timeseries.csv", step.number)
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise InvalidInput(f"the run in {str(folder)!r} cannot be read: {error}") from None
    for section in ("parameters", "mesh", "initial"):
        if getattr(config, section) != getattr(made_with, section):
            raise InvalidInput(
                f"--resume keeps [{section}] as it was; only time.* and output.* may change, "
                "start a new run for the rest"
            )
    run = Run(folder, config)
    run.rows, run.frame_times = rows, frame_times
    return run, step


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


def _read_table(path: Path, last_step: int) -> list[dict[str, float]]:
    with path.open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    whole = {"step", "rejected"}
    rows = [{k: int(v) if k in whole else float(v) for k, v in row.items()} for row in table]
    rows = [row for row in rows if row["step"] <= last_step]
    if not rows or rows[-1]["step"] != last_step:
        raise ValueError(f"timeseries.csv lacks step {last_step} of the checkpoint")
    return rows


def _write_checkpoint(path: Path, run: Run, step: Step) -> None:
    arrays = {
        "config": np.array(config_to_toml(run.config)),
        "step": np.array([step.number, step.rejected]),
        "numbers": np.array([step.next_dt, step.rate]),
        "steady": np.array(step.steady),
        "frame_times": np.array([t for t, _ in run.frame_times]),
        "frame_names": np.array([name for _, name in run.frame_times]),
        "faces": step.model.mesh.faces,
        "edge_length": np.array(step.model.edge_length),
        **_packed(step.history),
        "flow_vectors": np.stack([step.flow.v_c, step.flow.v_p, step.flow.normals]),
        "flow_areas": step.flow.node_areas,
        "flow_zeta0": np.array(step.flow.zeta0),
    }
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def _packed(history: tuple[State, ...]) -> dict[str, Array]:
    return {
        "history_r": np.stack([s.r for s in history]),
        "history_c": np.stack([s.c for s in history]),
        "history_scalars": np.array([(s.t, s.zeta0) for s in history]),
        "history_position": np.stack([s.position for s in history]),
    }


def _unpacked(data: Any, n_nodes: int) -> tuple[tuple[State, ...], Flow]:
    """States and flow of a checkpoint. Raises ValueError unless all its parts fit together."""
    r, c, position = (data[f"history_{name}"] for name in ("r", "c", "position"))
    scalars, vectors, areas = data["history_scalars"], data["flow_vectors"], data["flow_areas"]
    n = len(r)
    shapes = {
        "history_r": (r, (n, n_nodes, 3)),
        "history_c": (c, (n, n_nodes)),
        "history_position": (position, (n, 3)),
        "history_scalars": (scalars, (n, 2)),
        "flow_vectors": (vectors, (3, n_nodes, 3)),
        "flow_areas": (areas, (n_nodes,)),
    }
    for name, (array, shape) in shapes.items():
        if n == 0 or array.shape != shape:
            raise ValueError(f"{name} of the checkpoint has shape {array.shape}, not {shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} of the checkpoint holds values that are not finite")
    if c.min() < 0:
        raise ValueError("the checkpoint holds a negative concentration")
    history = tuple(
        State(float(t), r[k], c[k], float(zeta0), position[k])
        for k, (t, zeta0) in enumerate(scalars)
    )
    v_c, v_p, normals = vectors
    return history, Flow(v_c, v_p, float(data["flow_zeta0"]), normals, areas)


def _read_checkpoint(path: Path) -> tuple[Config, Step, list[tuple[float, str]]]:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
        made_with = config_from_toml(str(data["config"]))
        mesh, edge_length = connectivity(data["faces"]), float(data["edge_length"])
        if not edge_length > 0:
            raise ValueError(f"edge_length of the checkpoint is {edge_length}")
        history, flow = _unpacked(data, mesh.n_nodes)
        number, rejected = (int(x) for x in data["step"])
        next_dt, rate = (float(x) for x in data["numbers"])
        names = [str(x) for x in data["frame_names"]]
        times = [float(x) for x in data["frame_times"]]
        steady = bool(data["steady"])
    if not all(_FRAME_NAME.fullmatch(name) for name in names):
        raise ValueError("a frame name in the checkpoint is not one of this program's")
    model = Model(made_with.parameters, mesh, edge_length)
    step = Step(number, model, history, flow, next_dt, rejected, rate, steady)
    return made_with, step, list(zip(times, names, strict=True))
