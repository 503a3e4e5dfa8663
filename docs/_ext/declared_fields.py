"""Fields that are declared with a rule and a meaning, as a table below the docstring of a class.

Parameters and the sections of a configuration declare them once (`amoeboid.validation`); help
texts, messages and this table say the same.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from sphinx.application import Sphinx

from amoeboid.validation import rule

COLUMNS = ("name", "dimension", "default", "range", "meaning")


def rows(cls: type) -> list[tuple[str, ...]]:
    """A row for each declared field."""
    return [
        (f"``{f.name}``", f.metadata.get("unit", ""), default(f), rule(f), f.metadata["doc"])
        for f in fields(cls)
        if "doc" in f.metadata
    ]


def default(f: Field[Any]) -> str:
    """The default of a field as code."""
    return "" if f.default is MISSING or f.default is None else f"``{f.default!r}``"


def table(cls: type) -> list[str]:
    """The lines of the table; none for a class without such fields."""
    found = rows(cls)
    if not found:
        return []
    lines = ["", ".. list-table::", "   :header-rows: 1", "   :class: fields", ""]
    for row in (COLUMNS, *found):
        for k, cell in enumerate(row):
            lines.append(f"   {'* -' if k == 0 else '  -'} {escaped(cell)}".rstrip())
    return [*lines, ""]


def escaped(cell: str) -> str:
    """Text of a cell that reST takes as it stands."""
    return cell if cell.startswith("``") else cell.replace("*", r"\*").replace("|", r"\|")


def append(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:  # the arguments of the event
    """Append the table to the docstring of a class."""
    if what == "class" and is_dataclass(obj):
        lines.extend(table(obj))


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect with autodoc."""
    app.connect("autodoc-process-docstring", append)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
