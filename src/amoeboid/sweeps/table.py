"""The table of a sweep: an xarray.Dataset with units, made of the lines of its points."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.extras import check, needed
from amoeboid.model.parameters import Parameters
from amoeboid.output.atomic import write_atomically
from amoeboid.studies.columns import TABLE, magnitude, unit
from amoeboid.studies.recorded import title
from amoeboid.sweeps.evaluation import MISSING, OWN_NAMES
from amoeboid.sweeps.meanings import NUMBER, TEXT, Meaning, Meanings
from amoeboid.sweeps.points import Points, labels
from amoeboid.validation import InvalidInput

DIGITS = 14
"""Significant ones that coordinates keep."""

TITLES = {
    "status": "ok, incomplete, failed, or missing where nothing was computed yet",
    "why": "why a point failed, or what may be missing in its answer",
    "warnings": "warnings of the solver",
}


@dataclass(frozen=True)
class Coordinate:
    """The values of what varies, along a dimension of its own or along the points."""

    dims: tuple[str, ...]
    values: tuple[Any, ...]
    unit: str
    title: str


@dataclass(frozen=True)
class Layout:
    """The dimensions of a table, its coordinates, and what is told about the whole of it."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    coordinates: Mapping[str, Coordinate]
    attributes: Mapping[str, Any]

    def values(self, k: int) -> dict[str, Any]:
        """The values of what varies at a point, by name, in the units of the table."""
        place = dict(zip(self.dims, np.unravel_index(k, self.shape), strict=True))
        return {n: c.values[int(place[c.dims[0]])] for n, c in self.coordinates.items()}

    def written(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)


def layout_from(found: Any) -> Layout:
    """The layout that a manifest holds. Raises InvalidInput."""
    try:
        coordinates = {
            str(n): Coordinate(
                tuple(map(str, c["dims"])), tuple(c["values"]), str(c["unit"]), str(c["title"])
            )
            for n, c in found["coordinates"].items()
        }
        shape = tuple(int(n) for n in found["shape"])
        dims = tuple(map(str, found["dims"]))
        attributes = dict(found["attributes"])
    except (TypeError, ValueError, KeyError, AttributeError, OverflowError) as error:
        raise InvalidInput(f"the points of a stored sweep must be readable: {error!r}") from None
    sizes = dict(zip(dims, shape, strict=False))
    whole = len(dims) == len(shape) == len(sizes) and min(shape, default=0) > 0
    if not whole or not all(_has_its_values(c, sizes) for c in coordinates.values()):
        raise InvalidInput("the points of a stored sweep must have a value for each name")
    return Layout(dims, shape, coordinates, attributes)


def _has_its_values(coordinate: Coordinate, sizes: Mapping[str, int]) -> bool:
    """Whether there is a number or a text for each point along its dimension."""
    plain = all(isinstance(value, str | int | float) for value in coordinate.values)
    return plain and [sizes.get(dim) for dim in coordinate.dims] == [len(coordinate.values)]


def layout(points: Points, attributes: Mapping[str, Any]) -> Layout:
    """The layout of the table of points."""
    p = points.parameters
    coordinates = {}
    for name in points.names:
        values = points.axes.get(name, points.columns[name])
        numeric = all(isinstance(value, float) for value in values)
        dimension = points.dimension(name) if numeric else None
        shown = tuple(
            _as_given(p, values, dimension) if numeric else labels(points.base, name, values)
        )
        own = (name,) if name in points.dims else points.dims
        coordinates[name] = Coordinate(own, shown, unit(p, dimension), title(name))
    return Layout(points.dims, points.shape, coordinates, attributes)


def _as_given(p: Parameters, values: Sequence[float], dimension: str | None) -> list[float]:
    """Coordinates as they were given: units that are taken off and put on leave rounding."""
    shown = np.asarray(magnitude(p, np.array(values), dimension)).tolist()
    return shown if p.units is None else [float(f"{value:.{DIGITS}g}") for value in shown]


@dataclass(frozen=True)
class Column:
    """What is recorded under one name: the values of all points, padded."""

    dims: tuple[str, ...]
    values: Array
    meaning: Meaning


def columns(layout: Layout, rows: Sequence[str | None], meanings: Meanings) -> dict[str, Column]:
    """All that is recorded, by name: `status`, `why` and `warnings` first.

    Numbers are NaN, and texts empty, where a point has none. Names are in the order of the points
    that have them, whatever order these were computed in.
    """
    read: list[dict[str, Any]] = [
        {"status": MISSING} if row is None else json.loads(row) for row in rows
    ]
    found = {name: _own(layout, name, read) for name in OWN_NAMES}
    names = dict.fromkeys(name for row in read for name in row.get("values", ()))
    sizes: dict[str, int] = {}
    for name in names:
        sizes |= {dim: len(given) for dim, given in meanings[name].labels}
        for row in read:
            value = row.get("values", {}).get(name)
            for dim, size in zip(meanings[name].dims, _sizes(value), strict=False):
                sizes[dim] = max(size, sizes.get(dim, 0))
    for name in names:
        values = [row.get("values", {}).get(name) for row in read]
        found[name] = _padded(layout, meanings[name], values, sizes)
    return found


def _own(layout: Layout, name: str, read: Sequence[Mapping[str, Any]]) -> Column:
    values = np.array([str(row.get(name, "")) for row in read], dtype=object)
    return Column(layout.dims, values.reshape(layout.shape), Meaning(TEXT, "", TITLES[name], ()))


def _padded(
    layout: Layout, meaning: Meaning, values: Sequence[Any], sizes: Mapping[str, int]
) -> Column:
    shape = tuple(sizes.get(dim, 0) for dim in meaning.dims)
    text = meaning.kind == TEXT
    table = np.full((len(values), *shape), "" if text else np.nan, dtype=object if text else float)
    for k, value in enumerate(values):
        if value is None:
            continue
        if not shape:
            table[k] = value if text else float(value)
        else:
            for place, entry in _entries(value, len(shape)):
                if entry is not None:
                    table[(k, *place)] = entry if text else float(entry)
    dims = (*layout.dims, *meaning.dims)
    return Column(dims, table.reshape(*layout.shape, *shape), meaning)


def _entries(value: Any, depth: int) -> Iterator[tuple[tuple[int, ...], Any]]:
    """The entries of nested lists, with their places."""
    for k, entry in enumerate(value):
        if depth == 1:
            yield (k,), entry
        else:
            yield from (((k, *place), inner) for place, inner in _entries(entry, depth - 1))


def _sizes(value: Any) -> Iterator[int]:
    """The lengths of nested lists."""
    while isinstance(value, list):
        yield len(value)
        value = max(value, key=lambda v: len(v) if isinstance(v, list) else 0, default=None)


def dataset(layout: Layout, found: Mapping[str, Column]) -> Any:
    """The xarray.Dataset of a sweep. Raises InvalidInput where xarray is missing."""
    xarray = needed("xarray", TABLE)
    data = {name: (c.dims, c.values, _attributes(c.meaning)) for name, c in found.items()}
    coordinates: dict[str, Any] = {
        name: (c.dims, np.array(c.values), {"units": c.unit, "long_name": c.title})
        for name, c in layout.coordinates.items()
    }
    for column in found.values():
        coordinates |= {dim: (dim, list(labels)) for dim, labels in column.meaning.labels}
    return xarray.Dataset(data, coordinates, attrs=dict(layout.attributes))


def _attributes(meaning: Meaning) -> dict[str, str]:
    units = {"units": meaning.unit} if meaning.kind == NUMBER else {}
    return {**units, "long_name": meaning.title}


def write_netcdf(table: Any, path: Path) -> None:
    """Write a Dataset as NetCDF, atomically. Raises InvalidInput where h5netcdf is missing."""
    check_netcdf()
    write_atomically(path, lambda p: table.to_netcdf(p, engine="h5netcdf"))


def check_netcdf() -> None:
    """Raise InvalidInput where a package that NetCDF needs is missing."""
    check("a table in NetCDF needs", "xarray", "h5netcdf", "h5py")
