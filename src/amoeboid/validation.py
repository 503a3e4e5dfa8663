"""Declared fields of frozen dataclasses: type, range and meaning in one place."""

from __future__ import annotations

import math
import os
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import Field, field, fields
from difflib import get_close_matches
from itertools import pairwise
from numbers import Integral, Real
from pathlib import Path
from typing import Any


class InvalidInput(ValueError):
    """What the user gave breaks a rule; the message names the rule, the value and the remedy."""


MAX_LISTED = 20
"""Known names that a message lists."""

DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?", re.ASCII)
WITH_UNIT = re.compile(r"[+-]?\d[\d.]*(?:[eE][+-]?\d+)? ?[A-Za-z\u00b5\u03bc*/]")


def number(
    default: float,
    doc: str,
    unit: str = "1",
    *,
    gt: float | None = None,
    ge: float | None = None,
    le: float | None = None,
) -> Any:
    """A finite real field; `unit` in base dimensions of the model, `gt`/`ge`/`le` its range."""
    return _declared(float, default, doc, unit, gt, ge, le)


def file(doc: str) -> Any:
    """A field that names a file, or None, the default."""
    return field(default=None, metadata={"kind": str, "doc": doc, "file": True})


def harmonics(doc: str, unit: str = "1") -> Any:
    """A field of spherical harmonics: any number of (degree l, order m, amplitude [unit])."""
    return field(default=(), metadata={"kind": list, "doc": doc, "row_units": ("1", "1", unit)})


def texts(doc: str, checked: Callable[[str], str]) -> Any:
    """A field of texts; `checked` gives each as it is kept, or raises InvalidInput."""
    return field(default=(), metadata={"kind": list, "doc": doc, "texts": checked})


def rows(
    doc: str,
    words: str,
    checked: Callable[[Any], tuple[tuple[float, ...], ...]],
    units: tuple[str, ...],
) -> Any:
    """A field of rows of numbers, which `words` describe; `checked` gives them as they are kept.

    `units` are the dimensions of the numbers of a row. `checked` raises TypeError, ValueError or
    OverflowError for what is none.
    """
    about = {"kind": list, "doc": doc, "words": words, "rows": checked, "row_units": units}
    return field(default=(), metadata=about)


def numbers(doc: str, unit: str = "1") -> Any:
    """A field of any number of finite numbers >= 0, each larger than the one before."""
    return field(default=(), metadata={"kind": list, "doc": doc, "unit": unit, "rising": True})


def automatic(doc: str, unit: str = "1", *, gt: float | None = None) -> Any:
    """A finite real field that is found from the other fields where it is None, the default."""
    meta = {"kind": float, "doc": doc, "unit": unit, "bounds": {">": gt, ">=": None, "<=": None}}
    return field(default=None, metadata=meta | {"automatic": True})


def integer(default: int, doc: str, *, ge: int | None = None, le: int | None = None) -> Any:
    """A whole-number field."""
    return _declared(int, default, doc, "1", None, ge, le)


def flag(default: bool, doc: str) -> Any:
    """A true/false field."""
    return _declared(bool, default, doc, "", None, None, None)


def choice(default: str, doc: str, options: tuple[str, ...]) -> Any:
    """A field that takes one of a few words."""
    return field(default=default, metadata={"kind": str, "doc": doc, "options": options})


def vector(default: tuple[float, float, float], doc: str) -> Any:
    """A field of three finite numbers, not all zero."""
    return field(default=default, metadata={"kind": tuple, "doc": doc})


def _declared(
    kind: type,
    default: object,
    doc: str,
    unit: str,
    gt: float | None,
    ge: float | None,
    le: float | None,
) -> Any:
    bounds = {">": gt, ">=": ge, "<=": le}
    meta = {"kind": kind, "doc": doc, "unit": unit, "bounds": bounds}
    return field(default=default, metadata=meta)


def validate(instance: Any, section: str = "") -> None:
    """Check and normalize every declared field of a frozen dataclass instance.

    Raises InvalidInput with the field, the rule and the value.
    """
    for f in fields(instance):
        if "kind" in f.metadata:
            name = f"{section}.{f.name}" if section else f.name
            checked = _checked(name, getattr(instance, f.name), f)
            object.__setattr__(instance, f.name, checked)


def refuse_unknown(
    names: Iterable[str], known: Iterable[str], noun: str, where: str = "", source: str = ""
) -> None:
    """Raise InvalidInput for the first name that is not known, with the nearest known one.

    The nearest is one that differs only in the case of letters, or else the most similar one.
    `where` follows the name in the message: "of the law 'inverse'". Of many known names the first
    are listed; `source` tells what lists all, such as "amoeboid run --help".
    """
    known = list(known)
    for name in names:
        if name not in known:
            same = [one for one in known if one.lower() == name.lower()]
            close = same or get_close_matches(name, known, n=1)
            hint = f" did you mean {close[0]}?" if close else ""
            place = f" {where}" if where else ""
            listed, more = known[:MAX_LISTED], len(known) - MAX_LISTED
            rest = f" and {more} more{f', see {source}' if source else ''}" if more > 0 else ""
            allowed = ", ".join(listed)
            raise InvalidInput(f"unknown {noun} {name!r}{place};{hint} allowed: {allowed}{rest}")


def is_text(value: str) -> bool:
    """Whether a string can be written to a file and name one: UTF-8, without the character 0."""
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return "\0" not in value


def path_of(given: Any, what: str) -> Path:
    """A path that a user gives. Raises InvalidInput, naming `what`, for what names no file."""
    text = os.fspath(given) if isinstance(given, str | os.PathLike) else None
    if not isinstance(text, str) or not text or not is_text(text):
        raise InvalidInput(f"{what} must be a path, a text or pathlib.Path, got {given!r:.100}")
    return Path(text)


def toml_document(text: str, what: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises InvalidInput, naming `what`, if it is not valid TOML."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError) as error:
        raise InvalidInput(f"{what} must be valid TOML: {error}") from None
    except RecursionError:
        raise InvalidInput(f"{what} must be valid TOML: it is nested too deeply") from None


def rule(f: Field[Any]) -> str:
    """What a declared field accepts, in words."""
    kind = f.metadata["kind"]
    if "options" in f.metadata:
        return "one of " + ", ".join(f.metadata["options"])
    if kind is bool:
        return "true or false"
    if kind is tuple:
        return "three finite numbers, not all zero"
    if "texts" in f.metadata:
        return "a list of texts"
    if "rows" in f.metadata:
        return str(f.metadata["words"])
    if "rising" in f.metadata:
        return "a list of finite numbers >= 0, each larger than the one before"
    if kind is list:
        return "a list of [l, m, amplitude]: whole numbers |m| <= l, a finite number"
    if "file" in f.metadata:
        return "the path of a file, or left out"
    limits = " and ".join(
        f"{sign} {value:g}" for sign, value in f.metadata["bounds"].items() if value is not None
    )
    noun = "a whole number" if kind is int else "a finite number"
    words = f"{noun} {limits}".strip()
    return f"{words}, or left out" if "automatic" in f.metadata else words


def _checked(name: str, value: Any, f: Field[Any]) -> Any:
    if value is None and ("automatic" in f.metadata or "file" in f.metadata):
        return None
    try:
        return _converted(value, f)
    except _Unfit as unfit:
        remedy = _remedy(value, f.metadata.get("unit", "")) if f.metadata["kind"] is float else ""
        message = f"{name} must be {rule(f)}, got {value!r}{remedy}"
        raise InvalidInput(message) from unfit.__cause__


def _remedy(value: Any, unit: str) -> str:
    """What to do about a text where a number is due, as far as it shows what was meant."""
    if DECIMAL_COMMA.fullmatch(str(value)):
        return "; write a decimal point"
    if isinstance(value, str) and WITH_UNIT.match(value):
        if unit in ("", "1"):
            return "; it has no unit, leave that out"
        return (
            "; values with units need a cell with units: --physical on the command line, "
            "physical = true at the head of a file, Parameters.physical in Python"
        )
    return ""


class _Unfit(Exception):
    """The value of a field breaks its rule, which is put into words only then."""


def _converted(value: Any, f: Field[Any]) -> Any:
    kind, problem = f.metadata["kind"], _Unfit
    if "options" in f.metadata:
        if not isinstance(value, str) or value not in f.metadata["options"]:
            raise problem
        return value
    if kind is bool:
        if not isinstance(value, bool):
            raise problem
        return value
    if kind is tuple:
        return _checked_vector(value, problem)
    if "texts" in f.metadata:
        return _checked_texts(value, problem, f.metadata["texts"])
    if "rows" in f.metadata:
        try:
            return f.metadata["rows"](value)
        except (TypeError, ValueError, OverflowError):
            raise problem from None
    if "rising" in f.metadata:
        return _checked_rising(value, problem)
    if kind is list:
        return _checked_harmonics(value, problem)
    if "file" in f.metadata:
        if not isinstance(value, str) or not value.strip() or not is_text(value):
            raise problem
        return value
    if isinstance(value, bool) or not isinstance(value, Real):
        raise problem
    if kind is int and not isinstance(value, Integral):
        raise problem
    try:
        converted = kind(value)
        finite = math.isfinite(converted)
    except OverflowError:
        raise problem from None
    if not finite:
        raise problem
    bounds = f.metadata["bounds"]
    if (
        (bounds[">"] is not None and not converted > bounds[">"])
        or (bounds[">="] is not None and not converted >= bounds[">="])
        or (bounds["<="] is not None and not converted <= bounds["<="])
    ):
        raise problem
    return converted


def _checked_vector(value: Any, problem: type[_Unfit]) -> tuple[float, float, float]:
    try:
        components = list(value)
    except TypeError:
        raise problem from None
    if len(components) != 3 or any(
        isinstance(x, bool) or not isinstance(x, Real) for x in components
    ):
        raise problem
    try:
        x, y, z = (float(v) for v in components)
    except OverflowError:
        raise problem from None
    # the length must be a normal number, so that a direction can be made of it
    if not math.isfinite(x * x + y * y + z * z) or math.hypot(x, y, z) < 1e-150:
        raise problem
    return x, y, z


def _checked_texts(
    value: Any, problem: type[_Unfit], checked: Callable[[str], str]
) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(text, str) for text in value):
        raise problem
    return tuple(checked(text) for text in value)


def _checked_rising(value: Any, problem: type[_Unfit]) -> tuple[float, ...]:
    try:
        found = list(value)
        if any(isinstance(x, bool) or not isinstance(x, Real) for x in found):
            raise problem
        found = [float(x) for x in found]
    except (TypeError, OverflowError):
        raise problem from None
    rising = all(a < b for a, b in pairwise(found))
    if not all(map(math.isfinite, found)) or not rising or min(found, default=0.0) < 0:
        raise problem
    return tuple(found)


def _checked_harmonics(value: Any, problem: type[_Unfit]) -> tuple[tuple[int, int, float], ...]:
    checked = []
    try:
        for degree, order, amplitude in value:
            if any(isinstance(x, bool) for x in (degree, order, amplitude)):
                raise problem
            if not isinstance(degree, Integral) or not isinstance(order, Integral):
                raise problem
            if not isinstance(amplitude, Real) or not math.isfinite(amplitude):
                raise problem
            if abs(order) > degree:
                raise problem
            checked.append((int(degree), int(order), float(amplitude)))
    except (TypeError, ValueError, OverflowError):
        raise problem from None
    return tuple(checked)
