"""The natural units of a cell, and the same cell in other units.

Every answer is the same cell in any units. Where different quantities enter one inner product, one
norm or one elimination, the computation is done in the natural units of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.parameters import DIMENSIONS, Parameters
from amoeboid.model.polymerization import Law
from amoeboid.model.units import Units


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
