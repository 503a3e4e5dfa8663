"""What runs have in common, whether they were just made or are read from a folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.config import Config
from amoeboid.display import html_picture, html_table, outside, plotted, shown
from amoeboid.model.parameters import Parameters
from amoeboid.observables import observed
from amoeboid.observables import units as units_of
from amoeboid.runs.analysis import Kymograph, Spectrum, kymograph, spectrum
from amoeboid.runs.persistence import Persistence, persistence
from amoeboid.runs.snapshot import SHOWN, Snapshot
from amoeboid.simulation.rows import Row
from amoeboid.simulation.step import Step
from amoeboid.simulation.timeseries import STEP_UNITS, position_columns
from amoeboid.simulation.timeseries import column as column_of
from amoeboid.studies.columns import Column, column, dataset, frame, quantity
from amoeboid.studies.recorded import Recorded, along, optional, single, title
from amoeboid.validation import InvalidInput


class Run:
    """A run of the 3D cell: time series, frames, and the cell at its end.

    `run["max_retrograde_speed"]` is a column of the time series as an array, `run.t` its times;
    with physical parameters they are quantities with units.
    """

    if TYPE_CHECKING:  # fields of one kind of run, properties of the other

        @property
        def config(self) -> Config:
            """The configuration that the run was made with."""

        @property
        def parameters(self) -> Parameters:
            """The parameters of the cell."""

        @property
        def rows(self) -> Sequence[Row]:
            """The rows of the time series in plain numbers."""

        @property
        def units(self) -> Mapping[str, str | None]:
            """The columns of the time series and their dimensions."""

        @property
        def frames(self) -> Sequence[Snapshot]:
            """The cell at the times of output."""

        @property
        def last(self) -> Step:
            """The last step."""

        @property
        def ended(self) -> str:
            """Why the run ended: "steady", "end of time", a condition, or what stopped it."""

        @property
        def status(self) -> str:
            """How the run ended: "finished", "diverged", "interrupted", "failed", or "running"."""

    @property
    def final(self) -> Snapshot:
        """The cell at the end."""
        return Snapshot(self.last.model, self.last.state, self.last.flow)

    @property
    def t(self) -> Any:
        """The times of the time series (T,) [T]."""
        return self["t"]

    def __getitem__(self, name: str) -> Any:
        """A column (T,) of the time series; a vector (T, 3) by the name of its observable.

        Where a column is not known at all times, a masked array.
        """
        values = column_of(self.rows, self.units, name)
        dimension = self.units.get(name, self.units.get(f"{name}_x"))
        return quantity(self.parameters, values, dimension)

    def __iter__(self) -> Iterator[str]:
        """The names of the columns."""
        return iter(self.units)

    def __len__(self) -> int:
        """The number of rows of the time series."""
        return len(self.rows)

    def keys(self) -> list[str]:
        """The names of the columns of the time series."""
        return list(self.units)

    @property
    def trajectory(self) -> Any:
        """Positions (T, 3) [L] at the times `t`, in the environment of the run.

        Without one, those with all drag on the cortex, uniformly.
        """
        return quantity(self.parameters, self._positions, "L")

    @property
    def _positions(self) -> Array:
        names = position_columns(self.units)
        parts = [column_of(self.rows, self.units, name) for name in names]
        return np.stack(parts, axis=1)

    @property
    def steady(self) -> bool:
        """Whether the cell does not change at the end, and no perturbation is known to grow."""
        return self.last.steady

    @property
    def growth_rate(self) -> Any:
        """Growth rate of the fastest perturbation of the cell at the end [1/T].

        None unless it is steady and the rate is known. Negative: it is stable.
        """
        rate = self.last.growth
        return None if rate is None else quantity(self.parameters, rate, "1/T")

    @property
    def growth_rate_error(self) -> Any:
        """Error of `growth_rate` [1/T], without that of the mesh."""
        error = self.last.growth_error
        return None if error is None else quantity(self.parameters, error, "1/T")

    @property
    def stability(self) -> str:
        """ "stable" or "unstable", or "unknown": `stability_problem` says why."""
        return self.last.stability

    @property
    def stability_problem(self) -> str:
        """Why it is not known whether the cell at the end is stable; empty if it is."""
        return self.last.stability_problem

    def kymograph(self, angles: int = 45) -> Kymograph:
        """c along the polarity axis of each frame: over time and `angles` angles from the rear."""
        return kymograph(self._some_frames(), self.final, angles)

    def spectrum(self, field: str = "c", l_max: int | None = None) -> Spectrum:
        """Power by degree of spherical harmonics of a `field`, "c" or "shape", for each frame.

        Degrees are up to l_max, by default 4, or fewer on a mesh of few nodes.
        """
        return spectrum(self._some_frames(), self.parameters, field, l_max)

    def persistence(self, lag: Any = None, after: Any = None) -> Persistence:
        """How long the cell keeps its heading, and how it turns.

        `lag` and `after` [T] are those of `amoeboid.persistence`. Raises InvalidInput.
        """
        return persistence(self, lag, after)

    def _some_frames(self) -> Sequence[Snapshot]:
        if not len(self.frames):
            raise InvalidInput(
                "this needs frames, the run has none; set output.times or output.interval"
            )
        return self.frames

    @property
    def columns(self) -> dict[str, Column]:
        """The time series in the units of the parameters; NaN where a column is not known.

        Raises InvalidInput for a run without one.
        """
        p, found = self.parameters, {}
        if "t" not in self.units:
            raise InvalidInput("this needs a time series, the run has none")
        for name, dimension in self.units.items():
            values = column_of(self.rows, self.units, name)
            known = values.filled(np.nan) if np.ma.isMaskedArray(values) else values
            found[name] = column(p, known, dimension)
        return found

    def to_pandas(self) -> Any:
        """The time series as a pandas.DataFrame over t; its `attrs["units"]` holds the units."""
        table = frame(self.columns)
        units = table.attrs["units"]
        table = table.set_index("t")
        table.attrs["units"] = units
        return table

    def to_xarray(self) -> Any:
        """The time series as an xarray.Dataset over t, each variable with its unit."""
        return dataset(self.columns, "t", ["t"], status=self.status, ended=self.ended)

    @property
    def complete(self) -> bool:
        """Whether the run came to an end of its own."""
        return self.status == "finished"

    @property
    def problems(self) -> tuple[str, ...]:
        """What stopped a run that did not come to an end."""
        return () if self.complete else (f"{self.status}: {self.ended}",)

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: the cell at the end; if asked for, the time series (`series_t`)."""
        dimensions = units_of()
        cell = {name: (v, dimensions[name]) for name, v in observed(self.final.cell).items()}
        row = self.rows[-1] if self.rows else {"t": None, "step": None}
        numbers = cell | {
            "t": (row["t"], "T"),
            "steps": (row["step"], None),
            "steady": (self.steady, None),
            "growth_rate": (self.last.growth, "1/T"),
            "growth_rate_error": (self.last.growth_error, "1/T"),
        }
        words = {"stability": self.stability, "ended": self.ended}
        found = single(self.parameters, numbers)
        found |= {name: Recorded(word, title=title(name)) for name, word in words.items()}
        series = self.columns if "t" in self.units else {}
        return found | optional(along("step", series, "series_"))

    def plot(self, ax: Any = None, observable: str | None = None) -> Any:
        """Draw a column of the time series over time. Takes and returns axes.

        None: max_retrograde_speed, or the first observable of a run that was told to leave it out.
        """
        return plotted(self, "runs.draw", ax, observable=observable or self._telling_column)

    @property
    def _telling_column(self) -> str:
        """The column that is drawn unless another is asked for."""
        known = [name for name in self.units if name not in STEP_UNITS]
        return SHOWN[0] if SHOWN[0] in known or not known else known[0]

    def plot_trajectory(self, ax: Any = None) -> Any:
        """Draw the trajectory in its main plane, colored by time. Takes and returns axes."""
        return plotted(self, "runs.draw_trajectory", ax)

    def export(
        self,
        path: Any = None,
        to: str | None = None,
        *,
        frames: Any = None,
        force: bool = False,
        follow: bool = False,
        fps: float | None = None,
    ) -> list[Path]:
        """Write the run for other programs, or as a movie; gives the paths of the files.

        `path`: a file or a folder; `to`: the format. `export("movie.mp4")`: the ending names the
        format; `export("out", "vtp")` fills a folder. Formats: csv, gif, html, mp4, napari, netcdf,
        ply, stl, trackmate, vtp. `frames`: a slice, a number, or a text such as "0:100:10";
        `follow` keeps the cell in the middle; `fps`: of a movie. What is there is not replaced
        without `force`. Raises InvalidInput, also where a package is missing, and OSError.
        """
        return outside(
            "exports.export.export", self, path, to,
            frames=frames, force=force, follow=follow, fps=fps,
        )  # fmt: skip

    def show(self, picture: Any = None) -> Any:
        """What the run is and how it ended, as `amoeboid show` prints it, with its picture.

        `picture`: its file (.png); by default cell.png in the folder of a stored run.
        """
        return outside("exports.summary.summary", self, picture)

    @property
    def _end(self) -> str:
        """How and when the run ended, in a few words."""
        if not self.rows:
            return f"{self.status}, no step yet"
        row = self.rows[-1]
        t, n_nodes = row["t"], len(self.last.state.r)
        how = self.ended if self.status == "finished" else self.status
        how = how if len(how) <= 60 else f"{how[:56]} ..."
        return (
            f"{how} at t = {shown_time(self.parameters, t)}, {row['step']} steps, {n_nodes} nodes"
        )

    def _repr_html_(self) -> str:
        rows = [(name, getattr(self.final, name)) for name in SHOWN]
        rows += [("growth_rate", self.growth_rate), ("stability", self.stability)]
        notes = [self.ended] if self.status != "finished" else []
        notes += [self.stability_problem] if self.steady and self.stability_problem else []
        heading = f"{type(self).__name__}: {self._end}"
        table = html_table(heading, rows, notes=notes)
        column = self._telling_column
        drawable = column in self.units
        return table + (html_picture(self, "runs.draw", observable=column) if drawable else "")


def shown_time(p: Parameters, t: float) -> str:
    """A time with four digits, and its unit if the cell has physical ones."""
    value = quantity(p, t, "T")
    return f"{t:.4g}" if p.units is None else shown(value)
