"""timeseries.csv: the rows of a run, one accepted step each, of the explicit scheme one a frame.

Columns are read by their names. A run that is resumed with another set of observables keeps the
columns it has: those that are new are written from there on, those that are no longer observed end
there, and cells without a number stay empty. NaN is never written. Numbers of a cell with units
are in um, s, 1/um^2 and the like, with the digits that give back every bit (`output.scale`).
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from amoeboid.config import Config
from amoeboid.model.units import Units
from amoeboid.output.atomic import GrowingFile
from amoeboid.output.reading import checked
from amoeboid.output.scale import Scale
from amoeboid.simulation.rows import WHOLE, Row, Rows
from amoeboid.simulation.step import Step
from amoeboid.simulation.timeseries import STEP_UNITS, TimeSeries
from amoeboid.validation import InvalidInput

PLAIN = Scale(None)
MAX_COLUMNS = 1000
MAX_WORDS = 1000  # characters of a message


class TimeSeriesFile(TimeSeries):
    """Keeps the rows of a run and writes them to a file in blocks; `flush` writes what is new.

    `wanted` says whether a step has a row.
    """

    def __init__(
        self,
        path: Path,
        wanted: Callable[[Step], bool],
        observe: Iterable[str] | None = None,
        config: Config | None = None,
    ) -> None:
        super().__init__(observe, config)
        self.path, self._wanted = path, wanted
        self._file, self._written = GrowingFile(path), 0
        self._scale = Scale(None if config is None else config.parameters.units)

    def due(self, step: Step) -> bool:
        """Whether a step has a row."""
        return self._wanted(step)

    def flush(self) -> None:
        """Write the rows that are not yet in the file."""
        new = self.rows[self._written :]
        self._file.extend(
            self._lines(new), lambda: _csv([tuple(self.units)]) + self._lines(self.rows)
        )
        self._written = len(self.rows)

    def _lines(self, rows: Sequence[Row]) -> str:
        units, text = self.units, self._scale.text
        return _csv(
            [[text(row[n], d) if n in row else "" for n, d in units.items()] for row in rows]
        )

    def continued(
        self, last: Step, units: dict[str, str | None], sizes: Units | None = None
    ) -> None:
        """Take up the rows of a stored run up to a step; `units` of its columns as far as known.

        `sizes`: of the units of the cell, where the file is in customary ones. Raises InvalidInput,
        OSError.
        """
        known = units | self.units
        path = checked(self.path.parent, self.path.name)
        columns, rows = read_table(path, last, known, Scale(sizes))
        self.rows = rows
        self.units = {name: known.get(name) for name in (*columns, *self.units)}


def read_table(
    path: Path,
    last: Step | None = None,
    units: Mapping[str, str | None] | None = None,
    scale: Scale = PLAIN,
) -> tuple[list[str], Rows]:
    """Columns and rows of a time series, up to a step if one is given.

    `units`: dimensions of the columns, for a file in the units of `scale`.
    What comes after that step is not read: a run that was killed may have left half a row; without
    a step the last row is left out if it is not whole. Raises InvalidInput unless the rows are
    those of a run, OSError.
    """
    rows, before, dimensions = Rows(), (-math.inf, -math.inf), units or {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            table = csv.reader(file, strict=True)
            columns = next(table, [])
            known = set(STEP_UNITS) <= set(columns) and len(set(columns)) == len(columns)
            if not known or len(columns) > MAX_COLUMNS:
                raise ValueError(f"its columns are not {', '.join(STEP_UNITS)} and observables")
            for line in table:
                if len(line) != len(columns):
                    raise ValueError(f"its columns are not {', '.join(columns)[:MAX_WORDS]}")
                row = _row(columns, line, dimensions, scale)
                place = _place(row)
                if any(a >= b for a, b in zip(before, place, strict=True)):
                    raise InvalidInput("the rows of timeseries.csv must be in order of time")
                rows.append(row)
                before = place
                if last is not None and row["step"] == last.number:
                    break
    except InvalidInput:
        raise
    except (ValueError, OverflowError, csv.Error) as error:
        if last is not None or not rows:
            raise InvalidInput(
                f"timeseries.csv must be a table as a run writes it: {error}"
            ) from None
    if last is not None and (not rows or _place(rows[-1]) != (last.number, last.state.t)):
        raise InvalidInput(f"timeseries.csv lacks step {last.number} of the checkpoint")
    return columns, rows


def _place(row: Row) -> tuple[float, float]:
    return row["step"], row["t"]


def _row(
    columns: Sequence[str], line: Sequence[str], units: Mapping[str, str | None], scale: Scale
) -> Row:
    """The numbers of a line; an empty cell of an observable is none. Raises ValueError."""
    row = {
        name: int(cell) if name in WHOLE else scale.number(cell, units.get(name))
        for name, cell in zip(columns, line, strict=True)
        if cell or name in STEP_UNITS
    }
    if not all(map(math.isfinite, row.values())):
        raise InvalidInput("timeseries.csv must hold finite numbers")
    return row


def _csv(lines: Sequence[Sequence[str | float]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()
