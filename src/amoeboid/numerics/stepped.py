"""Exact Jacobians of equations on a grid, for the price of a few evaluations.

At every point an equation depends on few quantities: the fields there, and what linear operators
(derivatives, integrals) make of fields. So it is differentiated in few *directions*: one for each
field that is an unknown, and one more for every operator that is met on the way. A `Stepped` field
holds one row for each direction, with a step along it in the imaginary part, from which arithmetic
makes derivatives without differences. The chain rule then assembles the Jacobian out of the
derivatives of the directions to the unknowns. Sources: Squire & Trapp, SIAM Rev. 40, 110 (1998);
Griewank & Walther, *Evaluating Derivatives*, 2nd ed. 2008, chapter 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from amoeboid.arrays import Array

STEP = 1e-40
"""The imaginary step; its square is nothing beside one, so that derivatives are exact."""


@dataclass(frozen=True, eq=False)
class Seeds:
    """The fields that are unknowns: `matrices[k]` (n, N) or (1, N) gives field k from all N.

    `known` holds what operators make of these matrices.
    """

    matrices: tuple[Array, ...]
    known: dict[tuple[int, int], tuple[Array, Array]] = field(default_factory=dict)
    steps_known: dict[int, Array] = field(default_factory=dict)
    table: Array = field(init=False)
    """All of them at all points, shape (n, count, N)."""

    def __post_init__(self) -> None:
        n = max(matrix.shape[0] for matrix in self.matrices)
        full = [np.broadcast_to(m, (n, m.shape[1])) for m in self.matrices]
        object.__setattr__(self, "table", np.ascontiguousarray(np.stack(full, axis=1)))

    def steps(self, operators: int) -> Array:
        """The step along each direction k, shape (count, count, n); computed once."""
        if operators not in self.steps_known:
            n, count, _ = self.table.shape
            steps = np.zeros((count + operators, count + operators, n), dtype=complex)
            for k, step in enumerate(steps):
                step[k] = 1j * STEP
            self.steps_known[operators] = steps
        return self.steps_known[operators]

    def applied(self, matrix: Array, k: int) -> Array:
        """`matrix` times the matrix of seed k; computed once."""
        if (k, id(matrix)) not in self.known:
            self.known[k, id(matrix)] = matrix, matrix @ self.matrices[k]
        return self.known[k, id(matrix)][1]


class Directions:
    """The directions of one evaluation: those of the seeds, and those of the operators met so far.

    At most `operators` of them.
    """

    def __init__(self, seeds: Seeds, operators: int) -> None:
        self.seeds = seeds
        n, self.first, size = seeds.table.shape
        self.steps = seeds.steps(operators)
        self.still = np.zeros(self.steps.shape[1:], dtype=complex)
        self.table = np.empty((n, operators, size))
        self.met = 0

    def seed(self, k: int, values: Array) -> Stepped:
        """Field k of the seeds with these values."""
        return self._along(k, values, (k, None))

    def applied(self, matrix: Array, f: Stepped) -> Stepped:
        """What a linear operator makes of a field: the next direction."""
        if self.met == self.table.shape[1]:
            raise ValueError(f"the equation has more than {self.met} linear operators; allow more")
        self.table[:, self.met] = self._transformed(matrix, f)
        self.met += 1
        return self._along(self.first + self.met - 1, matrix @ f.values, None)

    def _transformed(self, matrix: Array, f: Stepped) -> Array:
        if f.origin is None:
            return np.asarray(matrix @ self.derivatives(f))
        k, slope = f.origin
        if slope is None:
            return self.seeds.applied(matrix, k)
        return np.asarray((matrix * slope) @ self.seeds.matrices[k])

    def _along(self, k: int, values: Array, origin: Origin | None) -> Stepped:
        rows = self.steps[k, :, : values.size] + values
        return Stepped(rows, self, origin)

    def derivatives(self, f: Stepped, unit: float = 1.0, out: Array | None = None) -> Array:
        """Derivatives of a field, in a unit, to all unknowns, shape (n, N) or (1, N)."""
        partial = np.ascontiguousarray((f.rows.imag * (1.0 / (STEP * unit))).T)[:, None]
        points = partial.shape[0]
        found = np.matmul(partial[:, :, : self.first], self.seeds.table[:points], out=out)
        if self.met:
            met = partial[:, :, self.first : self.first + self.met]
            found += met @ self.table[:points, : self.met]
        return found[:, 0]


Origin = tuple[int, Array | None]
"""That a field is seed k (k, None), or a function of it with this slope (k, slope)."""


class Stepped:
    """A field at n points, one row for each of the `Directions`; n = 1 broadcasts."""

    __slots__ = ("directions", "origin", "rows")
    __array_ufunc__ = None  # an array on the left of an operator leaves the work to this class

    def __init__(self, rows: Array, directions: Directions, origin: Origin | None = None) -> None:
        self.rows = rows
        self.directions = directions
        self.origin = origin

    @property
    def values(self) -> Array:
        """The values (n,)."""
        return self.rows[0].real

    def map(self, values: Array, slope: Array) -> Stepped:
        """f(self), given f and f' at the points."""
        if self.origin is not None and self.origin[1] is None:
            k = self.origin[0]
            rows = self.directions.still[:, : values.size] + values
            rows.imag[k] = STEP * slope
            return Stepped(rows, self.directions, (k, slope))
        rows = np.empty_like(self.rows)
        rows.real = values
        np.multiply(self.rows.imag, slope, out=rows.imag)
        return Stepped(rows, self.directions)

    def __neg__(self) -> Stepped:
        return Stepped(-self.rows, self.directions)

    def __add__(self, other: Any) -> Stepped:
        return Stepped(self.rows + _rows(other), self.directions)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Stepped:
        return Stepped(self.rows - _rows(other), self.directions)

    def __rsub__(self, other: Any) -> Stepped:
        return Stepped(_rows(other) - self.rows, self.directions)

    def __mul__(self, other: Any) -> Stepped:
        return Stepped(self.rows * _rows(other), self.directions)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Stepped:
        return Stepped(self.rows / _rows(other), self.directions)

    def __rtruediv__(self, other: Any) -> Stepped:
        return Stepped(_rows(other) / self.rows, self.directions)

    def __rmatmul__(self, matrix: Array) -> Stepped:
        return self.directions.applied(matrix, self)


def _rows(other: Any) -> Any:
    return other.rows if isinstance(other, Stepped) else other


def with_derivatives(fields: Sequence[Stepped], units: Array) -> tuple[Array, Array]:
    """Values of fields one below the other, each in a unit, and their derivatives to all unknowns.

    `units` (rows,) holds the same number for all points of a field.
    """
    directions = fields[0].directions
    values = np.concatenate([f.values for f in fields]) / units
    jacobian = np.empty((values.size, directions.table.shape[2]))
    row = 0
    for f in fields:
        end = row + f.rows.shape[1]
        directions.derivatives(f, units[row], jacobian[row:end, None])
        row = end
    return values, jacobian
