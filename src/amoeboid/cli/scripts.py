"""Observables of a user's own script, `--observe SCRIPT.py:NAME`. The script is executed."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from amoeboid.validation import InvalidInput

ENDING = ".py"


def observed_names(given: Iterable[str]) -> list[str]:
    """The names of observables; those of scripts are registered. Raises InvalidInput."""
    return [_registered(text) for text in given]


def _registered(text: str) -> str:
    script, colon, name = text.rpartition(":")
    if not colon:
        if text.endswith(ENDING):
            raise InvalidInput(
                f"--observe takes the name of an observable or SCRIPT.py:NAME, got {text!r}; add "
                "the name"
            )
        return text
    if not script.endswith(ENDING) or not name.isidentifier():
        raise InvalidInput(
            f"--observe takes the name of an observable, or SCRIPT.py:NAME, got {text!r}"
        )
    _run(str(Path(script).absolute()))
    from amoeboid.observables import OBSERVABLES

    if name not in OBSERVABLES:
        raise InvalidInput(
            f"{script} must register the observable {name!r} with "
            "@amoeboid.observable(dimension), but it does not"
        )
    return name


@cache
def _run(path: str) -> None:
    """Execute a script, once. Raises InvalidInput in one line, whatever it raises."""
    spec = spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None or not Path(path).is_file():
        raise InvalidInput(f"--observe needs a script, {path!r} is not a file")
    module = module_from_spec(spec)
    sys.path.insert(0, str(Path(path).parent))  # for what stands beside it
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # a script may raise anything
        words = " ".join(str(error).split())[:300]
        raise InvalidInput(
            f"the script {path!r} must run without errors, it raised {type(error).__name__}: "
            f"{words}"
        ) from None
    finally:
        sys.path.remove(str(Path(path).parent))
