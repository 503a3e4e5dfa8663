"""The frames of a run: frames/*.vtp and the list of them with their times, frames.pvd."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.vtp import frame_bytes
from amoeboid.observables import retrograde_flow
from amoeboid.output.atomic import GrowingFile, write_atomically
from amoeboid.simulation.dense_output import Schedule
from amoeboid.simulation.step import Step
from amoeboid.surface.cell import SurfaceCell

# else readers of XML make them spaces
_SPACES = {ord(space): f"&#{ord(space)};" for space in "\t\n\r"}


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
