"""Runs in the formats of other programs, as movies and as summaries.

A format is a module of `formats` that defines `FORMAT`, and is found by its name.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from amoeboid.exports.job import Format

FORMATS = "amoeboid.exports.formats"


@cache
def names() -> tuple[str, ...]:
    """The names of all formats."""
    return tuple(sorted(module.name for module in iter_modules(import_module(FORMATS).__path__)))


def named(name: str) -> Format:
    """The format of a name. Raises InvalidInput for an unknown one."""
    from amoeboid.validation import refuse_unknown

    refuse_unknown([name], names(), "export format")
    return import_module(f"{FORMATS}.{name}").FORMAT
