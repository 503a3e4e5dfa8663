"""Reads the frames that a run has written: model, state and flow of one time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.checks import MAX_NODES
from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.geometry import area, node_areas, volume
from amoeboid.meshes.vtp import UNREADABLE, vtp_arrays
from amoeboid.model.inputs import Inputs
from amoeboid.model.parameters import Parameters
from amoeboid.surface.explicit import MAX_AREA_ERROR
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.validation import InvalidInput

MAX_EXTENT = 1e3  # of points [R0]; those of a cell of the area 4 pi R0^2 hardly reach 10
MAX_NORMAL_ERROR = 1e-6  # of their squares
ABSURD = 1e12


@dataclass(frozen=True, eq=False)
class Frame:
    """Model, state and flow of one time."""

    model: Model
    state: State
    flow: Flow


def read_frame(path: Path, p: Parameters, inputs: Inputs | None = None) -> Frame:
    """A frame of a run with parameters p, under these inputs.

    Raises InvalidInput, also where it is not there.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidInput(f"the frame {str(path)!r} cannot be read: {error.strerror}") from None
    try:
        return _frame(vtp_arrays(data), p, inputs)
    except UNREADABLE as error:
        raise InvalidInput(
            f"the frame {str(path)!r} must be a frame that a run has written: {error}"
        ) from None


def _frame(arrays: dict[str, Array], p: Parameters, inputs: Inputs | None) -> Frame:
    c = _numbers(arrays, "c", (-1,))
    if len(c) > MAX_NODES:
        raise ValueError(f"it must have at most {MAX_NODES} points, got {len(c)}")
    r, v_c, v_p, normals = (
        _numbers(arrays, name, (len(c), 3)) for name in ("Points", "v_c", "v_p", "normal")
    )
    position = _numbers(arrays, "cortex_drag_position", (3,))
    t, zeta0 = (float(_numbers(arrays, name, (1,))[0]) for name in ("t", "zeta0"))
    if t < 0.0 or c.min() < 0.0:
        raise ValueError("its time and concentrations must be >= 0")
    faces: Index = arrays["connectivity"].reshape(-1, 3)
    if faces.dtype.kind != "i" or faces.min() != 0 or faces.max() != len(c) - 1:
        raise ValueError("its triangles must refer to its points")
    model = Model(p, connectivity(faces)).driven(inputs)
    since = max((jump for jump in model.breaks if jump < t), default=0.0)
    model = model.at(t, since)
    _check_cell(model, r, c, (v_c, v_p), normals)
    state = State(t, r, c, zeta0, position)
    return Frame(model, state, Flow(v_c, v_p, zeta0, normals, node_areas(r, faces)))


def _numbers(arrays: dict[str, Array], name: str, shape: tuple[int, ...]) -> Array:
    """An array of finite numbers in double precision. Raises ValueError, KeyError."""
    found = arrays[name].reshape(shape)
    if found.dtype.kind != "f" or not np.isfinite(found).all():
        raise ValueError(f"its numbers must be finite and real, {name} is not")
    return found


def _check_cell(
    model: Model, r: Array, c: Array, velocities: tuple[Array, ...], normals: Array
) -> None:
    """Raise ValueError for a value that is not a cell of these parameters, or is absurd."""
    p = model.parameters
    if np.abs(r).max() > MAX_EXTENT * p.R0:
        raise ValueError(f"its points must lie within {MAX_EXTENT:g} R0")
    faces = model.mesh.faces
    ratio, enclosed = area(r, faces) / model.A0, volume(r, faces)
    if abs(ratio - 1.0) > MAX_AREA_ERROR or not enclosed > 0.0:
        raise ValueError(
            f"its area must be 4 pi R0^2 and its volume > 0, got {ratio:g} times that and "
            f"{enclosed:g}"
        )
    if node_areas(r, faces).min() <= 0.0:
        raise ValueError("the areas of its points must be > 0")
    if np.abs(np.einsum("vi,vi->v", normals, normals) - 1.0).max() > MAX_NORMAL_ERROR:
        raise ValueError("its normals must have length 1")
    fastest = max(np.abs(v).max() for v in velocities)
    if fastest > ABSURD * model.rate * p.R0 or c.max() > ABSURD * max(p.c0, p.c_r):
        raise ValueError("its velocities and concentrations are too large")
