"""Units as powers of length, time, mass and number, and the natural units of a cell.

Every answer is the same cell in any units. Where different quantities enter one inner product, one
norm or one elimination, the computation is done in the natural units of the cell.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.parameters import Parameters
from amoeboid.model.polymerization import Law
from amoeboid.validation import InvalidInput

DIMENSIONS = {f.name: f.metadata["unit"] for f in fields(Parameters) if "kind" in f.metadata}
"""Dimension of each parameter, such as "L^2/T"; the law has none."""


@dataclass(frozen=True, kw_only=True)
class Units:
    """The size of the units of length L, time T, mass M and number of filaments N."""

    length: float
    time: float
    mass: float
    filaments: float

    def of(self, dimension: str) -> float:
        """The size of the unit of a dimension such as "M/(L T^2)".

        Raises InvalidInput where it is beyond double precision.
        """
        powers = {"L": self.length, "T": self.time, "M": self.mass, "N": self.filaments}
        size = 1.0
        try:
            for symbol, exponent in exponents(dimension):
                size *= powers[symbol] ** exponent
        except (OverflowError, ZeroDivisionError):
            size = 0.0
        if not 0.0 < size < math.inf:
            raise InvalidInput(
                f"a unit of {dimension} must be within double precision, it is not with a length "
                f"of {self.length:g}, a time of {self.time:g} and a mass of {self.mass:g}; choose "
                "other units"
            )
        return size


@cache
def exponents(dimension: str) -> tuple[tuple[str, int], ...]:
    """Base dimensions with their exponents: "L^2/T" gives (("L", 2), ("T", -1))."""
    above, _, below = dimension.partition("/")
    return tuple(
        (symbol, sign * int(exponent or 1))
        for text, sign in ((above, 1), (below, -1))
        for symbol, exponent in re.findall(r"([LTMN])(?:\^(\d))?", text)
    )


@dataclass(frozen=True)
class MeasuredLaw(Law):
    """A law whose speeds and concentrations are measured in other units than those of `law`.

    The numbers in an expression such as `v_p0*exp(-(c - 3)/2)` belong to its own units.
    """

    law: Law
    units: Units

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of the law itself."""
        return self.law.name

    def derivatives(
        self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike, order: int = 3
    ) -> tuple[Array, ...]:
        """See Law.derivatives."""
        speed, concentration = self.units.of("L/T"), self.units.of("N/L^2")
        own = self.law.derivatives(
            np.asarray(c) * concentration,
            np.asarray(v_p0) * speed,
            np.asarray(c_r) * concentration,
            order,
        )
        return tuple(v * (concentration**k / speed) for k, v in enumerate(own))


def in_units(p: Parameters, units: Units) -> Parameters:
    """The same cell with its parameters measured in other units."""
    values = {name: getattr(p, name) / units.of(unit) for name, unit in DIMENSIONS.items()}
    return Parameters(**values, law=MeasuredLaw(p.law, units))


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
