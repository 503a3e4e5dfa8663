"""A figure: its parameters, how its numbers are computed, and the drawing that reads them alone."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.figures.results import Results
from amoeboid.figures.style import COLUMN, DPI, print_style
from amoeboid.figures.tables import FigureData
from amoeboid.model.parameters import Parameters
from amoeboid.output.atomic import write_bytes, write_text
from amoeboid.plotting.figures import new_figure, write_figure
from amoeboid.validation import InvalidInput

FORMATS = ("png", "pdf", "svg")


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure or a table of the paper, or one that it does not have.

    `title` says in one line what it shows, `source` where it stands in the paper. `compute` gives
    its numbers from parameters and `Results`; `draw` draws them on axes: on one, or on a list
    where there are several panels. `varies` names the parameters that the figure sets itself.
    `size`: width and height [inches]; `panels`: rows and columns of axes; `layout`: arguments of
    matplotlib's subplots, such as `width_ratios` in `gridspec_kw`.
    """

    name: str
    title: str
    source: str
    parameters: Parameters
    compute: Callable[[Parameters, Results], FigureData]
    draw: Callable[[FigureData, Any], None]
    size: tuple[float, float] = (COLUMN, 2.5)
    panels: tuple[int, int] = (1, 1)
    layout: dict[str, Any] = field(default_factory=dict)
    varies: frozenset[str] = frozenset()

    def __call__(self, ax: Any = None, parameters: Parameters | None = None) -> Any:
        """Draw the figure on axes, or on a new figure of pyplot; returns the axes.

        A figure of several panels takes and returns as many axes. Raises InvalidInput.
        """
        given = None if ax is None else self._checked(ax)
        data = self.data(parameters)
        with print_style():
            if given is None:
                from matplotlib import pyplot

                given = self._axes(pyplot.figure(figsize=self.size, layout="constrained"))
            self.draw(data, given[0] if len(given) == 1 else given)
        return given[0] if len(given) == 1 else given

    def data(
        self, parameters: Parameters | None = None, results: Results | None = None
    ) -> FigureData:
        """The numbers that the figure shows. Raises InvalidInput."""
        return self.compute(self.with_parameters(parameters), results or Results())

    def with_parameters(self, parameters: Parameters | None) -> Parameters:
        """The parameters to use: those of the paper's figure, where none are given."""
        if parameters is None:
            return self.parameters
        if not isinstance(parameters, Parameters):
            raise InvalidInput(f"parameters must be Parameters, got {parameters!r}")
        return parameters

    def save(
        self,
        folder: str | os.PathLike[str] = "figures",
        formats: Sequence[str] = ("png",),
        parameters: Parameters | None = None,
        results: Results | None = None,
    ) -> list[Path]:
        """Write the tables, then the picture, into a folder; returns the paths of the files.

        Raises InvalidInput for an unknown format, and OSError.
        """
        formats = checked_formats(formats)
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        data = self.data(parameters, results or Results(path))
        return [*self.write_tables(data, path), *self.write_pictures(data, path, formats)]

    def write_tables(self, data: FigureData, folder: Path) -> list[Path]:
        """Write the numbers: a file of CSV for each table, and further files of the figure."""
        written = []
        for key, table in data.tables.items():
            path = folder / f"{self.name}{f'-{key}' if len(data) > 1 else ''}.csv"
            write_text(path, table.csv(self._header(data)))
            written.append(path)
        for ending, content in data.files.items():
            path = folder / f"{self.name}.{ending}"
            write_bytes(path, content if isinstance(content, bytes) else content.encode())
            written.append(path)
        return written

    def write_pictures(
        self, data: FigureData, folder: Path, formats: Sequence[str] = ("png",)
    ) -> list[Path]:
        """Write the picture in each of the formats."""
        written = []
        with print_style():
            drawn = new_figure(*self.size)
            axes = self._axes(drawn)
            self.draw(data, axes[0] if len(axes) == 1 else axes)
            for ending in formats:
                path = folder / f"{self.name}.{ending}"
                write_figure(drawn, path, dpi=DPI)
                written.append(path)
        return written

    def _header(self, data: FigureData) -> list[str]:
        return [
            f"amoeboid {version('amoeboid')}, figure {self.name}: {self.title} ({self.source})",
            f"parameters: {data.parameters.description}",
            *data.notes,
            *(f"missing: {problem}" for problem in data.problems),
        ]

    def _axes(self, drawn: Any) -> list[Any]:
        return list(drawn.subplots(*self.panels, squeeze=False, **self.layout).flat)

    def _checked(self, ax: Any) -> list[Any]:
        count = self.panels[0] * self.panels[1]
        given = list(np.ravel(np.asarray(ax, dtype=object)))  # also a grid of rows and columns
        if len(given) != count or not all(hasattr(one, "plot") for one in given):
            wanted = "axes of matplotlib" if count == 1 else f"{count} axes of matplotlib"
            raise InvalidInput(f"ax must be {wanted} or None, got {ax!r}")
        return given

    def __repr__(self) -> str:
        return f"Figure({self.name}: {self.title}; {self.source})"


def checked_formats(formats: Sequence[str]) -> list[str]:
    """Formats of pictures, small letters or capitals, each once.

    Raises InvalidInput for an unknown one.
    """
    given = [formats] if isinstance(formats, str) else list(formats)
    given = [one.lower() if isinstance(one, str) else one for one in given]
    for one in given:
        if one not in FORMATS:
            raise InvalidInput(f"a format must be one of {', '.join(FORMATS)}, got {one!r}")
    return list(dict.fromkeys(given))
