"""Docstrings are plain text with single backticks; this makes reST of them.

Signs that reST would read as markup, as in |lambda|, stand for themselves, and an indented block is
a formula or code, shown as it stands.
"""

from __future__ import annotations

import ast
import re
import textwrap
from itertools import takewhile
from typing import Any

from sphinx.application import Sphinx

CODE = re.compile(r"(`[^`]*`)")
MARKUP = re.compile(r"[*|]|(?<=\w)_(?!\w)")
BULLET = re.compile(r"\s*(?:[-*]|\d+\.) ")


def escaped(line: str) -> str:
    """A line whose signs stand for themselves outside backticks."""
    parts = CODE.split(line)
    parts[::2] = [MARKUP.sub(r"\\\g<0>", part) for part in parts[::2]]
    return "".join(parts)


def language(lines: list[str]) -> str:
    """Of the indented block that lines begin with: Python, or the text of a formula."""
    block = takewhile(lambda line: not line.strip() or line.startswith("  "), lines)
    try:
        ast.parse(textwrap.dedent("\n".join(block)))
    except SyntaxError:
        return "text"
    return "python"


def restructured(lines: list[str]) -> list[str]:
    """The docstring as reST."""
    found: list[str] = []
    listed = literal = False
    for k, line in enumerate(lines):
        blank = not line.strip()
        indented = line.startswith("  ")
        starts = k == 0 or not lines[k - 1].strip()
        if not blank and not indented:
            literal = False
            listed = bool(BULLET.match(line)) or (listed and not starts)
        if indented and starts and not listed and not literal:
            found += [f".. code-block:: {language(lines[k:])}", ""]
            literal = True
        verbatim = blank or literal or line.lstrip().startswith((">>>", "...", ".."))
        found.append(line if verbatim else escaped(line))
    return found


def convert(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:  # the arguments of the event
    """Rewrite the docstring in place."""
    lines[:] = restructured(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect with autodoc, before what appends to docstrings."""
    app.connect("autodoc-process-docstring", convert, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
