"""A cell on a mesh, to start a run from."""

from __future__ import annotations

from dataclasses import dataclass

from amoeboid.arrays import Array, Index


@dataclass(frozen=True, eq=False, repr=False)
class InitialCell:
    """Shape and concentration that a 3D run starts from.

    Nodes r (V, 3) [L] in the order of `meshes.connectivity.narrow_numbering`, faces (F, 3),
    concentration c (V,) [N/L^2] and the tension zeta0 [M/T^2], a first guess. The run scales the
    shape to the area of its membrane. `repairs`: what was done to a user's surface, in words.
    """

    r: Array
    faces: Index
    c: Array
    zeta0: float
    repairs: tuple[str, ...] = ()

    def __repr__(self) -> str:
        low, high = float(self.c.min()), float(self.c.max())
        return f"InitialCell({len(self.r)} nodes, c = {low:.6g} to {high:.6g})"
