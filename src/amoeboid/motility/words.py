"""Environments as words: `fluid`, `patch:30`, `matrix:normal=2+fluid`."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Any

from amoeboid.motility.contacts import Channel, Patch, Plates
from amoeboid.motility.environments import CortexDrag, Environment, Fluid, Matrix, Mixed
from amoeboid.validation import InvalidInput

ENVIRONMENTS: dict[str, type[Environment]] = {
    kind.name: kind for kind in (Fluid, Matrix, Patch, Plates, Channel, CortexDrag)
}
"""The environments that a word stands for; `environment` reads them."""

# The field that stands behind the first colon of a word, without a name.
FIRST_FIELD = {
    "fluid": "viscosity",
    "matrix": "tangential",
    "patch": "half_angle",
    "plates": "half_angle",
    "channel": "half_width",
    "cortex": "friction",
}


def environment(text: str) -> Environment:
    """The environment that a text means: `fluid`, `patch:30`, `matrix:normal=2+fluid`.

    Values stand behind colons, with the names of their fields; the first needs none. Several at
    once are joined by `+`. Raises InvalidInput.

    >>> environment("patch:30")
    Patch(coupled=1.0, friction=None, half_angle=30.0, axis=None)
    """
    parts = [_one(part.strip(), text) for part in re.split(r"\+(?=\s*[a-z])", text)]
    return parts[0] if len(parts) == 1 else Mixed(*parts)


def written(given: Environment) -> str:
    """The text that `environment` reads as this one. Raises InvalidInput for one of Python alone.

    >>> written(Patch(30.0, coupled=0.5))
    'patch:coupled=0.5:half_angle=30.0'
    """
    texts = []
    for part in given.parts:
        if ENVIRONMENTS.get(part.name) is not type(part):
            raise InvalidInput(
                "an environment that is written to a file must be one of "
                f"{', '.join(ENVIRONMENTS)}, got {type(part).__name__}, which exists only in "
                "Python; run it without a folder"
            )
        values = ((f.name, getattr(part, f.name), f.default) for f in fields(part))
        first = FIRST_FIELD[part.name]
        said = [
            f"{name}={_written(value)}"
            for name, value, usual in values
            if value != usual or (name == first and value is not None)
        ]
        texts.append(":".join([part.name, *said]))
    return "+".join(texts)


def _written(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return " ".join(map(repr, value)) if isinstance(value, tuple) else str(value)


def _one(text: str, whole: str) -> Environment:
    name, *values = (part.strip() for part in text.split(":"))
    if name not in ENVIRONMENTS:
        raise InvalidInput(
            f"an environment must be one of {', '.join(ENVIRONMENTS)}, such as patch:30, got "
            f"{whole!r}"
        )
    kind = ENVIRONMENTS[name]
    known = {f.name for f in fields(kind)}
    given: dict[str, Any] = {}
    for place, value in enumerate(values):
        key, equals, said = value.partition("=")
        if not equals and place == 0:
            key, said = FIRST_FIELD[name], value
        key = key.strip()
        if key not in known or not said.strip():
            raise InvalidInput(
                f"{name} takes {', '.join(sorted(known))}, as in {name}:{FIRST_FIELD[name]}=..., "
                f"got {value!r} in {whole!r}"
            )
        given[key] = said.split() if key == "axis" else _value(said.strip())
    return kind(**given)


def _value(text: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    try:
        return float(text)
    except ValueError:
        return text
