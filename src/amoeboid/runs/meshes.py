"""The meshes that a run starts on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.closed_forms.linear import base_tension
from amoeboid.config import Config, polarization
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.checks import Repairable, check_size, check_surface, joined
from amoeboid.meshes.connectivity import narrow_numbering
from amoeboid.meshes.repair import repaired
from amoeboid.model.parameters import Parameters
from amoeboid.sections import Mesh
from amoeboid.validation import InvalidInput


@dataclass(frozen=True)
class Icosphere:
    """A sphere of 10 * 4**n + 2 nodes: an icosahedron subdivided n times, made even.

    n is `subdivisions`; a run takes n from 1 to 6. Raises InvalidInput for another.

    >>> Icosphere(3)
    Icosphere(3)
    """

    subdivisions: int = 3

    def __post_init__(self) -> None:
        object.__setattr__(self, "subdivisions", Mesh(subdivisions=self.subdivisions).subdivisions)

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return int(10 * 4**self.subdivisions + 2)

    def __repr__(self) -> str:
        return f"Icosphere({self.subdivisions})"


class Surface:
    """A closed triangulated surface of your own: a file (stl, ply, obj, vtp), or nodes and faces.

    Nodes r (V, 3) in any unit of length (the run scales them to the area of the membrane), faces
    (F, 3) that look outward. `repair` lets the surface be repaired, as `initial.repair`: a mesh of
    slivers, as from marching cubes, is remeshed to about the nodes of `Icosphere(subdivisions)`,
    by default of the run's own. Raises InvalidInput for a value that is not a closed surface
    without handles, and for `subdivisions` without `repair`.
    """

    def __init__(
        self, r: Any, faces: Any = None, *, repair: bool = False, subdivisions: int | None = None
    ) -> None:
        self.path = os.fspath(r) if isinstance(r, str | os.PathLike) else None
        self.repair = repair
        if subdivisions is not None:
            if not repair:
                raise InvalidInput(
                    "subdivisions must come with repair=True; without it the surface keeps its "
                    "own nodes"
                )
            subdivisions = Mesh(subdivisions=subdivisions).subdivisions
        self.subdivisions = subdivisions
        if self.path is not None:
            if faces is not None:
                raise InvalidInput(
                    "a surface must be a file or nodes and faces, got both; leave one out"
                )
            return
        if faces is None:
            raise InvalidInput("a surface must be a file, or nodes and faces; add the faces")
        try:
            self.r, self.faces = np.array(r, dtype=float), np.array(faces)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"nodes and faces must be arrays of numbers: {error}") from None
        shapes = (self.r.shape, self.faces.shape)
        whole = np.issubdtype(self.faces.dtype, np.integer)
        if not all(len(s) == 2 and s[1] == 3 for s in shapes) or not whole:
            raise InvalidInput(
                f"nodes must be (V, 3) and faces (F, 3) whole numbers, got shapes {shapes[0]} and "
                f"{shapes[1]}"
            )
        if not np.isfinite(self.r).all():
            raise InvalidInput("nodes must be finite numbers")
        if self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < len(self.r):
            raise InvalidInput(
                f"faces must be numbers of nodes, 0 to {len(self.r) - 1}, got {self.faces.min()} "
                f"to {self.faces.max()}"
            )

    def cell(self, p: Parameters, subdivisions: int = 3) -> InitialCell:
        """A homogeneous cell (c = c0) of this shape, of nodes and faces.

        `subdivisions`: of a repair, unless the surface has its own. Raises InvalidInput.
        """
        name, faces = "the surface", self.faces.astype(np.int64)
        try:
            if self.repair:
                n_nodes = Icosphere(self.subdivisions or subdivisions).n_nodes
                r, faces, changes = repaired(self.r, faces, n_nodes, name)
            else:
                check_size(self.r, name)
                r, faces, changes = joined(self.r, faces)
            check_surface(r, faces, name)
        except Repairable as problem:
            if self.repair:
                raise
            raise InvalidInput(f"{problem}, or set repair=True") from None
        order, faces = narrow_numbering(faces)
        r = r[order]
        return InitialCell(r, faces, np.full(len(r), p.c0), float(base_tension(p)), changes)

    def __repr__(self) -> str:
        if self.path is not None:
            return f"Surface({self.path!r})"
        return f"Surface({len(self.r)} nodes, {len(self.faces)} faces)"


def placed_on(mesh: Any, config: Config) -> tuple[dict[str, Any], InitialCell | None]:
    """Changes of the configuration for a mesh, {section.field: value}, or the cell to start as.

    Raises InvalidInput for a value that is not a mesh.
    """
    if isinstance(mesh, Icosphere):
        return {"mesh.subdivisions": mesh.subdivisions}, None
    if isinstance(mesh, Surface) and mesh.path is not None:
        changes: dict[str, Any] = {"initial.surface": mesh.path, "initial.repair": mesh.repair}
        if mesh.subdivisions is not None:
            changes["mesh.subdivisions"] = mesh.subdivisions
        return changes, None
    if isinstance(mesh, Surface):
        cell = mesh.cell(config.parameters, config.mesh.subdivisions)
        own = config.initial.perturbation
        amplitude = polarization(config.parameters) if own is None else own
        return {"initial.perturbation": amplitude}, cell
    raise InvalidInput(f"mesh must be amoeboid.Icosphere(n) or amoeboid.Surface(...), got {mesh!r}")
