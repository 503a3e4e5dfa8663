"""A text for a value that differs where results computed with it may.

It is made of the content: two equal cells have the same one, in every process and on every machine.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from hashlib import sha256
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from amoeboid.config import FILES, Config, config_to_toml
from amoeboid.identity.sources import digest_of
from amoeboid.model.parameters import Parameters, parameters_to_toml


class Unidentified(TypeError):
    """No text can tell this value from others."""


Naming = Callable[[Callable[..., Any]], str]
"""What makes a text of a function or a class."""


def content(value: Any, naming: Naming | None = None) -> str:
    """A text that differs where results computed with `value` may.

    Functions and classes are told by `naming`, with their code if left out. Raises Unidentified
    where no text can tell a value from others, and InvalidInput for a law, a stress, a change or a
    cue that no text can hold.
    """
    name = naming or code

    def of(inner: Any) -> str:
        return content(inner, name)

    if isinstance(value, Parameters):
        return f"{parameters_to_toml(value)}{value.units!r}"
    if isinstance(value, Config):
        return f"{config_to_toml(value)}{value.parameters.units!r}{_files(value)}"
    if value is None or isinstance(value, bool | int | float | complex | str | PurePath):
        return repr(value)
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, np.ndarray):
        return f"array({value.dtype.str}, {value.shape}, {_digest(value.tobytes())})"
    if isinstance(value, tuple):
        return f"({', '.join(map(of, value))})"
    if isinstance(value, list):
        return f"[{', '.join(map(of, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{of(k)}: {of(v)}' for k, v in value.items())}}}"
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        return f"{of(value.magnitude)} {value.units}"
    if isinstance(value, functools.partial):
        given = [*map(of, value.args), *(f"{k}={of(v)}" for k, v in sorted(value.keywords.items()))]
        return f"{of(value.func)}({', '.join(given)})"
    if is_dataclass(value) and not isinstance(value, type):
        own = (f"{f.name}={of(getattr(value, f.name))}" for f in fields(value))
        return f"{name(type(value))}({', '.join(own)})"
    return name(value)


def code(function: Callable[..., Any]) -> str:
    """The name of a function or a class, and a digest of the code that it computes with.

    Raises Unidentified for one that its name does not tell from others: one of a notebook may be
    another one in the next moment, one made by another function depends on what that was given.
    """
    own = file_of(function)
    if own is None:
        raise Unidentified(f"no file holds {function!r} under its name")
    return f"{name_of(function)} {digest_of(own, function.__module__)}"


def name_of(function: Callable[..., Any]) -> str:
    """The full name of a function."""
    return f"{function.__module__}.{function.__qualname__}"


def file_of(function: Callable[..., Any]) -> Path | None:
    """The file that holds this function under its name; None if there is none."""
    module = sys.modules.get(getattr(function, "__module__", None) or "")
    named: Any = module
    for part in getattr(function, "__qualname__", "").split("."):
        named = getattr(named, part, None)
    file = getattr(module, "__file__", None)
    if named is not function or file is None or not Path(file).is_file():  # "<stdin>" is none
        return None
    return Path(file)


def _files(config: Config) -> str:
    """Digests of the files that a configuration names."""
    named = {field: getattr(config.initial, field) for field in FILES}
    found = {f: _digest(Path(path).read_bytes()) for f, path in named.items() if path is not None}
    return repr(found) if found else ""


def _digest(data: bytes) -> str:
    return sha256(data).hexdigest()
