"""What was measured: profiles along the meridian and numbers of the cell, with their errors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.display import html_table, text_table
from amoeboid.fitting.predictions import PROFILES
from amoeboid.fitting.tables import Column, Table, table
from amoeboid.model.parameters import Parameters
from amoeboid.model.units import NO_DIMENSION, customary_unit, measured
from amoeboid.studies import observed
from amoeboid.validation import InvalidInput, refuse_unknown

THETA, CELL, ERROR = "theta", "cell", "_error"
ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}
ARBITRARY = "a.u."
"""The unit of a profile that is known up to a factor: intensities of a microscope."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """One measured quantity: a profile at angles `theta` (m,), or for None numbers of the cell.

    `values` and `errors` (m,) are in `unit`, "" for numbers in the units of the parameters;
    `errors` is None if none are known. `cells` names the cell that each value is of.
    """

    name: str
    dimension: str | None
    unit: str
    theta: Array | None
    values: Array
    errors: Array | None
    cells: tuple[str, ...]

    @property
    def arbitrary(self) -> bool:
        """Whether the values are known up to a common factor."""
        return self.unit == ARBITRARY

    def size(self, p: Parameters) -> float:
        """What a value of 1 is in the units of the solver; 1 in arbitrary units."""
        if not self.unit or self.arbitrary or p.units is None:
            return 1.0
        return _size(self.unit, str(self.dimension)) / p.units.of(str(self.dimension))


@dataclass(frozen=True, eq=False, repr=False)
class Measurements(Sequence[Quantity]):
    """Measured quantities, as `measurements` reads them from a `source`: a sequence of them."""

    source: str
    quantities: tuple[Quantity, ...]

    def __getitem__(self, index: Any) -> Any:
        return self.quantities[index]

    def __len__(self) -> int:
        return len(self.quantities)

    @cached_property
    def cells(self) -> tuple[str, ...]:
        """Names of the cells, in order; empty if the table does not tell."""
        return tuple(dict.fromkeys(c for q in self.quantities for c in q.cells if c))

    @property
    def physical(self) -> bool:
        """Whether the values have units."""
        return any(q.unit and not q.arbitrary for q in self.quantities)

    def _rows(self) -> tuple[tuple[str, ...], list[list[str]]]:
        rows = []
        for q in self.quantities:
            error = "unknown" if q.errors is None else f"{float(np.median(q.errors)):.4g}"
            reach = f"{q.values.min():.4g} to {q.values.max():.4g}"
            rows.append([q.name, q.unit, str(q.values.size), reach, error])
        return ("quantity", "unit", "values", "range", "median error"), rows

    @property
    def _heading(self) -> str:
        cells = f", {len(self.cells)} cells" if self.cells else ""
        return f"Measurements from {self.source[-200:]}{cells}"

    def __repr__(self) -> str:
        titles, rows = self._rows()
        more = [f"... and {len(rows) - 8} more quantities"] if len(rows) > 8 else []
        return "\n".join([self._heading, *text_table(titles, rows[:8], "<<"), *more])

    def _repr_html_(self) -> str:
        titles, rows = self._rows()
        return html_table(self._heading, rows, titles)


def measurements(data: Any, theta_from: str = "front") -> Measurements:
    """Measurements from a CSV file, a dictionary of columns or a pandas.DataFrame.

    Columns: `theta [deg]` or `theta [rad]`, the angle at the center of volume, counted from the
    pole `theta_from`, "front" (low c) or "rear"; `u`, the retrograde flow, positive from front to
    rear; `c`, the concentration; the name of any observable, such as `max_retrograde_speed`, in
    rows of their own or beside others; each with a unit in square brackets, `[a.u.]` for a profile
    that is known up to a factor, none for numbers in the units of the parameters; `u_error` and
    the like, standard deviations; `cell`, a name. Entries may be empty.

    Raises InvalidInput with line, column, rule, value and remedy.

    >>> measurements({"theta [deg]": [30, 90, 150], "u [um/s]": [0.1, 0.2, 0.1]})
    Measurements from data
    quantity  unit  values       range  median error
    --------  ----  ------  ----------  ------------
    u         um/s       3  0.1 to 0.2       unknown
    """
    if isinstance(data, Measurements):
        return data
    found = table(data)
    by_name = _columns(found)
    quantities = [_quantity(found, by_name, name, theta_from) for name in _quantity_names(by_name)]
    kept = tuple(q for q in quantities if q.values.size)
    if not kept:
        raise InvalidInput(
            f"{found.source} must hold a measured quantity (u, c or the name of an observable) "
            f"with at least one value, got the columns {', '.join(by_name)}; add one"
        )
    _check_units(found, kept)
    return Measurements(found.source, kept)


def _known() -> tuple[str, ...]:
    return (*PROFILES, *observed.names())


def dimension_of(name: str) -> str | None:
    """The dimension of a quantity that can be measured. Raises InvalidInput for another name."""
    refuse_unknown([name], _known(), "quantity")
    return PROFILES[name] if name in PROFILES else observed.dimension(name)


def _quantity_names(by_name: Mapping[str, Column]) -> list[str]:
    return [name for name in by_name if name in _known()]


def _columns(found: Table) -> dict[str, Column]:
    """The columns by name. Raises InvalidInput for unknown, doubled and lonely ones."""
    names = [column.name for column in found.columns]
    known = _known()
    doubled = [name for name, count in Counter(names).items() if count > 1]
    if doubled:
        raise InvalidInput(
            f"{found.source}, {found.top}: column names must differ, {doubled[0]!r} occurs twice; "
            "rename or remove one"
        )
    for column in found.columns:
        name = column.name
        stem = name.removesuffix(ERROR)
        try:
            refuse_unknown([name if name in known else stem], (THETA, CELL, *known), "column")
        except InvalidInput as error:
            raise found.problem(None, column.heading, str(error)) from None
        if name not in (THETA, CELL, *known) and (stem in (THETA, CELL) or stem not in names):
            raise found.problem(
                None, column.heading, f"needs a column {stem!r} of its quantity; add it"
            )
        if name in PROFILES and THETA not in names:
            raise found.problem(None, column.heading, "needs a column theta [deg]; add the angles")
        if name == THETA and column.unit not in ANGLES:
            raise found.problem(
                None,
                column.heading,
                f"must be headed theta [deg] or theta [rad], got {name!r} "
                f"with the unit {column.unit!r}",
            )
    return {column.name: column for column in found.columns}


def _quantity(found: Table, by_name: Mapping[str, Column], name: str, theta_from: str) -> Quantity:
    column, errors_of = by_name[name], by_name.get(f"{name}{ERROR}")
    dimension = dimension_of(name)
    unit = _unit(found, column, name, dimension)
    if errors_of is not None and errors_of.unit != column.unit:
        raise found.problem(
            None, errors_of.heading, f"must have the same unit as {column.heading!r}; correct it"
        )
    values, errors, theta, cells = [], [], [], []
    for row in range(len(found.rows)):
        value = found.number(column, row)
        if value is None:
            continue
        values.append(value)
        cells.append(str(by_name[CELL].entries[row]).strip() if CELL in by_name else "")
        if errors_of is not None:
            errors.append(_error(found, errors_of, row))
        if name in PROFILES:
            theta.append(_angle(found, by_name[THETA], row, theta_from))
    if errors_of is None and name not in PROFILES and values:
        raise found.problem(
            None,
            column.heading,
            f"needs a column {name}{ERROR}, because the error of a few numbers cannot be "
            "estimated from their residuals; add it",
        )
    return Quantity(
        name,
        dimension,
        unit,
        np.array(theta) if name in PROFILES else None,
        np.array(values),
        None if errors_of is None else np.array(errors),
        tuple(cells),
    )


def _error(found: Table, column: Column, row: int) -> float:
    error = found.number(column, row)
    if error is None or error <= 0:
        got = "nothing" if error is None else f"{error:g}"
        raise found.problem(
            row,
            column.heading,
            f"must be a standard deviation > 0 for each value, got {got}; leave out the whole "
            "column if errors are unknown",
        )
    return error


def _angle(found: Table, column: Column, row: int, theta_from: str) -> float:
    value = found.number(column, row)
    size = ANGLES[str(column.unit)]
    if value is None or not -1e-9 <= value * size <= np.pi + 1e-9:
        got = "nothing" if value is None else f"{value:g}"
        raise found.problem(
            row,
            column.heading,
            f"must be an angle from 0 to 180 deg for each value, got {got}; reflect the other "
            "half of the outline onto it",
        )
    theta = min(max(value * size, 0.0), np.pi)
    return np.pi - theta if theta_from == "rear" else theta


def _unit(found: Table, column: Column, name: str, dimension: str | None) -> str:
    """The unit of a column; "" for plain numbers. Raises InvalidInput for a wrong one."""
    unit = column.unit or ""
    if unit == ARBITRARY:
        if name not in PROFILES:
            raise found.problem(
                None,
                column.heading,
                f"only a profile may be in arbitrary units [a.u.]; give {name} a unit",
            )
        return unit
    if dimension in NO_DIMENSION:
        if unit not in ("", "1"):
            raise found.problem(
                None, column.heading, f"{name} is dimensionless, got the unit {unit!r}; omit it"
            )
        return ""
    if unit:
        try:
            _size(unit, str(dimension))
        except InvalidInput as error:
            raise found.problem(None, column.heading, str(error)) from None
    return unit


def _size(unit: str, dimension: str) -> float:
    """A unit such as "um/s" in SI base units. Raises InvalidInput."""
    text = unit if unit[:1].isdigit() else f"1 {unit}"
    return measured("the unit", text, dimension, customary_unit(dimension))


def _check_units(found: Table, quantities: Sequence[Quantity]) -> None:
    """Raise InvalidInput where some values have units and others are plain numbers."""
    dimensional = [q for q in quantities if q.dimension not in NO_DIMENSION and not q.arbitrary]
    plain = [q.name for q in dimensional if not q.unit]
    if plain and len(plain) < len(dimensional):
        raise InvalidInput(
            f"{found.source}, {found.top}: either all quantities or none must have a unit, "
            f"{plain[0]!r} has none; write one, such as {plain[0]} "
            f"[{customary_unit(str(dimension_of(plain[0])))}]"
        )
