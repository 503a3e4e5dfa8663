"""A parameter point as the page sends it: units, and a number or a text for each name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from amoeboid.model.parameters import PARAMETER_NAMES, RELATIONS, Parameters
from amoeboid.model.units import customary_unit
from amoeboid.validation import InvalidInput, is_text

SIMULATION, PHYSICAL = "simulation", "physical"
UNITS = (SIMULATION, PHYSICAL)
MAX_NAMES, MAX_LENGTH = 40, 200


class InvalidField(InvalidInput):
    """What breaks a rule, and the field of the page that it was typed into."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(message)
        self.name = name

    def __reduce__(self) -> Any:
        return type(self), (self.name, str(self))


def parameters_of(units: Any, values: Any) -> Parameters:
    """The parameters of a point. Raises InvalidField, which names the field.

    In simulation units they start from the paper's table, in physical ones from the paper's cell; a
    number without a unit is then in the customary one.

    >>> parameters_of("simulation", {"D": "0.4"}).D
    0.4
    """
    if units not in UNITS:
        raise InvalidField("units", f"units must be one of {', '.join(UNITS)}, got {units!r:.80}")
    if not isinstance(values, Mapping) or len(values) > MAX_NAMES:
        raise InvalidField("", f"parameters must be names and values, at most {MAX_NAMES} of them")
    given = {name: _value(name, value, units) for name, value in values.items()}
    try:
        return _made(units, given)
    except InvalidInput as error:
        raise InvalidField(_to_blame(units, given), str(error)) from None


def _made(units: str, given: Mapping[str, Any]) -> Parameters:
    return Parameters.physical(**given) if units == PHYSICAL else Parameters().replace(**given)


def _to_blame(units: str, given: Mapping[str, Any]) -> str:
    """The name whose value is refused also without the others; "" if they are so together."""
    for name in given:
        kind = name.partition(".")[0]
        group = [n for n in given if kind in RELATIONS and n.partition(".")[0] == kind] or [name]
        try:
            _made(units, {n: given[n] for n in group})
        except InvalidInput:
            return name
    return ""


def _value(name: Any, value: Any, units: str) -> Any:
    """A number, or a text where the parameter takes one. Raises InvalidField."""
    if not isinstance(name, str) or len(name) > MAX_LENGTH:
        raise InvalidField("", f"the name of a parameter must be a short text, got {name!r:.80}")
    if isinstance(value, str) and (len(value) > MAX_LENGTH or not is_text(value)):
        raise InvalidField(name, f"{name} must be a text of at most {MAX_LENGTH} characters")
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        raise InvalidField(name, f"{name} must be a number or a text, got {value!r:.80}")
    if name in RELATIONS:
        return str(value)
    number = _number(value)
    if units == SIMULATION:
        if number is None:
            raise InvalidField(
                name,
                f"{name} must be a number such as 0.4, got {value!r}; for quantities with units "
                "choose physical units",
            )
        return number
    dimension = "" if number is None else _dimension(name)
    return value if number is None or not dimension else f"{number!r} * {customary_unit(dimension)}"


def _dimension(name: str) -> str:
    return (Parameters().dimension(name) or "") if name in PARAMETER_NAMES else ""


def _number(value: Any) -> float | None:
    try:
        return float(str(value).strip().replace("\u2212", "-"))
    except ValueError:
        return None
