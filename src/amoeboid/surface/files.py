"""Surface files (.stl, .ply, .obj, .vtp) as arrays.

They are read by VTK in a process of its own: on damaged files some of its readers end the
program or read past the end of what they have, and all of them print.
"""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface import vtk_process
from amoeboid.surface.mesh import Index
from amoeboid.validation import InvalidInput

Array = NDArray[np.float64]

FORMATS = ("stl", "ply", "obj", "vtp")
# A file of the largest mesh takes a second.
LONGEST_READING = 120.0  # seconds


@dataclass(frozen=True, eq=False)
class SurfaceFile:
    """What a file holds: nodes r (V, 3), faces (F, 3), and the fields of a frame, if it has them.

    c (V,) or None; `fields` whatever else of a frame was found: t, zeta0.
    """

    r: Array
    faces: Index
    c: Array | None
    fields: dict[str, float]


def surface_file(path: str, field: str, formats: tuple[str, ...] = FORMATS) -> SurfaceFile:
    """The surface in a file, unchecked apart from the numbers of its points.

    Raises InvalidInput, naming the configuration's `field`.
    """
    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in formats:
        allowed = ", ".join("." + name for name in formats)
        raise InvalidInput(f"{field} must be a file of type {allowed}, got {path!r}; convert it")
    _check_readable(path, field)
    contents = _contents(path, kind, field)
    c = contents.get("c")
    fields: dict[str, float] = {
        name: float(contents[name].ravel()[0])
        for name in ("t", "zeta0")
        if name in contents and contents[name].size == 1
    }
    return SurfaceFile(contents["points"], contents["faces"].astype(np.int64), c, fields)


def _check_readable(path: str, field: str) -> None:
    try:
        if Path(path).is_file():
            with Path(path).open("rb") as file:
                file.read(1)
            return
        found = "it is no regular file" if Path(path).exists() else "there is none"
    except OSError as error:
        found = str(error.strerror)
    raise InvalidInput(f"{field} must be a readable file, got {path!r}: {found}")


def _contents(path: str, kind: str, field: str) -> dict[str, NDArray]:
    problem = InvalidInput(
        f"{field} must hold a surface in the format .{kind}, {path!r} cannot be read: it is "
        "damaged or of another type; export it anew"
    )
    command = [sys.executable, "-P", vtk_process.__file__, str(Path(path).absolute()), kind]
    try:
        done = subprocess.run(  # noqa: S603  (our own program; the path is one argument)
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST_READING
        )
    except subprocess.TimeoutExpired:
        raise problem from None
    if done.returncode != 0:
        raise problem
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        contents = dict(archive)
    if "problem" in contents:
        raise InvalidInput(
            f"{field} must hold a surface in the format .{kind}, {path!r} does not: "
            f"{contents['problem']}"
        )
    return contents
