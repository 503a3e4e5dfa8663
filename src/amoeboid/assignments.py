"""Texts such as `time.end=50`, as `--set` takes them, and the names that they may have."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

from amoeboid.model.changes import CHANGEABLE
from amoeboid.model.parameters import PARAMETER_NAMES, RELATIONS
from amoeboid.quantities import SECTION_CLASSES
from amoeboid.validation import InvalidInput, refuse_unknown

# The field of [environment]: the text of one, such as "patch:30".
MEDIUM = "medium"
POINT_AT_AN_END = re.compile(r"[+-]?(?:\d+\.|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)

SECTIONS: dict[str, tuple[str, ...]] = {
    "parameters": PARAMETER_NAMES,
    **{name: tuple(f.name for f in fields(kind)) for name, kind in SECTION_CLASSES.items()},
    "changes": CHANGEABLE,
    "environment": (MEDIUM,),
}
"""The sections of a configuration and the names in them."""


def assignments(settings: Iterable[str]) -> dict[str, dict[str, Any]]:
    """{section: {name: value}} of texts `name=value`, a parameter, or `section.key=value`.

    Values are written as in TOML; a bare word is a string. Raises InvalidInput.
    """
    changes: dict[str, dict[str, Any]] = {}
    for setting in settings:
        path, equals, text = setting.partition("=")
        path = path.strip()
        if not equals or not path or not text.strip():
            raise InvalidInput(f"--set takes name=value or section.key=value, got {setting!r}")
        section, dot, name = path.partition(".")
        if dot and not (section and name):
            raise InvalidInput(f"--set takes name=value or section.key=value, got {setting!r}")
        if section in RELATIONS:
            section, name = "parameters", path
        elif not dot:
            section, name = "parameters", path
            known = (*PARAMETER_NAMES, *_dotted_names())
            refuse_unknown([name], known, "parameter or field", source="amoeboid run --help")
        value = text.strip() if name in RELATIONS else _value(text.strip())
        changes.setdefault(section, {})[name] = value
    return changes


def _value(text: str) -> Any:
    try:
        document = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        # .5 and 5. are numbers too, though not in TOML
        return float(text) if POINT_AT_AN_END.fullmatch(text) else text
    return document["value"] if document.keys() == {"value"} else text


def _dotted_names() -> list[str]:
    return [f"{s}.{n}" for s, names in SECTIONS.items() if s != "parameters" for n in names]
