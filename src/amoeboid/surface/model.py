"""The discretized model: parameters and inputs at a time, on a connectivity."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.closed_forms.linear import growth_rate
from amoeboid.closed_forms.points import points
from amoeboid.meshes.bending import TwoRings
from amoeboid.meshes.connectivity import Connectivity
from amoeboid.meshes.geometry import equilateral_edge_length, volume_centroid
from amoeboid.model.constitutive import Differences, NoDerivatives
from amoeboid.model.cues import factor_of
from amoeboid.model.inputs import Inputs
from amoeboid.model.parameters import Parameters
from amoeboid.numerics import sparse
from amoeboid.sections import Noise


class Solvers:
    """What depends on the mesh alone, made when first used; a pickle does without it."""

    def __init__(self, mesh: Connectivity) -> None:
        self.mesh = mesh

    def __getstate__(self) -> dict[str, Any]:
        return {"mesh": self.mesh}

    @cached_property
    def vector_solver(self) -> sparse.SparseCholesky:
        """Solver for symmetric (3V, 3V) matrices of node velocities."""
        return sparse.SparseCholesky(self.mesh.row_start, self.mesh.columns)

    @cached_property
    def two_rings(self) -> TwoRings:
        """The pattern that bending couples."""
        return TwoRings(self.mesh)

    @cached_property
    def bending_solver(self) -> sparse.SparseCholesky:
        """Solver for symmetric (3V, 3V) matrices of node velocities, on `two_rings`."""
        return sparse.SparseCholesky(self.two_rings.row_start, self.two_rings.columns)

    @cached_property
    def scalar_solver(self) -> sparse.MMatrixLU:
        """Solver for (V, V) matrices of node concentrations."""
        return sparse.MMatrixLU(self.mesh.row_start, self.mesh.columns)

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


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """Parameters on a connectivity; contains no solution.

    `edge_length` [L]: the length that remeshing aims at. It is that of equilateral triangles with
    the total area A0, as many as at the beginning of the run. `inputs`, if there are any: how
    parameters change in time, and a cue; `parameters` and `cue` are then those at time `t` [T].
    Made by `driven` and `at`. `noise`: shot noise of the filaments, if there is any.
    """

    parameters: Parameters
    mesh: Connectivity
    edge_length: float = 0.0
    inputs: Inputs | None = None
    t: float = 0.0
    cue: Any = None
    solvers: Solvers = field(default=None)  # type: ignore[assignment]
    noise: Noise | None = None

    def __post_init__(self) -> None:
        if self.edge_length == 0.0:
            length = equilateral_edge_length(self.A0, len(self.mesh.faces))
            object.__setattr__(self, "edge_length", length)
        if self.solvers is None or self.solvers.mesh is not self.mesh:
            object.__setattr__(self, "solvers", Solvers(self.mesh))

    def __getstate__(self) -> dict[str, Any]:
        """What a pickle holds: no solvers, which are made again where they are needed."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __repr__(self) -> str:
        return f"Model({self.parameters!r}, {self.mesh.n_nodes} nodes)"

    def driven(self, inputs: Inputs | None) -> Model:
        """The model under these inputs, at t = 0."""
        if inputs is None:
            return self
        return replace(self, inputs=inputs)._evaluated(0.0, 0.0)

    def at(self, t: float, since: float) -> Model:
        """The model at time t of a step that begins at `since`; itself if nothing ever changes.

        At a jump of an input: before it if `since` is earlier, after it if `since` is the jump.
        """
        if self.inputs is None or self.inputs.until == -math.inf:
            return self
        return self._evaluated(t, since)

    def _evaluated(self, t: float, since: float) -> Model:
        assert self.inputs is not None  # noqa: S101
        p, cue = self.inputs.parameters_at(t, since), self.inputs.cue_at(t, since)
        return replace(self, parameters=p, cue=cue, t=t)

    def on(self, mesh: Connectivity) -> Model:
        """The same model on another mesh."""
        return replace(self, mesh=mesh)

    @property
    def given(self) -> Parameters:
        """The parameters as the run was given them; a change in time leaves these."""
        return self.parameters if self.inputs is None else self.inputs.given

    def with_noise(self, noise: Noise) -> Model:
        """The model with shot noise of the filaments; itself if there is none."""
        return replace(self, noise=noise) if noise.acts else self

    @property
    def filaments_per_number(self) -> float:
        """Filaments in a unit of number [1/N], where there is shot noise."""
        assert self.noise is not None  # noqa: S101
        return self.noise.filaments / (self.A0 * self.given.c0)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which an input is not smooth, in order [T]."""
        return () if self.inputs is None else self.inputs.breaks

    @property
    def A0(self) -> float:
        """Membrane area that the tension keeps, 4 pi R0^2 [L^2]."""
        return 4.0 * math.pi * self.parameters.R0**2

    @cached_property
    def rate(self) -> float:
        """Parameters.rate: the unit in which slow and steady are measured [1/T].

        That of the present parameters; where these leave nothing that changes, that of `given`.
        """
        p = self.parameters
        moves = p.beta > 0 or p.D > 0 or float(p.v_p(p.c0)) != 0
        return (p if moves else self.given).rate

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

    def v_p(self, r: Array, c: Array) -> Array:
        """Polymerization speed (V,) at nodes r (V, 3) with concentration c (V,) [L/T].

        v_p(c), times the factor of the cue, which depends on where a node lies. Raises InvalidInput
        where the law is not defined.
        """
        speed = self.parameters.v_p(c)
        return speed if self.cue is None else speed * self.cue_factor(self.directions(r))

    def cue_factor(self, directions: Array) -> Array:
        """Factor (V,) of v_p [1]; 1 without a cue.

        `directions`: unit vectors (V, 3) from the center of volume.
        """
        if self.cue is None:
            return np.ones(len(directions))
        return factor_of(self.cue, directions, self.t)

    def directions(self, r: Array) -> Array:
        """Unit vectors (V, 3) [1] from the center of volume to the nodes r (V, 3) [L]."""
        x = r - volume_centroid(r, self.mesh.faces)
        return np.asarray(x / np.linalg.norm(x, axis=1)[:, None])

    @property
    def vector_solver(self) -> sparse.SparseCholesky:
        """See Solvers."""
        return self.solvers.vector_solver

    @property
    def scalar_solver(self) -> sparse.MMatrixLU:
        """See Solvers."""
        return self.solvers.scalar_solver

    @property
    def transposed(self) -> NDArray[np.int64]:
        """Places of the transposed entries in the pattern of the mesh, of P entries (P,) [1]."""
        return self.solvers.transposed

    @property
    def diagonal(self) -> NDArray[np.int64]:
        """Places of the diagonal in the pattern of the mesh (V,) [1]."""
        return self.solvers.diagonal
