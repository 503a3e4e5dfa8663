"""Units as powers of length, time, mass and number; physical quantities, by pint.

Filaments are counted: a concentration in mol is multiplied by the Avogadro number. This module is
the only importer of pint.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from amoeboid.extras import needed
from amoeboid.validation import InvalidInput

NO_DIMENSION = (None, "", "1")
"""How a number without a dimension states it."""

QUANTITIES = "quantities with units need"
_BASE = {"L": "meter", "T": "second", "M": "kilogram", "N": "1"}
_CUSTOMARY_BASE = {"L": "um", "T": "s", "M": "kg"}
_CUSTOMARY = {
    "M/(L T^2)": "Pa",
    "M/T^2": "mN/m",
    "M/T": "mPa s m",
    "M L^2/(T^2 N)": "Pa m^3",
    "M/(L T)": "mPa s",
    "M/(L^2 T)": "Pa s/um",
    "M L/T": "pN s",
    "M L^2/T": "pN um s",
    "M L^2/T^2": "pN um",
    "M L^2/T^3": "aW",
}
# Printed with the first symbol, the micro sign; Pint 0.26 has the Greek letter there.
_MICRO = "micro- = 1e-6 = \u00b5- = \u03bc- = u- = mu- = mc-"
# Signs of print, and blanks of any width, as the keyboard has them.
_SIGNS = str.maketrans({"\u00d7": "*", "\u00b7": "*", "\u22c5": "*", "\u2212": "-"})
_TOKEN = re.compile(
    r"""\ *(?:
    (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
    | (?P<unit>[A-Za-z\u00b5\u03bc\u00c5\u212b\u03a9][A-Za-z0-9_\u00b5\u03bc\u00c5\u212b\u03a9]*)
    | (?P<power>(?:\^|\*\*)\ *[+-]?\d(?![\d.])|[\u207b]?[\u00b2\u00b3\u00b9\u2070\u2074-\u2079])
    | (?P<sign>[+-])
    | (?P<operator>[*/])
    | (?P<opening>\()
    | (?P<closing>\))
    | (?P<end>$)
    )""",
    re.VERBOSE | re.ASCII,
)
# What each part of a quantity may follow; "" is the beginning.
_FOLLOWS = {
    "number": {"", "sign", "operator", "opening"},
    "unit": {"number", "unit", "power", "operator", "opening", "closing"},
    "power": {"number", "unit", "closing"},
    "sign": {""},
    "operator": {"number", "unit", "power", "closing"},
    "opening": {"", "operator"},
    "closing": {"number", "unit", "power", "closing"},
    "end": {"number", "unit", "power", "closing"},
}


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
                f"a unit of {dimension} must be within double precision, got one from a length of "
                f"{self.length:g}, a time of {self.time:g} and a mass of {self.mass:g}; choose "
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


def measured(name: str, value: Any, dimension: str, example: str) -> float:
    """A quantity (a text such as "10 um", or pint's own) of a dimension, in SI base units.

    Raises InvalidInput, naming `name` and giving an `example`, if it is no quantity or has another
    dimension.
    """
    quantity = _counted(_parsed(name, value, example))
    wanted = _registry().parse_units(_base_unit(dimension))
    if quantity.dimensionality != wanted.dimensionality:
        raise InvalidInput(
            f"{name} must have the dimension {dimension}, such as {example!r}, "
            f"got {str(value)!r} ({quantity.dimensionality})"
        )
    return float(quantity.to(wanted).magnitude)


def in_si(name: str, text: str) -> tuple[float, tuple[float, float, float]]:
    """A quantity as a number of SI base units, and its powers of length, time and mass.

    Raises InvalidInput, naming `name`, if it is no quantity or has other powers as well.
    """
    found = _counted(_parsed(name, text, "5 min"))
    powers = dict(found.dimensionality)
    known = tuple(float(powers.pop(f"[{base}]", 0)) for base in ("length", "time", "mass"))
    if powers:
        raise InvalidInput(
            f"{name} must be a quantity of length, time and mass, got {text!r} "
            f"({found.dimensionality})"
        )
    return float(found.to_base_units().magnitude), (known[0], known[1], known[2])


def quantity(value: Any, dimension: str, units: Units) -> Any:
    """A number, or an array, of a dimension in the units of a cell as a quantity of pint.

    It is measured in micrometres, seconds, pascals and the like; `.to("mm/h")` converts it.
    """
    registry = _registry()
    base = registry.parse_units(_base_unit(dimension))
    return (value * units.of(dimension) * base).to(customary_unit(dimension))


def customary_unit(dimension: str) -> str:
    """The unit that cell biologists measure a dimension such as "L/T" in: "um/s"."""
    if dimension in _CUSTOMARY:
        return _CUSTOMARY[dimension]
    above: list[str] = []
    below: list[str] = []
    for symbol, power in exponents(dimension):
        if symbol != "N":
            name = _CUSTOMARY_BASE[symbol]
            side = above if power > 0 else below
            side.append(name if abs(power) == 1 else f"{name}^{abs(power)}")
    unit = " ".join(above) or "1"
    if len(below) > 1:
        return f"{unit}/({' '.join(below)})"
    return f"{unit}/{below[0]}" if below else unit


@cache
def customary_power(dimension: str) -> int:
    """The power of ten of SI base units that `customary_unit` is: -6 for a length, in um."""
    unit = _registry().parse_units(customary_unit(dimension))
    return round(math.log10(float((1.0 * unit).to(_base_unit(dimension)).magnitude)))


def in_unit(value: float, dimension: str, units: Units, unit: str) -> float:
    """A simulation value of a dimension such as "L/T" as a number of physical `unit`s."""
    registry = _registry()
    magnitude = value * units.of(dimension)
    quantity = magnitude * registry.parse_units(_base_unit(dimension))
    return float(quantity.to(unit).magnitude)


def magnitude(quantity: Any, unit: str) -> float:
    """A quantity (a text, or pint's own) as a number of `unit`s; moles become numbers.

    Raises InvalidInput if it is no quantity or has another dimension.
    """
    registry = _registry()
    found = _counted(_parsed("quantity", quantity, unit))
    wanted = registry.parse_units(unit)
    if found.dimensionality != wanted.dimensionality:
        raise InvalidInput(
            f"quantity must be measurable in {unit}, got {quantity!r} ({found.dimensionality})"
        )
    return float(found.to(wanted).magnitude)


def _parsed(name: str, value: Any, example: str) -> Any:
    """A quantity of our registry, with a finite magnitude. Raises InvalidInput."""
    pint = needed("pint", QUANTITIES)
    why = "it has no unit"
    found: Any = None
    try:
        if isinstance(value, pint.Quantity):
            found = _registry().Quantity(value.magnitude, str(value.units))
        elif isinstance(value, str):
            text = " ".join(value.translate(_SIGNS).split())
            why = (
                _misread(text)
                or "its unit is unknown, or it cannot be computed; write squares as um^2"
            )
            found = None if _misread(text) else _registry().parse_expression(text)
            found = _registry().Quantity(found) if isinstance(found, int | float) else found
        magnitude = None if found is None else float(found.magnitude)
    except Exception:  # pint raises whatever its parser meets: tokens, attributes, zero division
        magnitude = None
    if magnitude is None or not math.isfinite(magnitude):
        why = why if magnitude is None else "it is not finite"
        raise InvalidInput(
            f"{name} must be a number with a unit, such as {example!r}, got {value!r}: {why}"
        )
    return found


def _misread(text: str) -> str | None:
    """What pint would not take as it is meant: it skips characters that it does not know.

    Read are numbers, units, products, quotients, powers of one digit, and brackets.
    """
    before, place = "", 0
    while before != "end":
        match = _TOKEN.match(text, place)
        if match is None or match.lastgroup is None:
            return _stray(text[place:].lstrip())
        kind = match.lastgroup
        if before not in _FOLLOWS[kind]:
            return _misplaced(kind, before)
        if before == "" and kind == "opening":
            kind = ""  # what may begin may begin in a bracket
        before, place = kind, match.end()
    return None


def _stray(rest: str) -> str:
    if rest[0] == ",":
        return "write a decimal point, not a comma, and nothing between thousands"
    if rest[0] in "^*":
        return "powers must be whole numbers of one digit; write 1e-12, not 10^-12"
    return f"{rest[0]!r} has no meaning in a quantity; leave it out"


def _misplaced(kind: str, before: str) -> str:
    if kind == "number":
        return "two numbers follow each other; write one, or * between them"
    if kind == "unit":
        return "the number is missing; write 1 for a single unit"
    if kind == "sign":
        return "write one number, not a sum or a range"
    return "it ends early" if kind == "end" else "operators or brackets are misplaced"


def _counted(quantity: Any) -> Any:
    """Moles as numbers of molecules."""
    moles = quantity.dimensionality.get("[substance]", 0)
    if moles == 0:
        return quantity
    return quantity * (_registry().Quantity(1, "avogadro_constant").to("1/mole")) ** moles


def _base_unit(dimension: str) -> str:
    return re.sub(r"[LTMN]", lambda m: _BASE[m.group()], _spelled(dimension))


def _spelled(dimension: str) -> str:
    """A dimension with every product and power written out: "M/(L T^2)" as "M/(L * T**2)"."""
    return re.sub(r"(?<=[\w)]) +(?=[\w(])", " * ", dimension.replace("^", "**"))


@cache
def _registry() -> Any:
    pint = needed("pint", QUANTITIES)
    registry = pint.UnitRegistry(on_redefinition="ignore")
    registry.define(_MICRO)
    registry.formatter.default_format = ".6g~P"
    registry.separate_format_defaults = True  # ".3f" says how numbers look, units stay short
    return registry
