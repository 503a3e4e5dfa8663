"""What an export is made from, and what a format is: names of files, and what writes each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.extras import check
from amoeboid.output.frames import frame_arrays
from amoeboid.runs.run import Run
from amoeboid.runs.stored import StoredFrames
from amoeboid.runs.words import ASSUMED, environment
from amoeboid.simulation.path import MIGRATION, RecordedPath
from amoeboid.studies.columns import magnitude, unit
from amoeboid.surface.cell import SurfaceCell
from amoeboid.validation import InvalidInput

Write = Callable[[Path], None]
Tell = Callable[[Sequence[str]], None]


def untold(_: Sequence[str]) -> None:
    """No-op callback."""


FPS, MAX_FPS = 25.0, 240.0
"""Frames of a movie in a second unless another number is given, and at most."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where the cell of a frame is: its center (3,) [L]; the axes (3, 3) of the run, in columns.

    Axes of None are those of the run themselves: nothing is rotated.
    """

    center: Array
    axes: Array | None = None

    def turned(self, vectors: Array) -> Array:
        """Vectors (..., 3) of a frame in the axes of the export."""
        return vectors if self.axes is None else vectors @ self.axes.T


@dataclass(frozen=True, eq=False, repr=False)
class Job:
    """A run, the numbers of its frames that are exported, and the options of the export.

    `follow`: positions are about the center of the cell, in the axes of the run; otherwise they are
    those in the environment of the run, in the laboratory. `tell` takes the parts of a line of
    progress. Numbers are given in the units of the run: micrometres, seconds and the like where it
    has physical ones.
    """

    run: Run
    name: str
    numbers: range
    follow: bool = False
    fps: float = FPS
    tell: Tell = untold

    def cells(self, doing: str) -> Iterator[tuple[int, SurfaceCell]]:
        """Numbers and cells of the frames, each read when it is asked for, and then forgotten."""
        for count, number in enumerate(self.numbers, 1):
            self.tell((f"{doing}: frame {count} of {len(self.numbers)}",))
            yield number, self.run.frames[number].cell

    @property
    def times(self) -> list[float]:
        """Times of the frames [T]; those of a stored run are known without them."""
        frames = self.run.frames
        known = frames.times if isinstance(frames, StoredFrames) else [f.state.t for f in frames]
        return [known[number] for number in self.numbers]

    def cell(self, number: int) -> SurfaceCell:
        """The cell of a frame."""
        return self.run.frames[number].cell

    @property
    def has_series(self) -> bool:
        """Whether the run has a time series; of some folders only frames remain."""
        return "t" in self.run.units

    def shown(self, value: Any, dimension: str | None) -> Any:
        """A number or an array of the solver in the units of the export."""
        return magnitude(self.run.parameters, value, dimension)

    def unit(self, dimension: str | None) -> str:
        """The unit of a dimension."""
        return unit(self.run.parameters, dimension)

    @cached_property
    def environment(self) -> str:
        """The environment whose path positions are on, in words; empty for drag on the cortex."""
        known = set(MIGRATION) <= self.run.units.keys()
        return environment(self.run.config) if known else ""

    @property
    def path_words(self) -> str:
        """What resists the cell on the path that positions are on."""
        return self.environment or ASSUMED

    @cached_property
    def _path(self) -> RecordedPath:
        return RecordedPath(self.run.rows)

    def place(self, cell: SurfaceCell) -> Place:
        """Where a cell is in the environment of the run, or at the origin if it is followed.

        Raises InvalidInput where the run does not say.
        """
        if self.follow:
            return Place(np.zeros(3))
        if self.environment:
            return Place(*self._path.at(cell.t))
        return Place(cell.state.position)

    def center(self, cell: SurfaceCell) -> Array:
        """The center of volume (3,) of a cell, see `place`."""
        return np.asarray(self.shown(self.place(cell).center, "L"))

    def nodes(self, cell: SurfaceCell) -> Array:
        """Nodes (V, 3) of a cell, where it is, or about its center if that is followed."""
        place = self.place(cell)
        return np.ascontiguousarray(self.shown(place.turned(cell.x) + place.center, "L"))

    def fields(self, cell: SurfaceCell, names: Mapping[str, str]) -> dict[str, Array]:
        """Fields of a cell at its nodes by name, vectors in the axes of `nodes`.

        `names` has their dimensions.
        """
        found, _ = frame_arrays(cell)
        place = self.place(cell)
        turned = {n: place.turned(found[n]) if found[n].ndim == 2 else found[n] for n in names}
        return {n: np.ascontiguousarray(self.shown(turned[n], d)) for n, d in names.items()}


@dataclass(frozen=True, eq=False)
class Format:
    """A format of exports: what it is, the ending of its files, and how they are written.

    `files` gives the names of the files of a job, each with the function that writes it under a
    name that it is given. `options` are those of `Job` that it heeds, `packages` the optional
    modules that it needs, see `amoeboid.extras`; `frames`: whether it needs frames;
    `one_per_frame`: whether its files are those of single frames; `series`: whether they hold the
    time series, if there is one; `max_fps`: frames a second that
    it can show.
    """

    about: str
    suffix: str
    files: Callable[[Job], Mapping[str, Write]]
    options: frozenset[str] = frozenset()
    packages: tuple[str, ...] = ()
    frames: bool = True
    one_per_frame: bool = False
    series: bool = False
    max_fps: float = MAX_FPS

    def check(self, name: str, options: Iterable[str]) -> None:
        """Raise InvalidInput for options that it does not heed, and for missing packages."""
        for option in options:
            if option not in self.options:
                raise InvalidInput(f"{option} has no effect on {name}; leave it out")
        check(f"an export to {name} needs", *self.packages)
