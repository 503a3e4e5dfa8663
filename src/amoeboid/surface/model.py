"""The discretized model, the state it acts on, and the flow that one evaluation gives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.cholesky import BlockCholesky
from amoeboid.numerics.dominated import DominatedByDiagonal
from amoeboid.parameters import Parameters
from amoeboid.surface.mesh import Connectivity
from amoeboid.theory.linear import growth_rate

Array = NDArray[np.float64]


def even_edge_length(area: float, n_faces: int) -> float:
    """Edge length [L] of `n_faces` equilateral triangles of a total area."""
    return math.sqrt(4.0 * area / (math.sqrt(3.0) * n_faces))


@dataclass(frozen=True, eq=False)
class Model:
    """Parameters on a connectivity; holds no solution.

    `edge_length` [L] is what remeshing aims at: that of equilateral triangles of the area A0, as
    many as the run began with.
    """

    parameters: Parameters
    mesh: Connectivity
    edge_length: float = 0.0

    def __post_init__(self) -> None:
        if self.edge_length == 0.0:
            even = even_edge_length(self.A0, len(self.mesh.faces))
            object.__setattr__(self, "edge_length", even)

    @property
    def A0(self) -> float:
        """Membrane area that the tension keeps, 4 pi R0^2 [L^2]."""
        return 4.0 * math.pi * self.parameters.R0**2

    @cached_property
    def rate(self) -> float:
        """Parameters.rate: the unit in which slow and steady are measured [1/T]."""
        return self.parameters.rate

    @cached_property
    def growth_rate(self) -> float:
        """Growth rate lambda_1 of a polarization of the homogeneous sphere [1/T]."""
        return float(growth_rate(self.parameters, 1))

    @cached_property
    def vector_solver(self) -> BlockCholesky:
        """Solver for symmetric (3V, 3V) matrices of node velocities."""
        return BlockCholesky(self.mesh.row_start, self.mesh.columns)

    @cached_property
    def scalar_solver(self) -> DominatedByDiagonal:
        """Solver for (V, V) matrices of node concentrations."""
        return DominatedByDiagonal(self.mesh.row_start, self.mesh.columns)

    @cached_property
    def transposed(self) -> NDArray[np.int64]:
        """Places of the transposed entries in the pattern of the mesh (P,)."""
        rows, columns = self.mesh.rows, self.mesh.columns
        return np.searchsorted(
            rows * self.mesh.n_nodes + columns, columns * self.mesh.n_nodes + rows
        )

    @cached_property
    def diagonal(self) -> NDArray[np.int64]:
        """Places of the diagonal in the pattern of the mesh (V,)."""
        return np.flatnonzero(self.mesh.rows == self.mesh.columns)


@dataclass(frozen=True, eq=False)
class State:
    """A cell at time t: nodes r (V, 3), concentration c (V,), tension zeta0.

    The nodes live in a frame that follows the cell; `position` (3,) is how far the cell has come
    if all drag is on the cortex, uniformly: in the frame where the mean cortex velocity vanishes.
    `turning` (3,) [1/T]: the rate at which shape and concentration turn, in axes that do not; None
    where no step on this mesh has led here.
    """

    t: float
    r: Array
    c: Array
    zeta0: float
    position: Array
    turning: Array | None = None


@dataclass(frozen=True, eq=False)
class Flow:
    """Velocities at the nodes (V, 3) in the frame of the nodes, and the tension with them.

    v_c cortex velocity, v_p polymerization velocity; v = v_c + v_p moves the shape. `normals`
    (V, 3) outward, `node_areas` (V,) their share of the area.
    """

    v_c: Array
    v_p: Array
    zeta0: float
    normals: Array
    node_areas: Array

    @property
    def v(self) -> Array:
        """Full velocity v = v_c + v_p."""
        return self.v_c + self.v_p
