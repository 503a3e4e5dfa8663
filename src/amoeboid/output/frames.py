"""The frames of a run: frames/*.vtp and the list of them with their times, frames.pvd."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array, Index
from amoeboid.meshes.cells import InitialCell
from amoeboid.observables import retrograde_flow
from amoeboid.output.atomic import GrowingFile, write_atomically
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.step import Step
from amoeboid.surface.cell import SurfaceCell

# How the arrays of a frame are stored: as they are, behind the text of the file.
HEADER = 'byte_order="LittleEndian" header_type="UInt64"'
# else readers of XML make them spaces
_SPACES = {ord(space): f"&#{ord(space)};" for space in "\t\n\r"}
APPENDED = '<AppendedData encoding="raw">'
CHECKSUM = "<!-- crc32 of the arrays: {:08x} -->"


class FrameFiles:
    """Writes the frames that are due, by a schedule; see `amoeboid.simulation.writers`."""

    def __init__(self, folder: Path, schedule: Schedule) -> None:
        self.folder, self.schedule = folder, schedule
        self.times = array("d")
        self._collection = GrowingFile(folder / "frames.pvd", _COLLECTION_END)

    def continued(self, times: Sequence[float], t: float) -> None:
        """Take up the frames at `times` of a run that stands at time t."""
        self.times = array("d", times)
        self.schedule.latest = t

    @property
    def written(self) -> list[tuple[float, str]]:
        """Times and names of the frames written so far."""
        return [(t, frame_name(count)) for count, t in enumerate(self.times)]

    def due(self, step: Step) -> list[float]:
        """Times of the frames within a step."""
        return self.schedule.due(step.state.t)

    def write(self, step: Step) -> None:
        """Write a frame, and add it to the list."""
        name = frame_name(len(self.times))
        (self.folder / "frames").mkdir(exist_ok=True)
        write_atomically(self.folder / "frames" / name, lambda p: write_frame(p, step))
        t = step.state.t
        self.times.append(t)
        self.schedule.latest = t
        self._collection.extend(_entry(t, name), lambda: collection(self.kept()))

    def finish(self, step: Step) -> None:
        """Write the frame of the last step, unless the frames are at times that were asked for."""
        if not self.schedule.times and (not self.times or self.times[-1] < step.state.t):
            self.write(step)

    def kept(self) -> list[tuple[float, str]]:
        """Times and names of the frames that are still there; the user may delete some."""
        return [(t, name) for t, name in self.written if (self.folder / "frames" / name).is_file()]

    def list_anew(self) -> list[tuple[float, str]]:
        """Write the list of the frames that are still there, if there are any; gives them."""
        kept = self.kept()
        if kept:
            self._collection.write(collection(kept))
        return kept


def write_frame(path: Path, step: Step) -> None:
    """Write one step as VTK PolyData (.vtp): nodes, triangles, and node fields."""
    path.write_bytes(frame_bytes(step.state.r, step.model.mesh.faces, *frame_arrays(step.cell)))


def frame_arrays(cell: SurfaceCell) -> tuple[dict[str, Array], dict[str, Array]]:
    """The fields of a frame at the nodes, and its numbers, by their names.

    Fields: c, v_p, v_c, v (frame of the nodes), retrograde_flow (frame of the cell), normal.
    """
    fields = {
        "c": cell.c,
        "v_p": cell.v_p,
        "v_c": cell.v_c,
        "v": cell.v,
        "retrograde_flow": retrograde_flow(cell),
        "normal": cell.normals,
    }
    numbers = {"t": np.array([cell.t]), "zeta0": np.array([cell.zeta0])}
    numbers["cortex_drag_position"] = cell.state.position
    return fields, numbers


def write_initial(path: Path, cell: InitialCell) -> None:
    """Write a cell that a run starts as; `initial.from_frame` reads it."""
    numbers = {"t": np.zeros(1), "zeta0": np.array([cell.zeta0])}
    path.write_bytes(frame_bytes(cell.r, cell.faces, {"c": cell.c}, numbers))


def frame_bytes(
    r: Array, faces: Index, fields: Mapping[str, Array], numbers: Mapping[str, Array]
) -> bytes:
    """A file of VTK PolyData: nodes (V, 3), triangles (F, 3), and what `frame_arrays` gives."""
    blocks = _Blocks()
    corners = 3 * np.arange(1, len(faces) + 1)
    lines = [
        f'<VTKFile type="PolyData" version="1.0" {HEADER}>',
        "<PolyData>",
        "<FieldData>",
        *(blocks.add(name, value, f'NumberOfTuples="{np.size(value)}"')
          for name, value in numbers.items()),
        "</FieldData>",
        f'<Piece NumberOfPoints="{len(r)}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" '
        f'NumberOfPolys="{len(faces)}">',
        '<PointData Scalars="c">',
        *(blocks.add(name, values, f'NumberOfComponents="{values[0].size}"')
          for name, values in fields.items()),
        "</PointData>",
        "<Points>", blocks.add("Points", r, 'NumberOfComponents="3"'), "</Points>",
        "<Polys>", blocks.add("connectivity", faces), blocks.add("offsets", corners), "</Polys>",
        "</Piece>",
        "</PolyData>",
        CHECKSUM.format(blocks.checksum),
        f"{APPENDED}_",
    ]  # fmt: skip
    end = b"\n</AppendedData>\n</VTKFile>\n"
    return b"".join(["\n".join(lines).encode(), *blocks.data, end])


class _Blocks:
    """The arrays of a file, one after the other, each behind its size in bytes."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.checksum = 0
        self._place = 0

    def add(self, name: str, values: ArrayLike, shape: str = "") -> str:
        """Append an array; returns the element that says where it lies."""
        array = np.asarray(values)
        whole = array.dtype.kind in "iu"
        block = np.ascontiguousarray(array, "<i8" if whole else "<f8").tobytes()
        start = self._place
        self.data += [len(block).to_bytes(8, "little"), block]
        self.checksum = crc32(block, self.checksum)
        self._place += 8 + len(block)
        kind = "Int64" if whole else "Float64"
        return (
            f'<DataArray type="{kind}" Name="{name}" {shape} format="appended" offset="{start}"/>'
        )


def frame_name(count: int) -> str:
    """The name of the file of a frame."""
    return f"frame_{count:05d}.vtp"


_COLLECTION_END = "  </Collection>\n</VTKFile>\n"


def collection(frame_times: list[tuple[float, str]], where: str = "frames/") -> str:
    """ParaView's list of frames and their times (.pvd); `where`: the folder of the frames."""
    return "".join(
        [
            '<?xml version="1.0"?>\n',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n',
            "  <Collection>\n",
            *(_entry(t, name, where) for t, name in frame_times),
            _COLLECTION_END,
        ]
    )


def _entry(t: float, name: str, where: str = "frames/") -> str:
    file = escape(f"{where}{name}").translate(_SPACES)
    return f'    <DataSet timestep="{t!r}" part="0" file="{file}"/>\n'
