"""Numbers of a run in files, in the units that people measure in, without loss of a bit.

A run computes in the units of its cell. Where these have a size, a table holds seconds, micrometers
and the like, with as many digits as are needed to read the same number back.
"""

from __future__ import annotations

import math
from decimal import Context, Decimal
from functools import lru_cache

from amoeboid.model.units import NO_DIMENSION, Units, customary_power, exponents

CONTEXT = Context(prec=50, traps=[])
MORE_DIGITS = (18, 20, 22)
"""Significant digits of a number that the shortest text of a double does not give back."""


class Scale:
    """From numbers of a solver to texts in customary units and back; plain texts without `units`.

    >>> scale = Scale(Units(length=1e-5, time=10.0, mass=0.027, filaments=1e5))
    >>> scale.text(0.25, "T"), scale.number("2.5", "T")
    ('2.5', 0.25)
    """

    def __init__(self, units: Units | None) -> None:
        self.units = units

    def text(self, value: float, dimension: str | None) -> str:
        """A number as it is written."""
        if self.units is None or dimension in NO_DIMENSION:
            return str(value)
        size = _size(self.units, str(dimension))
        exact = CONTEXT.multiply(Decimal(value), size)
        texts = (repr(float(exact)), *(f"{exact:.{digits}g}" for digits in MORE_DIGITS))
        return next((text for text in texts if _divided(text, size) == value), texts[-1])

    def number(self, text: str, dimension: str | None) -> float:
        """The number of a text. Raises ValueError for a text that is none."""
        value = float(text)
        if self.units is None or dimension in NO_DIMENSION or not math.isfinite(value):
            return value
        return _divided(text, _size(self.units, str(dimension)))


def _divided(text: str, size: Decimal) -> float:
    return float(CONTEXT.divide(CONTEXT.create_decimal(text), size))


@lru_cache(maxsize=1000)
def _size(units: Units, dimension: str) -> Decimal:
    """A unit of the solver in customary units."""
    sizes = {"L": units.length, "T": units.time, "M": units.mass, "N": units.filaments}
    size = Decimal(10) ** -customary_power(dimension)
    for symbol, exponent in exponents(dimension):
        size = CONTEXT.multiply(size, CONTEXT.power(Decimal(sizes[symbol]), exponent))
    return size
