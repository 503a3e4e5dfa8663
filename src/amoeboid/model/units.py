"""Physical quantities to simulation units and back; the only importer of pint.

Filaments are counted: a concentration in mol is multiplied by the Avogadro number. Base units of
the simulation: length R0, time 1/beta, mass eta_s/beta, filaments c_r R0^2.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from amoeboid.model.dimensions import DIMENSIONS, Units
from amoeboid.model.parameters import PARAMETER_NAMES, Parameters
from amoeboid.validation import InvalidInput, refuse_unknown

# The cell of the paper's estimates (SI, section on parameters): the last column of its table, with
# c_r = mu h for 8.5 umol/l of monomers in a cortex of 190 nm, and eta_b = eta_s.
PAPER_CELL: dict[str, str] = {
    "R0": "10 um",
    "delta_P": "300 Pa",
    "eta_s": "2.7 mPa s m",
    "eta_b": "2.7 mPa s m",
    "c0": "1370 / um^2",
    "c_r": "8.5 umol/l * 190 nm",
    "beta": "0.1 / s",
    "D": "0.03 um^2/s",
    "v_p0": "1.7 um/s",
    "alpha": "0 Pa m^3",
    "law": "exponential",
}

_BASE = {"L": "meter", "T": "second", "M": "kilogram", "N": "1"}
_EXAMPLES = {
    "L": "10 um",
    "M/(L T^2)": "300 Pa",
    "M/T": "2.7 mPa s m",
    "N/L^2": "1370 / um^2",
    "1/T": "0.1 / s",
    "L^2/T": "0.03 um^2/s",
    "L/T": "1.7 um/s",
    "M L^2/(T^2 N)": "4e-20 Pa m^3",
}


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


def to_simulation(physical: Mapping[str, Any]) -> tuple[Parameters, Units]:
    """Simulation parameters from quantities (texts such as "10 um", or pint's own), and the units.

    The units of the simulation are measured in SI units: what to multiply its numbers by.
    Parameters left out are those of `PAPER_CELL`. Raises InvalidInput for an unknown name, a
    text that is no quantity, or a wrong dimension, naming the parameter.
    """
    refuse_unknown(physical, PARAMETER_NAMES, "parameter")
    given = {**PAPER_CELL, **physical}
    law = given.pop("law")
    si = {name: _in_base_units(name, value) for name, value in given.items()}
    Parameters(**si, law=law)  # refuses values out of range in the user's own numbers
    units = _base_units(si)
    values = {name: si[name] / units.of(DIMENSIONS[name]) for name in si}
    # By definition; dividing would leave rounding.
    values |= {"R0": 1.0, "eta_s": 1.0, "c_r": 1.0}
    return Parameters(**values, law=law), units


def to_physical(p: Parameters, units: Units) -> dict[str, Any]:
    """The parameters as pint quantities in SI base units; the law as its name."""
    registry = _registry()
    quantities: dict[str, Any] = {}
    for name, dimension in DIMENSIONS.items():
        magnitude = getattr(p, name) * units.of(dimension)
        quantities[name] = magnitude * registry.parse_units(_base_unit(dimension))
    return quantities | {"law": p.law.name}


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


def _base_units(si: Mapping[str, float]) -> Units:
    if si["beta"] > 0:
        time = 1 / si["beta"]
    elif si["D"] > 0:
        time = si["R0"] ** 2 / si["D"]
    else:
        raise InvalidInput("beta and D must not both be 0: one of them sets the unit of time")
    return Units(
        length=si["R0"],
        time=time,
        mass=si["eta_s"] * time,
        filaments=si["c_r"] * si["R0"] ** 2,
    )


def _in_base_units(name: str, value: Any) -> float:
    dimension = DIMENSIONS[name]
    example = _EXAMPLES[dimension]
    quantity = _counted(_parsed(name, value, example))
    wanted = _registry().parse_units(_base_unit(dimension))
    if quantity.dimensionality != wanted.dimensionality:
        raise InvalidInput(
            f"{name} must have the dimension {dimension}, such as {example!r}, "
            f"got {str(value)!r} ({quantity.dimensionality})"
        )
    return float(quantity.to(wanted).magnitude)


def _parsed(name: str, value: Any, example: str) -> Any:
    """A quantity of our registry, with a finite magnitude. Raises InvalidInput."""
    import pint

    why = "it is neither a text nor a quantity of pint"
    found: Any = None
    try:
        if isinstance(value, pint.Quantity):
            found = _registry().Quantity(value.magnitude, str(value.units))
        elif isinstance(value, str):
            text = " ".join(value.translate(_SIGNS).split())
            why = (
                _misread(text) or "it has an unknown unit, or cannot be computed; a square is um^2"
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
    return f"{rest[0]!r} has no meaning in it; leave it out"


def _misplaced(kind: str, before: str) -> str:
    if kind == "number":
        return "numbers stand side by side; write one, or * between them"
    if kind == "unit":
        return "a number must come first; write 1 for a single unit"
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
    text = re.sub(r"\) *$", ")", dimension).replace("^", "**")
    text = re.sub(r"[LTMN]", lambda m: _BASE[m.group()], text)
    return re.sub(r"(?<=[\w)]) +(?=[\w(])", " * ", text)


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()
