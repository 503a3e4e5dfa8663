"""Rows of CSV files, written one by one."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any


def write_rows(path: Path, head: Sequence[Sequence[str]], rows: Iterable[Sequence[Any]]) -> None:
    """Write lines of titles and rows; a number that is not known is an empty cell."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerows(head)
        table.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: Any) -> str:
    """A number with all its digits."""
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return str(value)
