"""The discretized model: parameters on a mesh, with the solvers for its matrices."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.closed_forms.linear import growth_rate
from amoeboid.closed_forms.points import points
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import equilateral_edge_length
from amoeboid.model.constitutive import Differences, NoDerivatives
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.sparse import MMatrixLU, SparseCholesky


@dataclass(frozen=True, eq=False)
class Model:
    """Parameters on a connectivity; contains no solution.

    `edge_length` [L]: the length that remeshing aims at. It is that of equilateral triangles with
    the total area A0, as many as at the beginning of the run.
    """

    parameters: Parameters
    mesh: Connectivity
    edge_length: float = 0.0

    def __post_init__(self) -> None:
        if self.edge_length == 0.0:
            length = equilateral_edge_length(self.A0, len(self.mesh.faces))
            object.__setattr__(self, "edge_length", length)

    def __getstate__(self) -> dict[str, Any]:
        """What a pickle holds: no solvers, which are made again where they are needed."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def A0(self) -> float:
        """Membrane area that the tension keeps, 4 pi R0^2 [L^2]."""
        return 4.0 * math.pi * self.parameters.R0**2

    @cached_property
    def rate(self) -> float:
        """Parameters.rate, the unit of all rates of change [1/T]."""
        return self.parameters.rate

    @cached_property
    def growth_rate(self) -> float:
        """Growth rate lambda_1 of a polarization of the homogeneous sphere [1/T].

        By differences of law and stress where these have values only.
        """
        try:
            return float(growth_rate(self.parameters, 1))
        except NoDerivatives:
            p = points(self.parameters)
            slopes: dict[str, Any] = {
                "law": Differences(p.law),
                "stress": Differences(p.stress),
            }
            return float(growth_rate(replace(p, **slopes), 1))

    @cached_property
    def vector_solver(self) -> SparseCholesky:
        """Solver for symmetric (3V, 3V) matrices of node velocities."""
        return SparseCholesky(self.mesh.row_start, self.mesh.columns)

    @cached_property
    def scalar_solver(self) -> MMatrixLU:
        """Solver for (V, V) matrices of node concentrations."""
        return MMatrixLU(self.mesh.row_start, self.mesh.columns)

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
