"""Texts of TOML: written here, read by Python's own `tomllib`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

INDENT = "    "
BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(tables: Mapping[str, Any]) -> str:
    """Tables of texts, numbers, true and false, sequences and further tables as a text of TOML.

    `tomllib.loads` reads it back equal, numbers to the last bit. Items of a sequence stand on lines
    of their own; a table within a sequence is written on one.

    >>> print(toml_text({"end": 2.0, "mesh": {"subdivisions": 3}}))
    end = 2.0
    <BLANKLINE>
    [mesh]
    subdivisions = 3
    <BLANKLINE>
    """
    return "\n".join(_parts(tables, ""))


def _parts(table: Mapping[str, Any], name: str) -> Iterator[str]:
    """The table itself, then those within it."""
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    lines = [f"{_key(k)} = {_value(v, '')}\n" for k, v in table.items() if k not in inner]
    if name and (lines or not inner):
        lines.insert(0, f"[{name}]\n")
    if lines:
        yield "".join(lines)
    for key, value in inner.items():
        yield from _parts(value, f"{name}.{_key(key)}" if name else _key(key))


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else _text(name)


def _value(value: Any, indent: str) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return str(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        entries = ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items())
        return f"{{ {entries} }}" if entries else "{}"
    if isinstance(value, Sequence):
        deeper = indent + INDENT
        items = "".join(f"{deeper}{_value(item, deeper)},\n" for item in value)
        return f"[\n{items}{indent}]" if items else "[]"
    raise TypeError(f"TOML has no {type(value).__name__}, got {value!r}")


def _inline(value: Any) -> str:
    """A value of a table on one line."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_inline, value))}]"
    return _value(value, "")


def _text(text: str) -> str:
    # the escapes of JSON, and the one that TOML asks for besides
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
