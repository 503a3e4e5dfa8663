"""The figures and tables of the paper, and some that it does not have, from solver results.

    import amoeboid as am

    am.figures.names()               # of all figures
    axes = am.figures.fig3a()        # drawn with pyplot; or on axes of your own, ax=...
    data = am.figures.fig3a.data()   # the numbers alone
    am.figures.fig3a.save("figures")  # picture and tables as files

A figure is a module of `gallery` that defines `FIGURE`, and is found by its name.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from amoeboid.figures.figure import Figure

GALLERY = "amoeboid.figures.gallery"

ORDER = ("fig", "s_", "table", "extra_")
"""How names begin, in the order of the list: main text, supplement, tables, not in the paper."""


@cache
def names() -> tuple[str, ...]:
    """The names of all figures: those of the main text first, those that it does not have last."""
    found = [module.name for module in iter_modules(import_module(GALLERY).__path__)]
    return tuple(sorted(found, key=lambda name: (_place(name), name)))


def _place(name: str) -> int:
    return next((k for k, start in enumerate(ORDER) if name.startswith(start)), len(ORDER))


def named(name: str) -> Figure:
    """The figure of a name. Raises InvalidInput for an unknown one."""
    from amoeboid.validation import refuse_unknown

    refuse_unknown([name], names(), "figure")
    return import_module(f"{GALLERY}.{name}").FIGURE


def __getattr__(name: str) -> Any:
    if name.startswith("_") or name not in names():
        raise AttributeError(f"module 'amoeboid.figures' has no attribute {name!r}")
    return named(name)


def __dir__() -> list[str]:
    return sorted([*names(), "named", "names"])
