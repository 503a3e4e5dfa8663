"""Physical quantities to simulation units and back; the only importer of pint.

Filaments are counted: a concentration in mol is multiplied by the Avogadro number. Base units of
the simulation: length R0, time 1/beta, mass eta_s/beta, filaments c_r R0^2.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

from amoeboid.parameters import PARAMETER_NAMES, Parameters
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

_DIMENSIONS = {f.name: f.metadata["unit"] for f in fields(Parameters) if "kind" in f.metadata}
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


# pint computes powers as written, and 9**9**9 would take forever: one-digit exponents only.
_UNREASONABLE_POWER = re.compile(r"(\*\*|\^)(?!\s*[-+]?\d(?![\d.])(?!\s*(\*\*|\^)))")


@dataclass(frozen=True, kw_only=True)
class Scales:
    """What one simulation unit is: length [m], time [s], mass [kg], filaments [1]."""

    length: float
    time: float
    mass: float
    filaments: float


def to_simulation(physical: Mapping[str, Any]) -> tuple[Parameters, Scales]:
    """Simulation parameters and scales from quantities (texts such as "10 um", or pint's own).

    Parameters left out are those of `PAPER_CELL`. Raises InvalidInput for an unknown name, a
    text that is no quantity, or a wrong dimension, naming the parameter.
    """
    refuse_unknown(physical, PARAMETER_NAMES, "parameter")
    given = {**PAPER_CELL, **physical}
    law = given.pop("law")
    si = {name: _in_base_units(name, value) for name, value in given.items()}
    Parameters(**si, law=law)  # refuses values out of range in the user's own numbers
    scales = _scales(si)
    values = {name: si[name] / _scale(_DIMENSIONS[name], scales) for name in si}
    # By definition; dividing would leave rounding.
    values |= {"R0": 1.0, "eta_s": 1.0, "c_r": 1.0}
    return Parameters(**values, law=law), scales


def to_physical(p: Parameters, scales: Scales) -> dict[str, Any]:
    """The parameters as pint quantities in SI base units; the law as its name."""
    registry = _registry()
    quantities: dict[str, Any] = {}
    for name, dimension in _DIMENSIONS.items():
        magnitude = getattr(p, name) * _scale(dimension, scales)
        quantities[name] = magnitude * registry.parse_units(_base_unit(dimension))
    return quantities | {"law": p.law.name}


def in_unit(value: float, dimension: str, scales: Scales, unit: str) -> float:
    """A simulation value of a dimension such as "L/T" as a number of physical `unit`s."""
    registry = _registry()
    magnitude = value * _scale(dimension, scales)
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


def _scales(si: Mapping[str, float]) -> Scales:
    if si["beta"] > 0:
        time = 1 / si["beta"]
    elif si["D"] > 0:
        time = si["R0"] ** 2 / si["D"]
    else:
        raise InvalidInput("beta and D must not both be 0: one of them sets the unit of time")
    return Scales(
        length=si["R0"],
        time=time,
        mass=si["eta_s"] * time,
        filaments=si["c_r"] * si["R0"] ** 2,
    )


def _in_base_units(name: str, value: Any) -> float:
    dimension = _DIMENSIONS[name]
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
    registry = _registry()
    if isinstance(value, registry.Quantity):
        return value
    try:
        if _UNREASONABLE_POWER.search(str(value)):
            raise ValueError
        # pint splits products at blanks and reads numbers and units only.
        found = registry.parse_expression(value) if isinstance(value, str) else None
        found = registry.Quantity(found) if isinstance(found, int | float) else found
        if not isinstance(found, registry.Quantity) or not isinstance(found.magnitude, int | float):
            raise TypeError
    except Exception:  # pint raises whatever its parser meets: tokens, attributes, zero division
        raise InvalidInput(
            f"{name} must be a number with a unit, such as {example!r}, got {value!r}"
        ) from None
    return found


def _counted(quantity: Any) -> Any:
    """Moles as numbers of molecules."""
    moles = quantity.dimensionality.get("[substance]", 0)
    return quantity * (_registry().Quantity(1, "avogadro_constant").to("1/mole")) ** moles


def _scale(dimension: str, scales: Scales) -> float:
    """One simulation unit of a dimension in SI base units."""
    powers = {"L": scales.length, "T": scales.time, "M": scales.mass, "N": scales.filaments}
    above, _, below = dimension.partition("/")
    scale = 1.0
    for text, sign in ((above, 1), (below, -1)):
        for symbol, exponent in re.findall(r"([LTMN])(?:\^(\d))?", text):
            scale *= powers[symbol] ** (sign * int(exponent or 1))
    return scale


def _base_unit(dimension: str) -> str:
    text = re.sub(r"\) *$", ")", dimension).replace("^", "**")
    text = re.sub(r"[LTMN]", lambda m: _BASE[m.group()], text)
    return re.sub(r"(?<=[\w)]) +(?=[\w(])", " * ", text)


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()
