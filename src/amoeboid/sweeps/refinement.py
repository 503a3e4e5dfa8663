"""Adaptive refinement: more points of a grid where a recorded label changes.

A cell of the grid is split in half along every dimension where its points have different labels,
and its parts again, to a stated depth. Points on the side of a cell count too, those that were made
for a finer neighbor: no boundary ends at a change of the size. Points that failed have no label.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.sweeps.evaluation import POINT
from amoeboid.sweeps.points import Points
from amoeboid.validation import InvalidInput

MAX_DEPTH, MAX_LATTICE = 12, 50_000_000
NOT_COMPUTED, NO_LABEL = -1, 0

Place = tuple[int, ...]
"""Where a point is, in steps of the finest grid."""


@dataclass(frozen=True, eq=False, repr=False)
class Refinement:
    """A grid that is refined where a label changes, `depth` times; see `refine`."""

    grid: Points
    label: tuple[str, ...]
    depth: int

    def __repr__(self) -> str:
        return (
            f"Refinement({self.grid!r} where {', '.join(self.label)} changes, {self.depth} times)"
        )

    @property
    def step(self) -> int:
        """Steps of the finest grid between two values of the coarse one."""
        return int(2**self.depth)

    def first(self) -> list[Place]:
        """The places of the points of the grid itself."""
        return [tuple(k * self.step for k in place) for place in np.ndindex(*self.grid.shape)]

    def points(self, places: Sequence[Place]) -> Points:
        """The points at these places."""
        columns = {
            name: tuple(self._value(name, place[k]) for place in places)
            for k, name in enumerate(self.grid.names)
        }
        return Points(self.grid.base, columns, (POINT,), (len(places),))

    def _value(self, name: str, place: int) -> float:
        values = self.grid.axes[name]
        k, rest = divmod(place, self.step)
        if rest == 0:
            return float(values[k])
        share = rest / self.step
        if self.grid.spacings.get(name) == "logspace":
            return float(values[k] * (values[k + 1] / values[k]) ** share)
        return float(values[k] + (values[k + 1] - values[k]) * share)

    def next(self, labels: Mapping[Place, Any]) -> list[Place]:
        """The places to compute next, given what is known; None is the label of a failure."""
        codes = self._codes(labels)
        cells: list[Place] = [
            tuple(k * self.step for k in cell)
            for cell in np.ndindex(*(n - 1 for n in self.grid.shape))
        ]
        size = self.step
        while size > 1:
            size //= 2
            split = [cell for cell in cells if _differs(codes, cell, 2 * size)]
            nodes = {n for cell in split for n in _lattice(cell, size, 3)}
            if missing := sorted(n for n in nodes if codes[n] == NOT_COMPUTED):
                return missing
            cells = [part for cell in split for part in _lattice(cell, size, 2)]
        return []

    def _codes(self, labels: Mapping[Place, Any]) -> Array:
        shape = tuple((n - 1) * self.step + 1 for n in self.grid.shape)
        codes = np.full(shape, NOT_COMPUTED, dtype=np.int32)
        known: dict[Any, int] = {}
        for place, label in labels.items():
            codes[place] = NO_LABEL if label is None else known.setdefault(label, len(known) + 1)
        return codes


def _lattice(cell: Place, step: int, count: int) -> Iterator[Place]:
    """The places of a cell in steps: `count` along each dimension."""
    for offsets in itertools.product(range(count), repeat=len(cell)):
        yield tuple(k + step * n for k, n in zip(cell, offsets, strict=True))


def _differs(codes: Array, cell: Place, size: int) -> bool:
    """Whether labels at known places of a closed cell differ."""
    block = codes[tuple(slice(k, k + size + 1) for k in cell)]
    known = block[block > NO_LABEL]
    return bool(known.size and (known != known[0]).any())


def refine(grid: Points, label: str | Sequence[str], *, depth: int = 3) -> Refinement:
    """A grid that gets more points where a label changes: the boundary, to 2**-depth of a cell.

    `label` is the name of a recorded number or text with one value a point, or several of them:
    `n_states`, `bifurcation`, `stability`. The points are in a row, not a table. Raises
    InvalidInput.

    >>> import amoeboid as am
    >>> coarse = am.grid(D=[0.1, 0.2, 0.3], v_p0=[4, 5, 6])
    >>> found = am.sweep(am.refine(coarse, "value", depth=2), lambda p: p.v_p0 > 18 * p.D + 1)
    >>> len(coarse), len(found)
    (9, 47)
    """
    if not isinstance(grid, Points) or not grid.axes:
        raise InvalidInput(f"refine needs a grid from amoeboid.grid, got {grid!r:.100}")
    names = tuple(label) if isinstance(label, list | tuple) else (label,)
    if not names or not all(isinstance(name, str) for name in names):
        raise InvalidInput(f"label must be a name, or several, got {label!r:.100}")
    if isinstance(depth, bool) or not isinstance(depth, Integral) or not 1 <= depth <= MAX_DEPTH:
        raise InvalidInput(f"depth must be a whole number from 1 to {MAX_DEPTH}, got {depth!r}")
    for name, values in grid.axes.items():
        rising = sorted(values) == list(values) or sorted(values, reverse=True) == list(values)
        if len(values) < 2 or not all(isinstance(v, float) for v in values) or not rising:
            raise InvalidInput(
                "a grid to refine must have at least two numbers in order for each name, got "
                f"{name} = {list(values)!r:.100}"
            )
    nodes = math.prod((n - 1) * 2 ** int(depth) + 1 for n in grid.shape)
    if nodes > MAX_LATTICE:
        raise InvalidInput(
            f"the finest grid must have at most {MAX_LATTICE} points, got {nodes}; lower the "
            "depth, or start from fewer points"
        )
    return Refinement(grid, names, int(depth))
