"""Reads the frames that a run has written, without VTK.

Of the format .vtp it knows what `frames.write_frame` makes of it: one piece, triangles, arrays as
they are; and what it made of it in version 0.1, arrays in base64 of zlib. Nothing in a file is run,
and no more is unpacked than its header announces; other surfaces are read by
`amoeboid.meshes.files`.
"""

from __future__ import annotations

import binascii
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.checks import MAX_NODES
from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.geometry import area, node_areas, volume
from amoeboid.model.inputs import Inputs
from amoeboid.model.parameters import Parameters
from amoeboid.output.frames import APPENDED, CHECKSUM, HEADER
from amoeboid.surface.explicit import MAX_AREA_ERROR
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.validation import InvalidInput

_ARRAY = re.compile(rb'<DataArray type="(\w+)" Name="(\w+)"[^>]*? offset="(\d+)"')
_TYPES = {b"Float64": np.dtype("<f8"), b"Int64": np.dtype("<i8")}
_HEADER_0_1 = b'byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor"'
MAX_EXTENT = 1e3  # of points [R0]; those of a cell of the area 4 pi R0^2 hardly reach 10
MAX_NORMAL_ERROR = 1e-6  # of their squares
ABSURD = 1e12
MAX_BYTES = 3 * 2 * 8 * MAX_NODES  # of one array: the triangles of the largest mesh


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
        return _frame(_arrays(data), p, inputs)
    except (ValueError, KeyError, IndexError, zlib.error, binascii.Error) as error:
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
    """Raise ValueError for what is no cell of these parameters, or is absurd."""
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


def _arrays(data: bytes) -> dict[str, Array]:
    """All arrays of a file by name; of those of cells the ones of the triangles."""
    head, found, body = data.partition(APPENDED.encode())
    unpacked = _raw
    if not found:
        head, found, body = data.partition(b'<AppendedData encoding="base64">')
        unpacked = _unpacked
    if not found or (HEADER.encode() if unpacked is _raw else _HEADER_0_1) not in head:
        raise ValueError("it is damaged or of another type")
    body = body[body.index(b"_") + 1 :]
    polys = head.index(b"<Polys>")
    others = (head.index(b"<Points>"), *(p for p in [head.find(b"<Verts>")] if p >= 0))
    arrays: dict[str, Array] = {}
    checksum = 0
    for match in _ARRAY.finditer(head):
        kind, name, offset = match.groups()
        if min(others) < match.start() < polys and name != b"Points":
            continue  # vertices, lines and strips, of which there are none
        found_array = unpacked(body, int(offset), _TYPES[kind])
        arrays.setdefault(name.decode(), found_array)
        checksum = crc32(found_array.astype(_TYPES[kind]).tobytes(), checksum)
    if unpacked is _raw and CHECKSUM.format(checksum).encode() not in head:
        raise ValueError("its arrays are damaged")
    return arrays


def _raw(body: bytes, start: int, kind: np.dtype) -> Array:
    """The numbers of one array, which lie behind their size in bytes."""
    size = int.from_bytes(body[start : start + 8], "little")
    block = body[start + 8 : start + 8 + size]
    if len(block) != size:
        raise ValueError("it is damaged: it ends early")
    return np.frombuffer(block, kind).astype(kind.newbyteorder("="))


def _unpacked(body: bytes, start: int, kind: np.dtype) -> Array:
    """The numbers of one array: a header of sizes, then its blocks."""
    (count,) = np.frombuffer(_decoded(body, start, 4), "<u4")
    if count > MAX_BYTES // 2**10:
        raise ValueError("its declared size is too large")
    header = np.frombuffer(_decoded(body, start, 12 + 4 * int(count)), "<u4").astype(int)
    start += _encoded(12 + 4 * int(count))
    packed = _decoded(body, start, int(header[3:].sum()))
    size, last = int(header[1]), int(header[2])
    parts, place = [], 0
    for k, length in enumerate(header[3:]):
        wanted = last if last and k == count - 1 else size
        if wanted * count > 2 * MAX_BYTES:
            raise ValueError("its declared size is too large")
        part = zlib.decompressobj().decompress(packed[place : place + length], wanted)
        if len(part) != wanted:
            raise ValueError("it is damaged")
        parts.append(part)
        place += length
    return np.frombuffer(b"".join(parts), kind).astype(kind.newbyteorder("="))


def _encoded(length: int) -> int:
    """Characters of so many bytes in base64."""
    return 4 * -(-length // 3)


def _decoded(body: bytes, start: int, length: int) -> bytes:
    if start + _encoded(length) > len(body):
        raise ValueError("it is damaged: it ends early")
    return binascii.a2b_base64(body[start : start + _encoded(length)])[:length]
