"""Surface files (.stl, .ply, .obj, .vtp) as arrays.

STL, PLY, OBJ and the .vtp of this package are read here. VTK reads other .vtp in a process of its
own: on damaged files it ends the program or reads past the end of what it has, and it prints.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array, Index
from amoeboid.extras import check
from amoeboid.meshes import vtk_process
from amoeboid.meshes.obj import read_obj
from amoeboid.meshes.ply import read_ply
from amoeboid.meshes.polygons import Unreadable, triangulated
from amoeboid.meshes.stl import read_stl
from amoeboid.meshes.vtp import APPENDED, UNREADABLE, vtp_arrays
from amoeboid.validation import InvalidInput

READERS = {"stl": read_stl, "ply": read_ply, "obj": read_obj}
FORMATS = (*READERS, "vtp")
PACKED = ("gz", "bz2", "xz", "zst", "zip", "7z")
# Five times what a text file of the largest mesh needs.
MAX_FILE_SIZE = 2**27  # bytes
# A file of the largest mesh takes a second.
LONGEST_READING = 120.0  # seconds
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
# How files of other types begin.
SIGNATURES = {
    b"\x1f\x8b": "packed (gzip); unpack it",
    b"BZh": "packed (bzip2); unpack it",
    b"\xfd7zXZ": "packed (xz); unpack it",
    b"PK\x03\x04": "packed (zip); unpack it",
    b"\xff\xfe": "text in UTF-16; save it as plain text (UTF-8)",
    b"\xfe\xff": "text in UTF-16; save it as plain text (UTF-8)",
    b"version https://git-lfs": "not the file but a reference to it (Git LFS); fetch the file",
}
VECTORS = "vectors "  # before the names of vectors among the arrays of a file
BEGINNINGS = {b"ply": "ply", b"solid": "stl", b"<?xml": "vtp", b"<VTKFile": "vtp"}


@dataclass(frozen=True, eq=False)
class SurfaceFile:
    """What a file holds: nodes r (V, 3), faces (F, 3), and the fields of a frame, if it has them.

    c (V,) or None; `fields` whatever else of a frame was found: t, zeta0; `vectors` (V, 3) at the
    nodes by their names.
    """

    r: Array
    faces: Index
    c: Array | None
    fields: dict[str, float]
    vectors: dict[str, Array] = field(default_factory=dict)


def surface_file(path: str, field: str, formats: tuple[str, ...] = FORMATS) -> SurfaceFile:
    """The surface in a file, unchecked apart from the numbers of its points.

    Raises InvalidInput, naming the configuration's `field`; also where VTK is needed and missing.
    """
    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in formats:
        allowed = ", ".join("." + name for name in formats)
        helps = "unpack it" if kind in PACKED else "convert it"
        raise InvalidInput(f"{field} must be a file of type {allowed}, got {path!r}; {helps}")
    data = _data(path, field)
    try:
        _check_beginning(data, kind)
        if kind != "vtp":
            polygons = READERS[kind](data.removeprefix(BYTE_ORDER_MARK))
            return SurfaceFile(polygons.points, triangulated(polygons), None, {})
        contents = _own_vtp(data) or _vtp(path)
    except Unreadable as problem:
        raise InvalidInput(
            f"{field} must hold a surface in the format .{kind}, {path!r} does not: {problem}"
        ) from None
    fields: dict[str, float] = {
        name: float(contents[name].ravel()[0])
        for name in ("t", "zeta0")
        if name in contents and contents[name].size == 1
    }
    faces = contents["faces"].astype(np.int64)
    vectors = {
        name.removeprefix(VECTORS): values
        for name, values in contents.items()
        if name.startswith(VECTORS)
    }
    return SurfaceFile(contents["points"], faces, contents.get("c"), fields, vectors)


def _data(path: str, field: str) -> bytes:
    """The bytes of a file. Raises InvalidInput."""
    try:
        if Path(path).is_file():
            with Path(path).open("rb") as file:
                data = file.read(MAX_FILE_SIZE + 1)
            if len(data) <= MAX_FILE_SIZE:
                return data
            found = f"it is larger than {MAX_FILE_SIZE >> 20} MiB; export it with fewer triangles"
        else:
            found = "it is not a regular file" if Path(path).exists() else "there is none"
    except OSError as error:
        found = str(error.strerror)
    raise InvalidInput(f"{field} must be a readable file, got {path!r}: {found}")


def _check_beginning(data: bytes, kind: str) -> None:
    """Raise Unreadable for files that begin as those of another type do."""
    if not data.strip(b" \t\r\n\0"):
        raise Unreadable("it is empty")
    for signature, says in SIGNATURES.items():
        if data.startswith(signature):
            raise Unreadable(f"it is {says}")
    begin = data.removeprefix(BYTE_ORDER_MARK).lstrip()[:16].split()
    other = BEGINNINGS.get(begin[0], kind) if begin else kind
    if other != kind and not (other == "stl" and kind == "obj"):
        raise Unreadable(f"it begins like a file of type .{other}; rename it if it is one")


def _own_vtp(data: bytes) -> dict[str, NDArray]:
    """The arrays of a file that this package has written, as `vtk_process` names them; else {}."""
    if APPENDED.encode() not in data:
        return {}
    try:
        arrays = vtp_arrays(data)  # with the checksum that this package alone writes
        points = arrays["Points"].reshape(-1, 3)
        faces = arrays["connectivity"].reshape(-1, 3)
        if faces.min() < 0 or faces.max() >= len(points):
            return {}
    except UNREADABLE:
        return {}
    contents = {name: arrays[name] for name in ("c", "t", "zeta0") if name in arrays}
    vectors = {
        VECTORS + name: values.reshape(-1, 3)
        for name, values in arrays.items()
        if name not in ("Points", "connectivity", "offsets") and values.size == points.size
    }
    return {"points": points, "faces": faces, **contents, **vectors}


def _vtp(path: str) -> dict[str, NDArray]:
    """The arrays that the process of VTK leaves in a file. Raises Unreadable."""
    check("a surface as .vtp, of another program or damaged, needs", "vtkmodules")
    damaged = Unreadable("it is damaged or of another type; export it again")
    with tempfile.TemporaryDirectory(prefix="amoeboid-") as folder:
        answer = Path(folder) / "surface.npz"
        command = [sys.executable, "-P", vtk_process.__file__]
        command += [str(Path(path).absolute()), str(answer)]
        try:
            # what it prints says nothing: programs may print whenever Python starts
            done = subprocess.run(  # noqa: S603  (our own program; the paths are arguments)
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=LONGEST_READING,
            )
        except subprocess.TimeoutExpired:
            raise damaged from None
        if done.returncode != 0 or not answer.is_file():
            raise damaged
        with np.load(answer, allow_pickle=False) as archive:
            contents = dict(archive)
    if "problem" in contents:
        raise Unreadable(str(contents["problem"]))
    return contents
