"""The 3D cell at one time, as users see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from amoeboid.display import html_picture, html_table, plotted, shown
from amoeboid.meshes.cells import InitialCell
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES, Measured, observed, retrograde_flow, units
from amoeboid.studies.columns import quantity
from amoeboid.studies.recorded import Recorded, single
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State

SHOWN = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "polarity", "deformation")
FIELDS = {
    "t": "T",
    "r": "L",
    "x": "L",
    "c": "N/L^2",
    "v": "L/T",
    "v_c": "L/T",
    "v_p": "L/T",
    "normals": "1",
    "area": "L^2",
    "volume": "L^3",
}


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot(Measured):
    """The cell at a time: shape, fields, and every observable as an attribute.

    Fields at the nodes are `r` (V, 3), `x` (V, 3) relative to the center of volume, `c` (V,), and
    the velocities `v`, `v_c`, `v_p` (V, 3) in the frame of the nodes; `retrograde_flow` (V, 3) is
    that in the frame of the cell, `faces` (F, 3) are node numbers, `normals` (V, 3) outward. With
    physical parameters, numbers are quantities with units; `cell` has them as plain arrays.
    """

    model: Model
    state: State
    flow: Flow

    @cached_property
    def cell(self) -> SurfaceCell:
        """The cell in plain numbers, as observables see it."""
        return SurfaceCell(self.model, self.state, self.flow)

    @property
    def parameters(self) -> Parameters:
        """The parameters of the cell."""
        return self.model.parameters

    @property
    def faces(self) -> Any:
        """Node numbers of the triangles (F, 3), outward."""
        return self.cell.faces

    @property
    def retrograde_flow(self) -> Any:
        """Tangential velocity (V, 3) in the frame in which the center of volume rests [L/T]."""
        return quantity(self.parameters, retrograde_flow(self.cell), "L/T")

    def __getattr__(self, name: str) -> Any:
        if name in FIELDS:
            return quantity(self.parameters, getattr(self.cell, name), FIELDS[name])
        value = super().__getattr__(name)
        return quantity(self.parameters, value, OBSERVABLES[name].dimension)

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *FIELDS, *OBSERVABLES})

    def as_initial(self, mesh: Any = None) -> InitialCell:
        """This cell as the initial condition of another run, on the mesh that it has."""
        return InitialCell(self.state.r, self.cell.faces, self.state.c, self.state.zeta0)

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: the observables."""
        found, dimensions = observed(self.cell), units()
        return single(self.parameters, {name: (v, dimensions[name]) for name, v in found.items()})

    def plot(self, ax: Any = None) -> Any:
        """Draw the cell from the side, colored by c, front to the left. Takes and returns axes."""
        return plotted(self, "runs.draw_cell", ax)

    def _rows(self) -> list[tuple[str, Any]]:
        return [(name, getattr(self, name)) for name in SHOWN]

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {shown(value)}" for name, value in self._rows()[:3])
        return f"Snapshot(t = {shown(self.t)}, {len(self.state.r)} nodes, {values})"

    def _repr_html_(self) -> str:
        heading = f"Cell at t = {shown(self.t)}, {len(self.state.r)} nodes"
        return html_table(heading, self._rows()) + html_picture(self, "runs.draw_cell")
