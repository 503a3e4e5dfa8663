"""From a cell of any solver, or a measured one, to its surface as surroundings feel it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.files import surface_file
from amoeboid.meshes.geometry import geometry, normal_part, volume, volume_centroid
from amoeboid.meshes.graphs import components
from amoeboid.model.units import measured
from amoeboid.motility.revolved import RevolvedSurface
from amoeboid.motility.surfaces import Surroundable, front_of
from amoeboid.motility.triangulated import TriangulatedSurface
from amoeboid.observables import CellOnMesh, center_velocity_of, polarization
from amoeboid.validation import InvalidInput


def surface_of(cell: Any) -> Surroundable:
    """The surface of a cell as observables see it, or of a `MeasuredCell`.

    Raises InvalidInput for anything else.
    """
    if isinstance(cell, MeasuredCell):
        return cell.surface
    if hasattr(cell, "faces") and hasattr(cell, "v_c"):
        turning = cell.state.angular_velocity
        return surface_of_mesh(cell, np.zeros(3) if turning is None else turning)
    if hasattr(cell, "shape") and hasattr(cell, "tangents"):
        return RevolvedSurface(cell)
    raise InvalidInput(
        "a cell that migrates must be a steady state, a cell of a run, a MeasuredCell, or a "
        f"Surface with its flow, got {str(cell)[:100]}"
    )


def surface_of_mesh(cell: CellOnMesh, turning: Array) -> TriangulatedSurface:
    """The surface of a 3D cell whose shape rotates with an angular velocity (3,) [1/T]."""
    rotation = np.cross(turning, cell.x)
    rest = center_velocity_of(cell, cell.v - rotation) + rotation
    front = front_of(polarization(cell))
    return TriangulatedSurface(
        cell.x, cell.faces, cell.v - rest, UPWARD if front is None else front,
        cell.v_c - rest, cell.c,
    )  # fmt: skip


UPWARD = np.array([0.0, 0.0, 1.0])
"""The front of a cell that has none."""

MIN_FACE = 1e-9
"""Triangles of less area than this share of the mean have no normal."""


USUAL_NAMES = ("flow", "retrograde_flow")
"""Names that the flow has in a file."""


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredCell:
    """A surface with a flow, measured or made up: no model is needed.

    Nodes `r` (V, 3), `faces` (F, 3) seen counter-clockwise from outside, `flow` (V, 3) the velocity
    of the surface at the nodes, in the frame of the cell or of the laboratory; `c` (V,) a
    concentration, for a drag in proportion to it. `front` (3,): the direction that counts as
    forwards; where it is left out, where c is low, or without c against the mean flow. `length`
    and `time`: units of the numbers, such as "um" and "s"; without them results are plain numbers.

    What moves the surface as a whole is taken out of the flow: the velocity of the center of
    volume, in such a way that a uniform velocity is taken out exactly on any mesh. The rotation is
    not known and counts as flow. Raises InvalidInput.
    """

    r: Array
    faces: Index
    flow: Array
    c: Array | None = None
    front: Any = None
    length: str | None = None
    time: str | None = None

    def __post_init__(self) -> None:
        r, flow = _vectors("r", self.r), _vectors("flow", self.flow)
        faces = np.asarray(self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
            raise InvalidInput(f"faces must be whole numbers (F, 3), got shape {faces.shape}")
        if not faces.size:
            raise InvalidInput("a measured surface must have triangles, got none")
        if not 0 <= faces.min() <= faces.max() < len(r):
            raise InvalidInput(f"faces must be numbers of nodes, 0 to {len(r) - 1}")
        if flow.shape != r.shape:
            raise InvalidInput(
                f"flow must have a vector for each of the {len(r)} nodes, got {len(flow)}; "
                "average vectors on triangles over the triangles around each node"
            )
        faces = np.ascontiguousarray(faces, dtype=np.int64)
        _check_closed(r, faces)
        if (self.length is None) != (self.time is None):
            raise InvalidInput("length and time must be given together; give both or neither")
        if self.length is not None and self.time is not None:
            measured("length", f"1 {self.length}", "L", "um")
            measured("time", f"1 {self.time}", "T", "min")
        object.__setattr__(self, "r", r)
        object.__setattr__(self, "flow", flow)
        object.__setattr__(self, "faces", faces)
        if self.c is not None:
            c = _numbers("c", self.c)
            if c.shape != (len(r),) or not np.isfinite(c).all() or c.min() < 0.0 or not c.any():
                raise InvalidInput(
                    f"c must be a finite number >= 0 for each of the {len(r)} nodes, not 0 "
                    f"everywhere, got shape {c.shape}"
                )
            object.__setattr__(self, "c", c)
        if self.front is not None:
            found = _numbers("front", self.front).ravel()
            if found.size != 3 or not np.isfinite(found).all() or not np.any(found):
                raise InvalidInput(
                    f"front must be three finite numbers, not all zero, got {self.front!r}"
                )
            object.__setattr__(self, "front", found / np.linalg.norm(found))

    @classmethod
    def from_file(
        cls, path: str, flow: str | None = None, *, front: Any = None,
        length: str | None = None, time: str | None = None,
    ) -> MeasuredCell:  # fmt: skip
        """The surface of the file `path` (.vtp) with vectors at its points, named `flow`.

        Without a name: those named flow or retrograde_flow, or the only ones beside normals. Its
        c is that of the points, if they have one. `front`, `length` and `time` are those of the
        class. Raises InvalidInput.
        """
        found = surface_file(path, "a measured surface", ("vtp",))
        names = [name for name in found.vectors if not name.lower().startswith("normal")]
        if flow is None:
            usual = [name for name in USUAL_NAMES if name in names]
            wanted = usual[:1] or (names if len(names) == 1 else [])
        else:
            wanted = [flow] if flow in names else []
        if not wanted:
            raise InvalidInput(
                f"the flow of {path!r} must be one of its vectors at points, which are "
                f"{', '.join(names) or 'none'}; name it, as with --flow NAME"
            )
        return cls(found.r, found.faces, found.vectors[wanted[0]], found.c, front, length, time)

    def __repr__(self) -> str:
        units = "" if self.length is None else f" in {self.length} and {self.time}"
        return f"MeasuredCell({len(self.r)} nodes, {len(self.faces)} faces{units})"

    @property
    def surface(self) -> TriangulatedSurface:
        """The surface as surroundings feel it."""
        x = self.r - volume_centroid(self.r, self.faces)
        g = geometry(self.r, self.faces)
        v_n = np.einsum("vi,vi->v", self.flow, g.normals)
        # the volume times unity, up to the error of the mesh
        moments = (g.node_areas[:, None] * x).T @ g.normals
        moved = np.linalg.solve(moments, (g.node_areas * v_n) @ x)
        velocity = self.flow - moved
        front = self.front
        if front is None and self.c is not None:
            size = np.sqrt(g.area / (4.0 * np.pi))
            weights = g.node_areas * self.c
            front = front_of(weights @ x / (weights.sum() * size))
        if front is None:
            mean = g.node_areas @ (velocity - normal_part(velocity, g.normals)) / g.area
            speed = np.linalg.norm(mean)
            front = -mean / speed if speed > 0.0 else UPWARD
        return TriangulatedSurface(x, self.faces, velocity, np.asarray(front), None, self.c)


def _numbers(name: str, given: Any) -> Array:
    try:
        return np.array(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{name} must be an array of numbers: {error}") from None


def _vectors(name: str, given: Any) -> Array:
    found = _numbers(name, given)
    if found.ndim != 2 or found.shape[1] != 3:
        raise InvalidInput(f"{name} must be finite numbers (V, 3), got shape {found.shape}")
    unknown = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if unknown.size:
        raise InvalidInput(
            f"{name} must be finite, it is not at {len(unknown)} of {len(found)} nodes, the first "
            f"is {unknown[0]}; interpolate it from the neighboring nodes"
        )
    return found


def _check_closed(r: Array, faces: Index) -> None:
    """Raise InvalidInput for a surface that is open, or looks inward."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = set(map(tuple, edges.tolist()))
    if len(there) != len(edges) or any((b, a) not in there for a, b in there):
        raise InvalidInput(
            "a measured surface must be closed, with all triangles oriented outward; close it, "
            "or save it as a file and open that with amoeboid.Surface(..., repair=True)"
        )
    if len(np.unique(faces)) != len(r):
        raise InvalidInput(
            "every node of a measured surface must belong to a triangle; remove the others"
        )
    if not volume(r, faces) > 0.0:
        raise InvalidInput(
            "the triangles of a measured surface must be oriented outward; reverse them"
        )
    pieces, _ = components(len(r), *edges.T)
    if pieces > 1:
        raise InvalidInput(
            f"a measured surface must be one cell, this one has {pieces} pieces; keep one of them"
        )
    areas = np.linalg.norm(
        np.cross(r[faces[:, 1]] - r[faces[:, 0]], r[faces[:, 2]] - r[faces[:, 0]]), axis=1
    )
    small = np.flatnonzero(areas < MIN_FACE * areas.mean())
    if small.size:
        raise InvalidInput(
            f"the triangles of a measured surface must have areas > 0, {small.size} of them have "
            f"area 0, the first is {small[0]}; save it as a file and open that with "
            "amoeboid.Surface(..., repair=True)"
        )
