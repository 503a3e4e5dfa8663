"""Numbers of a cell in the units that it was given in, and tables of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.display import html_table
from amoeboid.extras import needed
from amoeboid.model.parameters import Parameters
from amoeboid.model.physical import number_in
from amoeboid.model.units import NO_DIMENSION, customary_unit, in_unit
from amoeboid.validation import InvalidInput

TABLE = "this table needs"
MAX_HTML_ROWS = 60
ROUNDING = 1e-12
"""Of a share; smaller ones are the rounding of the numbers that it is made from."""


@dataclass(frozen=True, eq=False)
class Column:
    """Values of one quantity, one a row, and their unit; "" where they have none."""

    values: Array
    unit: str

    @property
    def texts(self) -> list[str]:
        """The values as they are shown."""
        return [shown_number(value) for value in self.values]


def percent(share: float) -> str:
    """A share in percent; 0 where it is rounding alone."""
    return f"{100 * (share if abs(share) > ROUNDING else 0.0):.6g} %"


def shown_number(value: Any) -> str:
    """A value of a column: six significant digits; yes, no; words as they are."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return f"{value + 0.0:.6g}" if isinstance(value, float) else str(value)


def quantity(p: Parameters, value: Any, dimension: str | None) -> Any:
    """`value` with its unit, if the cell has physical ones and the value a dimension."""
    return value if dimension in NO_DIMENSION else p.quantity(value, str(dimension))


def magnitude(p: Parameters, value: ArrayLike, dimension: str | None) -> Any:
    """The number, or array, that `quantity` shows in front of `unit`."""
    shown = quantity(p, value, dimension)
    return getattr(shown, "magnitude", shown)


def unit(p: Parameters, dimension: str | None) -> str:
    """The unit in which `quantity` shows a dimension; the dimension itself for plain numbers."""
    if dimension in NO_DIMENSION:
        return ""
    return str(dimension) if p.units is None else customary_unit(str(dimension))


def column(p: Parameters, values: ArrayLike, dimension: str | None = None) -> Column:
    """The column of values in the units of the solver [dimension]."""
    return Column(np.asarray(magnitude(p, np.asarray(values), dimension)), unit(p, dimension))


def titled(name: str, unit: str) -> str:
    """The title of a column, with its unit if there is one."""
    return f"{name} [{unit}]" if unit else name


def text(p: Parameters, value: float, dimension: str | None, form: str = ".6g") -> str:
    """A number with its unit as texts show it; without, where the cell has none."""
    shown = f"{magnitude(p, value, dimension) + 0.0:{form}}"
    return shown if p.units is None else f"{shown} {unit(p, dimension)}".rstrip()


def with_units(p: Parameters, problems: Sequence[str], *names: str) -> tuple[str, ...]:
    """Problems that a solver tells, in its own numbers, with the units of these."""
    if p.units is None or not problems:
        return tuple(problems)
    units = ", ".join(f"{name} in units of {text(p, 1.0, p.dimension(name))}" for name in names)
    return (*problems, f"numbers in these messages are in the units of the solver: {units}")


def value_of(p: Parameters, name: str, given: Any, label: str = "") -> float:
    """The number of the parameter `name` in the units of p that `given` stands for.

    Given as a number, or where p has physical units as a quantity such as "2 um/s"; 0 needs no
    unit. Raises InvalidInput, also for a value that the parameter cannot have.
    """
    shown, dimension = label or name, p.dimension(name)
    value = number_of(p, given, dimension, shown)
    p.replace(**{name: value})
    return value


def number_of(p: Parameters, given: Any, dimension: str | None, shown: str) -> float:
    """The number [dimension] in the units of p that `given` stands for, `shown` in messages.

    Raises InvalidInput for a value that is not a number, or no quantity where p has physical units.
    """
    if p.units is None or dimension is None or dimension in NO_DIMENSION:
        return _number(shown, given)
    return number_in(p.units, given, dimension, shown)


def _number(label: str, given: Any) -> float:
    try:
        value = float(given)
    except (TypeError, ValueError):
        raise InvalidInput(
            f"{label} must be a number in the units of the parameters, got {given!r}; for "
            "quantities with units start from Parameters.physical (--physical)"
        ) from None
    if not np.isfinite(value):
        raise InvalidInput(f"{label} must be a finite number, got {value!r}")
    return value


def physical_number(p: Parameters, value: float, dimension: str | None) -> float:
    """A number as programs read it: in the unit of `unit`, or as it is without physical units."""
    if p.units is None or dimension is None or dimension in NO_DIMENSION:
        return float(value)
    return in_unit(value, str(dimension), p.units, customary_unit(str(dimension)))


def frame(columns: Mapping[str, Column], index: str = "") -> Any:
    """A pandas.DataFrame; units stand in its `attrs["units"]`."""
    pandas = needed("pandas", TABLE)
    table = pandas.DataFrame({name: c.values for name, c in columns.items()})
    table.attrs["units"] = {name: c.unit for name, c in columns.items()}
    if index:
        table.index.name = index
    return table


def dataset(
    columns: Mapping[str, Column],
    dimension: str,
    coordinates: Iterable[str] = (),
    **attributes: Any,
) -> Any:
    """An xarray.Dataset along one dimension; each variable has its unit as `attrs["units"]`."""
    xarray = needed("xarray", TABLE)
    named = set(coordinates)
    data = {name: (dimension, c.values, {"units": c.unit}) for name, c in columns.items()}
    return xarray.Dataset(
        {name: entry for name, entry in data.items() if name not in named},
        {name: entry for name, entry in data.items() if name in named},
        attrs=attributes,
    )


def html(heading: str, columns: Mapping[str, Column], notes: Sequence[str] = ()) -> str:
    """The columns as a table of HTML, cut after MAX_HTML_ROWS rows."""
    rows = list(zip(*(c.texts for c in columns.values()), strict=True))
    left_out = len(rows) - MAX_HTML_ROWS
    more = [f"... and {left_out} more rows"] if left_out > 0 else []
    titles = [titled(name, c.unit) for name, c in columns.items()]
    return html_table(heading, rows[:MAX_HTML_ROWS], titles, [*more, *notes])


def shortened(items: Sequence[str], count: int, noun: str, width: int = 110) -> list[str]:
    """The first `count` texts, none longer than `width`, and how many are left out."""
    kept = [item if len(item) <= width else f"{item[: width - 4]} ..." for item in items[:count]]
    left_out = len(items) - len(kept)
    return [*kept, *([f"... and {left_out} more {noun}"] if left_out > 0 else [])]
