"""How results show themselves: short texts, tables for notebooks, and the way to their pictures.

A result knows the name of the function of `plotting` that draws it, and nothing of drawing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from html import escape
from importlib import import_module
from typing import Any

DIGITS = 6
"""Significant digits of a number."""

MAX_REPR = 900
"""Characters of the text of a dataclass."""

PLAIN_UNITS = str.maketrans(
    {
        "\u00b5": "u",  # the micro sign, and the Greek letter
        "\u03bc": "u",
        "·": " ",
        "²": "^2",
        "³": "^3",
        "⁴": "^4",
        "⁵": "^5",
        "⁶": "^6",
        "⁷": "^7",
        "⁸": "^8",
    }
)
"""Units as everyone can type them, and as the tables and the commands have them: um^2/s."""

GAP = "  "
"""Between two columns of a table of text."""


def shown(value: Any) -> str:
    """A value as results show it: six significant digits, with its unit if it has one."""
    if value is None:
        return "unknown"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value + 0.0:.{DIGITS}g}"
    if hasattr(value, "units"):
        return str(value).translate(PLAIN_UNITS)
    return str(value)


def short_repr(result: Any) -> str:
    """The `repr` of a dataclass in at most MAX_REPR characters.

    What is left out is marked by dots.
    """
    parts = [(f.name, repr(getattr(result, f.name))) for f in fields(result) if f.repr]
    width = MAX_REPR
    while True:
        texts = [
            f"{name}={text if len(text) <= width else f'{text[:width]} ...'}"
            for name, text in parts
        ]
        whole = f"{type(result).__name__}({', '.join(texts)})"
        if len(whole) <= MAX_REPR or width < 10:
            return whole
        width = int(0.8 * width)


def html_table(
    heading: str,
    rows: Iterable[Sequence[Any]],
    titles: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> str:
    """A table of HTML with a heading, column titles and notes below; every text is escaped."""
    head = "".join(f"<th>{escape(title)}</th>" for title in titles)
    cells = (("".join(f"<td>{escape(shown(cell))}</td>" for cell in row)) for row in rows)
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    below = "".join(f"<div>{escape(note)}</div>" for note in notes)
    titled = f"<thead><tr>{head}</tr></thead>" if head else ""
    return (
        f"<div><strong>{escape(heading)}</strong>"
        f"<table>{titled}<tbody>{body}</tbody></table>{below}</div>"
    )


def text_table(titles: Sequence[str], rows: Sequence[Sequence[str]], align: str = "") -> list[str]:
    """The lines of a table with its titles, if there are any.

    `align` has a `<` for each column that is set to the left; further ones are set to the right.
    """
    sides = align.ljust(len(titles), ">")
    widths = [max(map(len, column)) for column in zip(titles, *rows, strict=True)]

    def line(cells: Sequence[str]) -> str:
        padded = (f"{c:{side}{w}}" for c, side, w in zip(cells, sides, widths, strict=True))
        return GAP.join(padded).rstrip()

    head = [line(titles), GAP.join("-" * size for size in widths)] if any(titles) else []
    return [*head, *map(line, rows)]


def plotted(result: Any, drawing: str, ax: Any = None, **options: Any) -> Any:
    """The axes with `result` drawn on them by `drawing`, "module.function" of `plotting`.

    matplotlib is imported here, and not before.
    """
    return _drawing(drawing)(result, ax, **options)


def html_picture(result: Any, drawing: str, **options: Any) -> str:
    """A small picture of HTML, by the same function."""
    return str(_drawing("figures.html_picture")(result, _drawing(drawing), **options))


def outside(name: str, *arguments: Any, **options: Any) -> Any:
    """What a function gives that looks at results from a package above: "exports.export.export".

    It is imported here, and not before.
    """
    module, _, function = name.rpartition(".")
    return getattr(import_module(f"amoeboid.{module}"), function)(*arguments, **options)


def _drawing(name: str) -> Any:
    module, function = name.split(".")
    return getattr(import_module(f"amoeboid.plotting.{module}"), function)
