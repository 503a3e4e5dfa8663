"""Tables of measurements: files of comma-separated values, dictionaries, pandas tables.

A column is headed by a name and, in square brackets, a unit: `u [um/s]`. Whatever is wrong with an
entry is refused with its line and its column.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.validation import DECIMAL_COMMA, InvalidInput

HEADING = re.compile(r"\s*([A-Za-z_]\w*)\s*(?:\[([^\[\]]*)\]\s*)?", re.ASCII)
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
MAX_BYTES, MAX_ROWS = 5_000_000, 20_000


@dataclass(frozen=True)
class Column:
    """One column: name and unit of its heading, entries as texts or numbers, "" where empty."""

    heading: str
    name: str
    unit: str | None
    entries: tuple[Any, ...]


@dataclass(frozen=True)
class Table:
    """Columns of equal length; `rows` says where each row stands: "line 7"."""

    source: str
    columns: tuple[Column, ...]
    rows: tuple[str, ...]
    top: str

    def problem(self, row: int | None, column: str, message: str) -> InvalidInput:
        """What is wrong with an entry, or for None with a heading."""
        where = self.top if row is None else self.rows[row]
        return InvalidInput(f"{self.source}, {where}, column {column!r}: {message}")

    def number(self, column: Column, row: int) -> float | None:
        """An entry as a finite number; None where it is empty. Raises InvalidInput."""
        entry = column.entries[row]
        value: float | None = None
        if isinstance(entry, str):
            text = entry.strip()
            if not text:
                return None
            value = float(text) if NUMBER.fullmatch(text) else None
        else:
            try:
                value = float(entry)
            except (TypeError, ValueError):
                value = None
            if value is not None and math.isnan(value):
                return None  # what tables of pandas hold where nothing was measured
        if value is None or not math.isfinite(value):
            remedy = "; leave it empty where nothing was measured"
            if isinstance(entry, str) and DECIMAL_COMMA.fullmatch(entry.strip()):
                remedy = f"; write {entry.strip().replace(',', '.')}"
            raise self.problem(row, column.heading, f"must be a number, got {entry!r}{remedy}")
        return value


def table(data: Any) -> Table:
    """The table of a file, a dictionary of columns, or a pandas.DataFrame. Raises InvalidInput."""
    if isinstance(data, str | Path):
        return _of_file(Path(data))
    if hasattr(data, "to_dict") and hasattr(data, "columns"):
        units = getattr(data, "attrs", {}).get("units", {})
        return _of_mapping({str(k): data[k].tolist() for k in data.columns}, units)
    if isinstance(data, Mapping):
        return _of_mapping(data, {})
    raise InvalidInput(
        f"data must be the path of a CSV file, a dictionary of columns or a pandas.DataFrame, got "
        f"{data!r:.200}"
    )


def _of_file(path: Path) -> Table:
    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise InvalidInput(
            f"{path} must be at most {MAX_BYTES // 10**6} MB; average neighboring points"
        )
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InvalidInput(
            f"{path}, line {line}: must be text in UTF-8, got the byte {content[error.start]:#x}; "
            "save it as 'CSV UTF-8'"
        ) from None
    reader = csv.reader(StringIO(text, newline=""), strict=True)
    lines: list[tuple[int, list[str]]] = []
    try:
        read = ((reader.line_num, cells) for cells in reader)
        lines.extend(line for line in read if not _is_remark(line[1]))
    except csv.Error as error:
        raise InvalidInput(
            f"{path}, line {reader.line_num}: must be comma-separated values: {error}"
        ) from None
    if len(lines) > MAX_ROWS:
        raise InvalidInput(
            f"{path} must have at most {MAX_ROWS} lines, got {len(lines)}; average neighboring "
            "points"
        )
    if len(lines) < 2:
        raise InvalidInput(
            f"{path} must have a line of headings, such as theta [deg],u [um/s],u_error [um/s], "
            f"and lines of numbers below it, got {len(lines)} lines"
        )
    (top, headings), *rows = lines
    for number, cells in lines:
        _check_width(path, number, cells, headings)
    columns = tuple(
        _column(heading, f"{path}, line {top}", [cells[k] for _, cells in rows])
        for k, heading in enumerate(headings)
    )
    return Table(str(path), columns, tuple(f"line {n}" for n, _ in rows), f"line {top}")


def _is_remark(cells: Sequence[str]) -> bool:
    return not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#")


def _check_width(path: Path, line: int, cells: Sequence[str], headings: Sequence[str]) -> None:
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(cells) == 1 and mark in cells[0]:
            raise InvalidInput(
                f"{path}, line {line}: entries must be separated by commas, got {name}; save it "
                "with commas, and with decimal points"
            )
    if len(cells) != len(headings):
        raise InvalidInput(
            f"{path}, line {line}: must have {len(headings)} entries, as many as there are "
            f"headings, got {len(cells)}; leave entries without a measurement empty, and write "
            "decimal points"
        )


def _of_mapping(data: Mapping[Any, Any], units: Mapping[str, Any]) -> Table:
    found = []
    for heading, values in data.items():
        unit = getattr(values, "units", None) or units.get(heading)
        plain = getattr(values, "magnitude", values)
        entries = [plain] if isinstance(plain, str) or np.ndim(plain) == 0 else list(plain)
        title = f"{heading} [{unit}]" if unit and "[" not in str(heading) else str(heading)
        found.append((title, entries))
    length = max((len(entries) for _, entries in found), default=0)
    if length > MAX_ROWS:
        raise InvalidInput(
            f"data must have at most {MAX_ROWS} rows, got {length}; average neighboring points"
        )
    if length == 0:
        raise InvalidInput(f"data must have at least one column with a value, got {data!r:.200}")
    columns = tuple(
        _column(title, "data", [*entries, *[""] * (length - len(entries))])
        for title, entries in found
    )
    return Table("data", columns, tuple(f"row {k}" for k in range(length)), "headings")


def _column(heading: str, where: str, entries: Sequence[Any]) -> Column:
    match = HEADING.fullmatch(heading)
    if match is None:
        raise InvalidInput(
            f"{where}: a heading must be a name and a unit in square brackets, such as u [um/s], "
            f"got {heading!r}"
        )
    name, unit = match.groups()
    return Column(heading.strip(), name, None if unit is None else unit.strip(), tuple(entries))
