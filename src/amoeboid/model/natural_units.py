"""The natural units of a cell, and the same cell in other units.

Every answer is the same cell in any units. Where different quantities enter one inner product, one
norm or one elimination, the computation is done in the natural units of the cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from amoeboid.arrays import Array
from amoeboid.model.constitutive import Relation
from amoeboid.model.parameters import DIMENSIONS, ParameterPoint, Parameters
from amoeboid.model.polymerization import Law
from amoeboid.model.stress import NoStress, Stress
from amoeboid.model.units import Units


@dataclass(frozen=True)
class Measured(Relation):
    """A relation measured in other units than those of `relation`, which it holds.

    The numbers in an expression such as `v_p0*exp(-(c - 3)/2)`, and its own parameters, belong to
    its own units.
    """

    relation: Any
    units: Units
    dimensions: ClassVar[tuple[str, ...]]
    """Those of the value, and of the arguments."""

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of the relation itself."""
        return self.relation.name

    @property
    def above(self) -> float | None:  # type: ignore[override]
        """See Relation.above."""
        lowest = self.relation.above
        return None if lowest is None else lowest / self.units.of(self.dimensions[1])

    @property
    def own(self) -> dict[str, Any]:
        """The parameters of the relation itself."""
        return self.relation.own

    def replaced(self, own: Mapping[str, Any]) -> Self:
        """See Relation.replaced."""
        return replace(self, relation=self.relation.replaced(own))

    def with_values(self, own: Mapping[str, Any]) -> Self:
        """See Relation.with_values."""
        return replace(self, relation=self.relation.with_values(own))

    def _value(self, at: Sequence[Any]) -> Any:
        size, *sizes = (self.units.of(dimension) for dimension in self.dimensions)
        return self.relation.value(*(x * s for x, s in zip(at, sizes, strict=True))) / size

    def _to_order(self, order: int, at: Sequence[Any]) -> tuple[Array, ...]:
        size, *sizes = (self.units.of(dimension) for dimension in self.dimensions)
        measured = (np.asarray(x) * s for x, s in zip(at, sizes, strict=True))
        own = self.relation.derivatives(*measured, order=order)
        return tuple(v * (sizes[0] ** k / size) for k, v in enumerate(own))


class MeasuredLaw(Measured, Law):
    """A law whose speeds and concentrations are measured in other units than its own."""

    dimensions = ("L/T", "N/L^2", "L/T", "N/L^2")

    def value(self, c: Any, v_p0: Any, c_r: Any) -> Any:
        """See Law.value."""
        return self._value((c, v_p0, c_r))


class MeasuredStress(Measured, Stress):
    """A stress measured in other units than its own."""

    dimensions = ("M/T^2", "N/L^2", "N/L^2")

    def value(self, c: Any, c_r: Any) -> Any:
        """See Stress.value."""
        return self._value((c, c_r))


def in_units(p: Parameters, units: Units) -> Parameters:
    """The same cell with its parameters measured in other units."""
    return Parameters(**vars(point_in_units(p, units)))


def point_in_units(p: Parameters, units: Units) -> ParameterPoint:
    """The same as plain numbers, unchecked."""
    values = {name: getattr(p, name) / units.of(unit) for name, unit in DIMENSIONS.items()}
    none = isinstance(p.stress, NoStress)  # which is the same in any units
    law, stress = MeasuredLaw(p.law, units), p.stress if none else MeasuredStress(p.stress, units)
    return ParameterPoint(values | {"law": law, "stress": stress})


def natural_units(p: Parameters) -> Units:
    """The units in which a cell is of order one: R0, eta_s, c0 and the inverse of its fastest rate.

    c_r takes the place of c0 = 0, and the rate at which pressure moves the shape that of turnover,
    diffusion and treadmilling where all three are 0. Raises InvalidInput where `p.rate` does.
    """
    moves = p.beta > 0 or p.D > 0 or float(p.v_p(p.c0)) != 0
    time = 1.0 / (p.rate if moves else p.delta_P * p.R0 / p.eta_s or 1.0)
    return Units(
        length=p.R0,
        time=time,
        mass=p.eta_s * time,
        filaments=(p.c0 if p.c0 > 0 else p.c_r) * p.R0**2,
    )
