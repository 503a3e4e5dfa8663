"""Quantities with units in the sections of a configuration: "15 min", "300 / um^2"."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from numbers import Real
from typing import Any

from amoeboid.model.changes import CUE_STRENGTH, flat_changes
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import DIMENSIONS, Parameters
from amoeboid.model.physical import number_in
from amoeboid.model.units import NO_DIMENSION
from amoeboid.sections import Initial, Mesh, Noise, Output, Time

SECTION_CLASSES: dict[str, type] = {
    section.__name__.lower(): section for section in (Mesh, Initial, Time, Output, Noise, Cue)
}
"""The sections whose fields are declared, by name."""

Convert = Callable[[str, Any, "str | None"], Any]


def in_numbers(
    section: str, values: Mapping[str, Any], p: Parameters, plain: bool
) -> dict[str, Any]:
    """The `values` of a section with quantities as numbers in the units of the cell p.

    Without units of the cell nothing is changed. `plain`: whether a number without a unit is one in
    the units of the cell; otherwise 0 alone is. What is neither number nor quantity is left to the
    section itself. Raises InvalidInput.
    """
    if p.units is None:
        return dict(values)
    units = p.units

    def convert(label: str, value: Any, dimension: str | None) -> Any:
        number = isinstance(value, Real) and not isinstance(value, bool)
        if (
            dimension in NO_DIMENSION
            or not (number or isinstance(value, str))
            or (number and plain)
        ):
            return value
        return number_in(units, value, str(dimension), label)

    if section == "parameters":
        return {name: convert(name, v, DIMENSIONS.get(name)) for name, v in values.items()}
    if section == "changes":
        return {n: _change(f"changes.{n}", v, _changing(p, n), convert)
                for n, v in flat_changes(values).items()}  # fmt: skip
    declared = {f.name: f.metadata for f in fields(SECTION_CLASSES[section])}
    return {
        name: _field(f"{section}.{name}", value, declared.get(name, {}), convert)
        for name, value in values.items()
    }


def _field(label: str, value: Any, about: Mapping[str, Any], convert: Convert) -> Any:
    """The value of a declared field."""
    if "row_units" in about:
        return _rows(label, value, about["row_units"], convert)
    if _is_list(value):
        return [convert(label, item, about.get("unit")) for item in value]
    return convert(label, value, about.get("unit"))


def _changing(p: Parameters, name: str) -> str | None:
    """The dimension of what changes in time."""
    return "1" if name == CUE_STRENGTH else p.dimension(name)


def _change(label: str, value: Any, dimension: str | None, convert: Convert) -> Any:
    """What a file holds of a parameter that changes in time."""
    if isinstance(value, Mapping):
        return {kind: _change(label, points, dimension, convert) for kind, points in value.items()}
    return _rows(label, value, ("T", dimension), convert)


def _rows(label: str, rows: Any, units: Sequence[str | None], convert: Convert) -> Any:
    """Rows of numbers with the dimensions `units`; what has another form is left as it is."""
    if not _is_list(rows):
        return rows
    return [
        [convert(label, x, unit) for x, unit in zip(row, units, strict=True)]
        if _is_list(row) and len(row) == len(units)
        else row
        for row in rows
    ]


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple)
