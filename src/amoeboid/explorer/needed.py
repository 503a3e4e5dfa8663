"""The one package that the explorer needs besides those of amoeboid."""

from __future__ import annotations

from importlib.util import find_spec

from amoeboid.validation import InvalidInput


def check_websockets() -> None:
    """Raise InvalidInput, saying how to install it, where websockets is missing."""
    if find_spec("websockets") is None:
        raise InvalidInput(
            "the explorer needs the package websockets, which is not installed: "
            "pip install 'amoeboid[explore]'"
        )
