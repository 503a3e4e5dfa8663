"""The checkpoint of a run: all that it continues from, bit for bit.

NumPy arrays, never pickled objects. A file may be damaged or made up: what is read must be a step
that this program could have written, or it is refused.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zipfile import ZipFile, is_zipfile

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.config import Config, config_from_toml, config_to_toml, resolved
from amoeboid.meshes.checks import MAX_NODES, MIN_NODES
from amoeboid.meshes.connectivity import Connectivity, connectivity
from amoeboid.meshes.geometry import area, equilateral_edge_length, volume
from amoeboid.output.atomic import write_atomically
from amoeboid.output.frames import FrameFiles
from amoeboid.output.timeseries import TimeSeriesFile
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.step import Step
from amoeboid.simulation.step_length import KEPT
from amoeboid.surface.explicit import MAX_AREA_ERROR
from amoeboid.surface.model import Model
from amoeboid.surface.stability import Growth
from amoeboid.surface.state import Flow, State
from amoeboid.surface.steadiness import Rest
from amoeboid.surface.stepping import StepFailed, check_step
from amoeboid.validation import InvalidInput

# Type and shape of every array; equal names are equal numbers, none of them 0.
_LAYOUT: dict[str, tuple[type[np.generic], tuple[int | str, ...]]] = {
    "config": (np.str_, ()),
    "step": (np.int64, (2,)),
    "numbers": (np.float64, (2,)),
    "rest_known": (np.bool_, (2,)),
    "rest": (np.float64, (3,)),
    "rest_problem": (np.str_, ()),
    "frame_times": (np.float64, ("frames",)),
    "faces": (np.int64, ("triangles", 3)),
    "edge_length": (np.float64, ()),
    "tried_known": (np.bool_, ()),
    "tried": (np.float64, ("nodes", 3)),
    "history_r": (np.float64, ("states", "nodes", 3)),
    "history_c": (np.float64, ("states", "nodes")),
    "history_scalars": (np.float64, ("states", 2)),
    "history_position": (np.float64, ("states", 3)),
    "history_angular_velocity_known": (np.bool_, ("states",)),
    "history_angular_velocity": (np.float64, ("states", 3)),
    "flow_vectors": (np.float64, (3, "nodes", 3)),
    "flow_areas": (np.float64, ("nodes",)),
    "flow_zeta0": (np.float64, ()),
}


ARCHIVE = b"PK\x03\x04"  # how an archive begins
MAX_ARRAY = 2**26  # bytes, more than any array of the largest mesh takes


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A step, the configuration of its run, and the times of the frames written so far.

    The last frame may lie before the step, within the one that led to it; the next is not yet due.
    """

    config: Config
    step: Step
    frame_times: Sequence[float]


class CheckpointFile:
    """Writes a checkpoint whenever frames are due, or its own schedule says so.

    The rows up to it are written first; see `amoeboid.simulation.writers`.
    """

    def __init__(
        self,
        path: Path,
        given: Config,
        series: TimeSeriesFile,
        frames: FrameFiles,
        schedule: Schedule,
    ) -> None:
        self.path, self.given, self.schedule = path, given, schedule
        self._series, self._frames = series, frames
        self._written = config_to_toml(given)

    def due(self, step: Step) -> bool:
        """Whether a checkpoint is due."""
        return bool(self._frames.due(step) or self.schedule.due(step.state.t))

    def write(self, step: Step) -> None:
        """Write the rows, and the checkpoint."""
        self._series.flush()
        checkpoint = Checkpoint(self.given, step, self._frames.times)
        write_atomically(self.path, lambda p: _write(p, checkpoint, self._written))
        self.schedule.latest = step.state.t

    def finish(self, step: Step) -> None:
        """Write the checkpoint of the last step."""
        self.write(step)


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint; `read_checkpoint` reads it back with the same bits."""
    _write(path, checkpoint, config_to_toml(checkpoint.config))


def _write(path: Path, checkpoint: Checkpoint, config: str) -> None:
    step = checkpoint.step
    arrays: dict[str, Any] = {
        "config": np.array(config),
        "step": np.array([step.number, step.rejected]),
        "numbers": np.array([step.next_dt, step.rate]),
        "rest_known": np.array([step.rest is not None, step.growth is not None]),
        "rest": np.array(
            [step.rest.since if step.rest else 0.0, step.growth or 0.0, step.growth_error or 0.0]
        ),
        "rest_problem": np.array(step.rest.growth.problem if step.rest else ""),
        "frame_times": np.array(checkpoint.frame_times),
        "faces": step.model.mesh.faces,
        "edge_length": np.array(step.model.edge_length),
        "tried_known": np.array(step.tried is not None),
        "tried": step.state.r if step.tried is None else step.tried,
        "history_r": np.stack([s.r for s in step.history]),
        "history_c": np.stack([s.c for s in step.history]),
        "history_scalars": np.array([(s.t, s.zeta0) for s in step.history]),
        "history_position": np.stack([s.position for s in step.history]),
        "history_angular_velocity_known": np.array(
            [s.angular_velocity is not None for s in step.history]
        ),
        "history_angular_velocity": np.stack(
            [
                np.zeros(3) if s.angular_velocity is None else s.angular_velocity
                for s in step.history
            ]
        ),
        "flow_vectors": np.stack([step.flow.v_c, step.flow.v_p, step.flow.normals]),
        "flow_areas": step.flow.node_areas,
        "flow_zeta0": np.array(step.flow.zeta0),
    }
    file = io.BytesIO()  # else the archive is written in hundreds of pieces, in twice the time
    np.savez(file, **arrays)
    path.write_bytes(file.getbuffer())


def read_checkpoint(path: Path) -> Checkpoint:
    """The checkpoint in a file. Raises InvalidInput for one that no run has written, OSError."""
    arrays = _laid_out(_arrays(path))
    config = config_from_toml(str(arrays["config"]))
    frame_times = tuple(float(t) for t in arrays["frame_times"])
    step = _step(config, arrays)
    backward = np.diff(frame_times).min(initial=0.0)
    _require(backward == 0, "the times of the frames must be in order", f"a step of {backward:g}")
    t, latest = step.state.t, frame_times[-1] if frame_times else None
    _require(latest is None or latest <= t, f"no frame must be later than t = {t!r}", latest)
    output = resolved(config).output
    due = Schedule(output.interval, output.times, latest).due(t)
    _require(
        not due,
        "frames must have been written when they were due",
        f"none at {due[0] if due else t}",
    )
    return Checkpoint(config, step, frame_times)


def _require(holds: bool | np.bool_, rule: str, found: object) -> None:
    if not holds:
        raise InvalidInput(f"{rule}, got {found} in its checkpoint")


def _arrays(path: Path) -> dict[str, Array]:
    """Whatever arrays a file holds."""
    with path.open("rb") as file:
        begins = file.read(len(ARCHIVE)) == ARCHIVE
    if not begins or not is_zipfile(path):
        raise InvalidInput("its checkpoint is not an archive of arrays (.npz)")
    try:
        with ZipFile(path) as archive:
            there = set(archive.namelist())
            return {
                name: _array(archive, f"{name}.npy") for name in _LAYOUT if f"{name}.npy" in there
            }
    except OSError:
        raise
    except Exception as error:  # damaged archives make their readers raise nearly anything
        raise InvalidInput(f"its checkpoint is damaged: {error}") from None


def _array(archive: ZipFile, name: str) -> Array:
    """An array of an archive. Room is made for what the file holds, not for what it announces."""
    size = archive.getinfo(name).file_size
    if size > MAX_ARRAY:
        raise ValueError(f"{name} must have at most {MAX_ARRAY} bytes, it declares {size}")
    data = io.BytesIO(archive.read(name))
    version = np.lib.format.read_magic(data)
    if version != (1, 0):
        raise ValueError(f"{name} must be an array of version 1.0, got {version}")
    shape, fortran, kind = np.lib.format.read_array_header_1_0(data)
    count = math.prod(shape)
    body = data.getvalue()[data.tell() :]
    if kind.hasobject or count * kind.itemsize != len(body):
        raise ValueError(f"{name} must be an array of {shape} numbers, it has {len(body)} bytes")
    flat: Array = np.frombuffer(body, kind, count) if len(body) else np.zeros(count, kind)
    return flat.reshape(shape, order="F" if fortran else "C")


def _laid_out(arrays: dict[str, Array]) -> dict[str, Array]:
    """The arrays in C order. Raises InvalidInput unless they are as in `_LAYOUT`, and finite."""
    sizes: dict[int | str, int] = {}
    for name, (kind, shape) in _LAYOUT.items():
        if name not in arrays:
            raise InvalidInput(f"its checkpoint lacks {name}")
        array = arrays[name]
        if array.dtype.type is not kind or not array.dtype.isnative:
            raise InvalidInput(
                f"{name} of its checkpoint must be of type {kind.__name__}, got {array.dtype}"
            )
        fits = array.ndim == len(shape) and (array.size > 0 or name == "frame_times")
        for size, found in zip(shape, array.shape, strict=False):
            fits &= found == (size if isinstance(size, int) else sizes.setdefault(size, found))
        if not fits:
            wanted = ", ".join(str(sizes.get(size, size)) for size in shape)
            raise InvalidInput(
                f"{name} of its checkpoint must have shape ({wanted}), got {array.shape}"
            )
        if kind is np.float64 and not np.isfinite(array).all():
            raise InvalidInput(f"{name} of its checkpoint must be finite")
    return {name: array.copy(order="C") for name, array in arrays.items()}


def _step(config: Config, arrays: dict[str, Array]) -> Step:
    model, history, flow = _model(config, arrays), _history(arrays), _flow(arrays)
    model = model.at(history[0].t, since=history[min(1, len(history) - 1)].t)
    _check_shape(model, history)
    number, rejected = (int(x) for x in arrays["step"])
    next_dt, rate = (float(x) for x in arrays["numbers"])
    _require(min(number, rejected) >= 0, "numbers of steps must be >= 0", min(number, rejected))
    _require(next_dt > 0, "the length of the next step must be > 0", next_dt)
    _require(rate >= 0, "the rate of change must be >= 0", rate)
    rest = _rest(arrays)
    _require(
        rest is None or rest.since <= history[0].t,
        "a state of rest must begin before the current time",
        rest,
    )
    tried = arrays["tried"] if arrays["tried_known"] else None
    return Step(number, model, history, flow, next_dt, rejected, rate, rest, tried=tried)


def _rest(arrays: dict[str, Array]) -> Rest | None:
    resting, growth_known = (bool(x) for x in arrays["rest_known"])
    since, rate, error = (float(x) for x in arrays["rest"])
    _require(resting or not growth_known, "a growth rate requires a cell at rest", rate)
    _require(error >= 0, "the error of a growth rate must be >= 0", error)
    growth = Growth(rate, error) if growth_known else Growth(None)
    return Rest(since, replace(growth, problem=str(arrays["rest_problem"]))) if resting else None


def _model(config: Config, arrays: dict[str, Array]) -> Model:
    mesh = _mesh(arrays["faces"], arrays["history_r"].shape[1])
    edge_length = float(arrays["edge_length"])
    A0 = Model(config.parameters, mesh).A0
    # meshes of V nodes have 2V - 4 triangles; a mesh keeps the length that it began with
    longest, shortest = (equilateral_edge_length(A0, 2 * n - 4) for n in (MIN_NODES, MAX_NODES))
    _require(
        shortest * (1 - 1e-9) <= edge_length <= longest * (1 + 1e-9),
        f"edge_length must be between {shortest:g} and {longest:g}",
        edge_length,
    )
    model = Model(config.parameters, mesh, edge_length).driven(config.inputs)
    return model.with_noise(config.noise)


def _mesh(faces: Index, n_nodes: int) -> Connectivity:
    """Raises InvalidInput unless the faces are a closed surface without handles on all nodes."""
    # node numbers first: room is made for as many nodes as the largest says
    least, most = int(faces.min()), int(faces.max())
    rule = f"the node numbers of triangles must be 0 to {n_nodes - 1}"
    _require((least, most) == (0, n_nodes - 1), rule, f"{least} to {most}")
    rule = f"a closed surface of {n_nodes} nodes without handles must have {2 * n_nodes - 4} faces"
    _require(len(faces) == 2 * n_nodes - 4, rule, len(faces))
    return connectivity(faces)


def _history(arrays: dict[str, Array]) -> tuple[State, ...]:
    names = ("r", "c", "position", "angular_velocity")
    r, c, position, turning = (arrays[f"history_{name}"] for name in names)
    times, tensions = arrays["history_scalars"].T
    _require(len(times) <= KEPT, f"at most {KEPT} states are kept", len(times))
    _require(times[-1] >= 0, "times must be >= 0", times[-1])
    least = -np.diff(times).max(initial=-np.inf)
    _require(least > 0, "the times of the states must be in order", f"a step of {least:g}")
    _require(c.min() >= 0, "concentrations must be >= 0", c.min())
    return tuple(
        State(
            float(times[k]),
            r[k],
            c[k],
            float(tensions[k]),
            position[k],
            turning[k] if arrays["history_angular_velocity_known"][k] else None,
        )
        for k in range(len(r))
    )


def _flow(arrays: dict[str, Array]) -> Flow:
    v_c, v_p, normals = arrays["flow_vectors"]
    areas = arrays["flow_areas"]
    _require(areas.min() > 0, "areas of nodes must be > 0", areas.min())
    return Flow(v_c, v_p, float(arrays["flow_zeta0"]), normals, areas)


def _check_shape(model: Model, history: tuple[State, ...]) -> None:
    """Raise InvalidInput unless the step could have been accepted."""
    now, *earlier = history
    faces = model.mesh.faces
    for state in history:
        ratio = area(state.r, faces) / model.A0
        _require(
            abs(ratio - 1.0) <= MAX_AREA_ERROR, "areas must be 4 pi R0^2", f"{ratio:g} times that"
        )
        enclosed = volume(state.r, faces)
        _require(enclosed > 0, "triangles must be oriented outward, volume > 0", f"{enclosed:g}")
    try:
        check_step(model, earlier[0] if earlier else now, now)
    except StepFailed as error:
        raise InvalidInput(f"its checkpoint must hold a valid cell: {error}") from None
