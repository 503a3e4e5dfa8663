"""What a sweep gives: its table, what failed and why, pictures."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from amoeboid.display import html_picture, html_table, plotted, shown
from amoeboid.studies.columns import shortened, titled
from amoeboid.sweeps.evaluation import FAILED, MISSING, OWN_NAMES
from amoeboid.sweeps.folder import SweepFolder, read_manifest
from amoeboid.sweeps.meanings import NUMBER, Meanings
from amoeboid.sweeps.table import (
    Column,
    Layout,
    columns,
    dataset,
    layout_from,
    write_netcdf,
)
from amoeboid.validation import InvalidInput, path_of, refuse_unknown

MAX_SHOWN = 3
USUAL = "max_retrograde_speed"


@dataclass(frozen=True)
class Failure:
    """A point that failed: what it is, and why."""

    values: Mapping[str, Any]
    why: str

    def __repr__(self) -> str:
        at = ", ".join(f"{name} = {shown(value)}" for name, value in self.values.items())
        return f"{at[:200]}: {self.why if len(self.why) <= 200 else f'{self.why[:196]} ...'}"


@dataclass(frozen=True, eq=False, repr=False)
class Sweep:
    """The answers at all points of a sweep.

    `dataset` has them in one xarray.Dataset over what varied: numbers with their units, NaN where
    an answer has none (yes and no are 1 and 0), texts, and `status`, `why` and `warnings` of every
    point. `sweep["max_retrograde_speed"]` is a variable of it. `failed` lists the points that
    failed. `rows` are the lines of the points, None where nothing was computed yet. `folder`: where
    they are kept, None if nowhere. `outdated`: lines in the folder that another version of
    amoeboid or of the solver has computed, which are not in the table.
    """

    layout: Layout
    rows: tuple[str | None, ...]
    meanings: Meanings
    folder: Path | None = None
    outdated: int = 0

    @cached_property
    def columns(self) -> dict[str, Column]:
        """All that is recorded, as arrays, by name."""
        return columns(self.layout, self.rows, self.meanings)

    @cached_property
    def dataset(self) -> Any:
        """The xarray.Dataset of all points."""
        return dataset(self.layout, self.columns)

    def to_xarray(self) -> Any:
        """The same as `dataset`."""
        return self.dataset

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row a point, or a state of a point."""
        return self.dataset.to_dataframe().reset_index()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the dataset as NetCDF. Raises InvalidInput where h5netcdf is missing, OSError."""
        write_netcdf(self.dataset, path_of(path, "the path of a table"))

    def __getitem__(self, name: str) -> Any:
        """A variable or a coordinate, an xarray.DataArray."""
        refuse_unknown([name], (*self.layout.coordinates, *self.columns), "name", "in this sweep")
        return self.dataset[name]

    def __iter__(self) -> Iterator[str]:
        """The names of what is recorded."""
        return iter(self.columns)

    def __len__(self) -> int:
        """The number of points."""
        return len(self.rows)

    @cached_property
    def counts(self) -> dict[str, int]:
        """The number of points by status."""
        return dict(Counter(self.columns["status"].values.ravel().tolist()))

    @property
    def complete(self) -> bool:
        """Whether nothing is missing: every point was computed, and has a complete answer."""
        return set(self.counts) == {"ok"}

    @property
    def done(self) -> int:
        """The number of points that were computed, those that failed among them."""
        return len(self) - self.counts.get(MISSING, 0)

    @property
    def missing(self) -> str:
        """Why points may be missing; empty if none is."""
        count = self.counts.get(MISSING, 0)
        if not count:
            return ""
        why = "not computed yet"
        if self.outdated:
            why += (
                f", or computed by other code: {self.outdated} results in the folder are those of "
                "another version of amoeboid or of the solver; compute all shards with the same one"
            )
        return f"{count} of {len(self)} points are missing: {why}"

    @cached_property
    def failed(self) -> tuple[Failure, ...]:
        """The points that failed, and why."""
        status = self.columns["status"].values.ravel().tolist()
        why = self.columns["why"].values.ravel().tolist()
        return tuple(
            Failure(self.layout.values(k), why[k])
            for k, found in enumerate(status)
            if found == FAILED
        )

    def plot(self, ax: Any = None, observable: str | None = None) -> Any:
        """Draw a recorded number or text, `observable`, over the one or two parameters that vary.

        Takes and returns axes. Raises InvalidInput for more than two parameters, and an unknown
        name.
        """
        return plotted(self, "sweeps.draw", ax, observable=self.telling(observable))

    def telling(self, observable: str | None = None) -> str:
        """The name that is drawn: `observable`, or the retrograde speed, or the first number.

        Raises InvalidInput where there is none.
        """
        names = [name for name in self.columns if name not in OWN_NAMES]
        if observable is not None:
            refuse_unknown([observable], [*names, "status"], "name", "in this sweep")
            return observable
        numbers = [n for n in names if self.columns[n].meaning.kind == NUMBER]
        return USUAL if USUAL in numbers else next(iter([*numbers, *names]), "status")

    @property
    def _heading(self) -> str:
        size = " x ".join(map(str, self.layout.shape))
        varied = ", ".join(
            f"{titled(name, '')} {_span(c.values)} {c.unit}".rstrip()
            for name, c in list(self.layout.coordinates.items())[:5]
        )
        counted = ", ".join(f"{n} {status}" for status, n in sorted(self.counts.items()))
        called = str(self.layout.attributes.get("solver", "")).partition("(")[0]
        solver = called.rpartition(".")[2][:60]
        size = f" ({size})" if len(self.layout.shape) > 1 else ""
        return f"Sweep of {solver} at {len(self)} points{size} in {varied}: {counted}"

    def __repr__(self) -> str:
        told = shortened([repr(f) for f in self.failed], MAX_SHOWN, "failures", 150)
        notes = [*told, *([self.missing] if self.missing else [])]
        return "\n".join([self._heading[:400], *(f"- {line}" for line in notes)])

    def _repr_html_(self) -> str:
        own = [n for n in self.columns if n not in OWN_NAMES][:30]
        rows = [
            (name, self.columns[name].meaning.unit, self.columns[name].meaning.title)
            for name in own
        ]
        notes = shortened([repr(f) for f in self.failed], 20, "failures", 300)
        notes = [*notes, *([self.missing] if self.missing else [])]
        table = html_table(self._heading, rows, ("recorded", "unit", "meaning"), notes)
        drawable = len(self.layout.coordinates) <= 2 and own
        return table + (
            html_picture(self, "sweeps.draw", observable=self.telling()) if drawable else ""
        )


def _span(values: tuple[Any, ...]) -> str:
    if len(values) == 1:
        return shown(values[0])
    numeric = all(isinstance(v, int | float) for v in values)
    return f"{shown(min(values))} to {shown(max(values))}" if numeric else f"({len(values)} values)"


def load_sweep(folder: str | os.PathLike[str]) -> Sweep:
    """The sweep in a folder, as far as it is done: of a process, or of all shards together.

    Points that no process has computed yet have the status "missing". Raises InvalidInput for a
    folder that holds no sweep.
    """
    path = path_of(folder, "the folder of a sweep")
    manifest = read_manifest(path)
    found = layout_from(manifest.get("layout"))
    keys = manifest.get("keys")
    count = 1
    for size in found.shape:
        count *= size
    if not isinstance(keys, list) or len(keys) != count:
        raise InvalidInput(f"the sweep in {str(path)!r} must list its {count} points, but does not")
    stored = SweepFolder(path)
    stored.read(str(manifest.get("code")))
    rows = tuple(stored.rows.get(str(key)) for key in keys)
    return Sweep(
        found, rows, stored.meanings, path, len(stored.outdated.difference(map(str, keys)))
    )
