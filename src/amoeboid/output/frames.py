"""The frames of a run: frames/*.vtp and the list of them with their times, frames.pvd."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array, Index
from amoeboid.meshes.cells import InitialCell
from amoeboid.observables import retrograde_flow
from amoeboid.output.atomic import GrowingFile, write_atomically
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.step import Step
from amoeboid.surface.cell import SurfaceCell


class FrameFiles:
    """Writes the frames that are due, by a schedule; see `amoeboid.simulation.writers`."""

    def __init__(self, folder: Path, schedule: Schedule) -> None:
        self.folder, self.schedule = folder, schedule
        self.written: list[tuple[float, str]] = []
        self.times = array("d")
        self._collection = GrowingFile(folder / "frames.pvd", _COLLECTION_END)

    def continued(self, times: Sequence[float], t: float) -> None:
        """Take up the frames at `times` of a run that stands at time t."""
        self.written = [(time, frame_name(count)) for count, time in enumerate(times)]
        self.times = array("d", times)
        self.schedule.latest = t

    def due(self, step: Step) -> list[float]:
        """Times of the frames within a step."""
        return self.schedule.due(step.state.t)

    def write(self, step: Step) -> None:
        """Write a frame, and add it to the list."""
        name = frame_name(len(self.written))
        (self.folder / "frames").mkdir(exist_ok=True)
        write_atomically(self.folder / "frames" / name, lambda p: write_frame(p, step))
        t = step.state.t
        self.written.append((t, name))
        self.times.append(t)
        self.schedule.latest = t
        self._collection.extend(_entry(t, name), lambda: _collection(self.kept()))

    def finish(self, step: Step) -> None:
        """Write the frame of the last step, unless the frames are at times that were asked for."""
        if not self.schedule.times and (not self.written or self.written[-1][0] < step.state.t):
            self.write(step)

    def kept(self) -> list[tuple[float, str]]:
        """Times and names of the frames that are still there; the user may delete some."""
        return [(t, name) for t, name in self.written if (self.folder / "frames" / name).is_file()]

    def list_anew(self) -> list[tuple[float, str]]:
        """Write the list of the frames that are still there, if there are any; gives them."""
        kept = self.kept()
        if kept:
            self._collection.write(_collection(kept))
        return kept


def write_frame(path: Path, step: Step) -> None:
    """Write one step as VTK PolyData (.vtp): nodes, triangles, and node fields."""
    _write(path, step.state.r, step.model.mesh.faces, *frame_arrays(step.cell))


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
    _write(path, cell.r, cell.faces, {"c": cell.c}, {"t": [0.0], "zeta0": [cell.zeta0]})


def frame_text(
    r: ArrayLike,
    faces: ArrayLike,
    fields: Mapping[str, ArrayLike],
    numbers: Mapping[str, ArrayLike],
) -> str:
    """The text of a frame (.vtp): nodes (V, 3), triangles (F, 3), and what `frame_arrays` gives."""
    writer = _writer(np.asarray(r, dtype=float), np.asarray(faces), fields, numbers)
    writer.WriteToOutputStringOn()
    if writer.Write() != 1:
        raise OSError("the frame could not be written")
    return str(writer.GetOutputString())


def _write(
    path: Path,
    r: Array,
    faces: Index,
    fields: Mapping[str, ArrayLike],
    numbers: Mapping[str, ArrayLike],
) -> None:
    """Write nodes, triangles, fields at the nodes and numbers as VTK PolyData."""
    writer = _writer(r, faces, fields, numbers)
    writer.SetFileName(str(path))
    if writer.Write() != 1:
        raise OSError(f"the frame {str(path)!r} could not be written")


def _writer(
    r: Array, faces: Array, fields: Mapping[str, ArrayLike], numbers: Mapping[str, ArrayLike]
) -> Any:
    """A writer of VTK that has the surface, and needs to be told where to."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    surface = vtkPolyData()
    points = vtkPoints()
    points.SetData(numpy_to_vtk(r, deep=True))
    surface.SetPoints(points)
    cells = vtkCellArray()
    triangles = np.column_stack([np.full(len(faces), 3), faces]).ravel()
    cells.ImportLegacyFormat(numpy_to_vtkIdTypeArray(triangles, deep=True))
    surface.SetPolys(cells)
    for name, values in fields.items():
        array = numpy_to_vtk(np.ascontiguousarray(values, dtype=float), deep=True)
        array.SetName(name)
        surface.GetPointData().AddArray(array)
    surface.GetPointData().SetActiveScalars("c")
    for name, value in numbers.items():
        array = numpy_to_vtk(np.asarray(value, dtype=float), deep=True)
        array.SetName(name)
        surface.GetFieldData().AddArray(array)
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(surface)
    return writer


def frame_name(count: int) -> str:
    """The name of the file of a frame."""
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
