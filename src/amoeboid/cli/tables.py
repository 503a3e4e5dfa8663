"""Numbers and tables as the commands print them: significant digits, and never a part of a cell."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence

from amoeboid.display import GAP, text_table

DIGITS = 6  # significant digits of a number


def text(value: object, digits: int = DIGITS) -> str:
    """A value as it is printed: numbers with significant digits, also in lists; none, yes, no."""
    if value is None or value == []:
        return "none"
    if isinstance(value, list | tuple):
        return ", ".join(text(v, digits) for v in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value, digits) if isinstance(value, float) else str(value)


def number(value: float, digits: int = DIGITS) -> str:
    """A number with `digits` significant digits, whatever its size; zero without a sign."""
    return f"{value + 0.0:.{digits}g}"


def width() -> int | None:
    """Columns that a line may take; None, no limit, where no terminal shows it.

    COLUMNS in the environment is a limit everywhere.
    """
    given = os.environ.get("COLUMNS", "")
    if sys.stdout is None or not (sys.stdout.isatty() or (given.isdecimal() and int(given) > 0)):
        return None
    return shutil.get_terminal_size().columns


def table(
    titles: Sequence[str],
    rows: Sequence[Sequence[str]],
    align: str = "",
    limit: int | None = None,
) -> list[str]:
    """The lines of a table; where it is wider than `limit`, each row as a block of its cells.

    `align` has a `<` for each column that is set to the left; further ones are set to the right.
    Where the first title is empty, the first cell is the heading of its row.
    """
    lines = text_table(titles, rows, align)
    if limit is None or max(map(len, lines)) <= limit:
        return lines
    return _below(titles, rows, limit)


def _below(titles: Sequence[str], rows: Sequence[Sequence[str]], limit: int) -> list[str]:
    headed, untitled = not titles[0], not any(titles)
    longest = max(map(len, titles))
    lines: list[str] = []
    for row in rows:
        if lines and not headed:
            lines.append("")
        rest = GAP.join(cell for cell in row[1:] if cell.strip())
        if untitled and len(GAP + rest) <= limit:
            lines += [row[0], f"{GAP}{rest}"]
            continue
        for k, (title, cell) in enumerate(zip(titles, row, strict=True)):
            if headed and k == 0:
                lines.append(cell)
            elif cell.strip():
                name = f"{title:{longest}}{GAP}" if title else ""
                lines.append(f"{GAP if headed else ''}{name}{cell}")
    return lines
