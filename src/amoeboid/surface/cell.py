"""A state of the 3D cell as observables see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.display import shown
from amoeboid.meshes import geometry
from amoeboid.meshes.extrema import SEARCHED, fitted_maxima, largest, refined_extremum
from amoeboid.meshes.geometry import Geometry
from amoeboid.model.parameters import Parameters
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceCell:
    """Model, state and flow of one time; see `observables.Cell`. Its points are the nodes."""

    model: Model
    state: State
    flow: Flow

    def __repr__(self) -> str:
        return f"SurfaceCell(t = {shown(self.t)}, {len(self.r)} nodes)"

    @property
    def parameters(self) -> Parameters:
        """The parameters of the model."""
        return self.model.parameters

    @property
    def rate(self) -> float:
        """The unit in which slow is measured [1/T]; see Model.rate."""
        return self.model.rate

    @property
    def t(self) -> float:
        """Time [T]."""
        return self.state.t

    @property
    def r(self) -> Array:
        """Nodes (V, 3) [L]."""
        return self.state.r

    @property
    def faces(self) -> Index:
        """Node numbers of the triangles (F, 3)."""
        return self.model.mesh.faces

    @property
    def c(self) -> Array:
        """Concentration at the nodes (V,) [N/L^2]."""
        return self.state.c

    @cached_property
    def x(self) -> Array:
        """Nodes (V, 3) relative to the center of volume [L]."""
        return np.asarray(self.r - geometry.volume_centroid(self.r, self.faces))

    @cached_property
    def node_areas(self) -> Array:
        """Share of each node of the area (V,) [L^2]."""
        return geometry.node_areas(self.r, self.faces)

    @property
    def normals(self) -> Array:
        """Outward normals at the nodes (V, 3)."""
        return self.flow.normals

    @cached_property
    def _geometry(self) -> Geometry:
        """Geometry of the shape itself, not of the one that the flow was solved on."""
        return geometry.geometry(self.r, self.faces)

    @property
    def v(self) -> Array:
        """Full velocity (V, 3) in the frame of the nodes [L/T]."""
        return self.flow.v

    @property
    def v_c(self) -> Array:
        """Cortex velocity (V, 3) in the frame of the nodes [L/T]."""
        return self.flow.v_c

    @property
    def v_p(self) -> Array:
        """Polymerization velocity (V, 3) [L/T]."""
        return self.flow.v_p

    @property
    def zeta0(self) -> float:
        """Membrane tension [M/T^2]."""
        return self.state.zeta0

    @property
    def area(self) -> float:
        """Area of the polyhedron [L^2]."""
        return geometry.area(self.r, self.faces)

    @property
    def radius(self) -> float:
        """Radius of the sphere of the area of the smooth surface through the nodes [L]."""
        area = geometry.smooth_area(self.r, self.faces, self._geometry)
        return float(np.sqrt(area / (4.0 * np.pi)))

    @property
    def volume(self) -> float:
        """Volume of the polyhedron [L^3]."""
        return geometry.volume(self.r, self.faces)

    def integral(self, field: Array) -> Any:
        """Integral of a field (V,) or (V, 3), by the areas of the nodes."""
        found = self.node_areas @ field
        return found if np.ndim(found) else float(found)

    def maximum(self, field: Array) -> float:
        """Maximum of the quadratic that is fitted around the highest node.

        That of a field without positive values is not positive either.
        """
        return -self.minimum(-field)

    def minimum(self, field: Array) -> float:
        """Minimum of the quadratic that is fitted around the lowest node.

        That of a field without negative values is not negative either: where the quadratic is, the
        value at the node counts.
        """
        field = np.ascontiguousarray(field, dtype=float)
        lowest, mesh = int(np.argmin(field)), self.model.mesh
        found = refined_extremum(
            lowest, -1.0, mesh.row_start, mesh.columns, self.r, self._geometry.normals, field
        )
        return found if found >= 0.0 or field[lowest] < 0.0 else float(field[lowest])

    def max_length(self, field: Array) -> float:
        """Maximum of the length of vectors (V, 3), from polynomials fitted to their squares.

        They are of fourth degree, around each of the nodes with the longest: the maximum lies
        between the nodes, and single nodes do not decide.
        """
        squares = np.einsum("vi,vi->v", field, field)
        mesh, longest = self.model.mesh, largest(squares, SEARCHED)
        maxima = fitted_maxima(
            longest, mesh.row_start, mesh.columns, self.r, self._geometry.normals, squares
        )
        return float(np.sqrt(max(0.0, maxima.max())))
