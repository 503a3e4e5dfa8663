"""The numbers of a figure: tables of columns with units, written as CSV beside the picture."""

from __future__ import annotations

import csv
import io
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.parameters import Parameters
from amoeboid.model.units import NO_DIMENSION, exponents
from amoeboid.studies.columns import Column, dataset, frame, magnitude, titled, unit

SCALES = {"L": "R0", "T": "1/beta", "M": "eta_s/beta", "N": "R0^2 c_r"}
NATURAL = {
    "L": "R0",
    "T": "1/beta",
    "L/T": "R0 beta",
    "1/T": "beta",
    "L^2/T": "R0^2 beta",
    "N": "R0^2 c_r",
    "N/L^2": "c_r",
    "M/T": "eta_s",
    "M/T^2": "eta_s beta",
    "M/(L T^2)": "eta_s beta/R0",
    "M L^2/(T^2 N)": "eta_s beta/c_r",
    "L^2": "R0^2",
    "L^3": "R0^3",
    "M L^2/T^3": "eta_s R0^2 beta^2",
}
"""Units made of the paper's simulation units, in which R0 = beta = eta_s = c_r = 1."""


def unit_of(p: Parameters, dimension: str | None) -> str:
    """The unit of a dimension: physical, the paper's where those are the units, else the dimension.

    >>> unit_of(Parameters(), "L/T"), unit_of(Parameters(R0=2.0), "L/T")
    ('R0 beta', 'L/T')
    """
    natural = p.R0 == p.eta_s == p.c_r == p.beta == 1.0
    if p.units is None and natural and dimension not in NO_DIMENSION:
        if str(dimension) in NATURAL:
            return NATURAL[str(dimension)]
        parts = [f"({SCALES[s]})^{k}" for s, k in exponents(str(dimension))]
        return " ".join(parts)
    return unit(p, dimension)


def column_of(p: Parameters, values: ArrayLike, dimension: str | None = None) -> Column:
    """A column of values in the units of the solver [dimension], as figures show it."""
    return Column(np.asarray(magnitude(p, np.asarray(values), dimension)), unit_of(p, dimension))


MAX_REPR = 900


@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """Columns of equal length, and what they are in a sentence."""

    about: str
    columns: Mapping[str, Column]

    def __getitem__(self, name: str) -> Array:
        """The values of a column."""
        return self.columns[name].values

    def __len__(self) -> int:
        return max((len(c.values) for c in self.columns.values()), default=0)

    def unit(self, name: str) -> str:
        """The unit of a column."""
        return self.columns[name].unit

    def to_pandas(self) -> Any:
        """A pandas.DataFrame; its `attrs["units"]` holds the units."""
        return frame(self.columns)

    def to_xarray(self) -> Any:
        """An xarray.Dataset along the dimension `row`."""
        return dataset(self.columns, "row")

    def csv(self, header: Sequence[str]) -> str:
        """The table as text: lines of `header` behind #, names with units, one row a line."""
        text = io.StringIO()
        for line in (*header, self.about):
            text.write(f"# {' '.join(line.split())}\n")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([titled(name, c.unit) for name, c in self.columns.items()])
        rows = zip(*(c.values.tolist() for c in self.columns.values()), strict=True)
        writer.writerows([[_written(value) for value in row] for row in rows])
        return text.getvalue()

    def __repr__(self) -> str:
        names = ", ".join(titled(name, c.unit) for name, c in self.columns.items())
        return f"Table: {self.about} ({len(self)} rows)\n{names}"[:MAX_REPR]


def _written(value: Any) -> str:
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return repr(value) if isinstance(value, float) else str(value)


@dataclass(frozen=True, eq=False)
class FigureData(Mapping[str, Table]):
    """All that a figure shows: tables by name, and what they say, a sentence each.

    `notes` are the numbers that a reader looks for (a threshold, a fold) and what may be missing;
    `problems` what could not be computed. `files` are further files of the figure, by ending.
    """

    parameters: Parameters
    tables: Mapping[str, Table]
    notes: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    files: Mapping[str, str | bytes] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Table:
        return self.tables[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.tables)

    def __len__(self) -> int:
        return len(self.tables)

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} ({len(table)} rows)" for name, table in self.tables.items())
        notes = [textwrap.shorten(n, 130, placeholder=" …") for n in self.notes[:5]]
        return "\n".join([f"FigureData: {sizes}"[:300], *notes])


SYMBOLS = {
    "R0": "$R_0$",
    "beta": "β",
    "eta_s": "$η_s$",
    "c_r": "$c_r$",
    "um": "\N{MICRO SIGN}m",
    "umol": "\N{MICRO SIGN}mol",
}


def label(words: str, unit: str) -> str:
    """The label of an axis: what it shows, with its unit as pictures show it.

    >>> label("speed", "R0 beta"), label("speed", "um/s"), label("polarity", "")
    ('speed [$R_0$ β]', 'speed [µm/s]', 'polarity')
    """
    return f"{words} [{drawn_unit(unit)}]" if unit else words


def drawn_unit(unit: str) -> str:
    """A unit as pictures show it: symbols of the paper, raised powers.

    >>> drawn_unit("eta_s beta/R0"), drawn_unit("um^2/s")
    ('$η_s$ β/$R_0$', 'µm$^{2}$/s')
    """
    names = "|".join(map(re.escape, SYMBOLS))
    drawn = re.sub(rf"\b({names})\b", lambda found: SYMBOLS[found.group()], unit)
    return re.sub(r"\^(-?[0-9]+)", r"$^{\1}$", drawn)
