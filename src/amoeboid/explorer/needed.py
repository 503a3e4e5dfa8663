"""The packages that the explorer needs besides those of a simulation."""

from __future__ import annotations

from amoeboid.extras import check


def check_packages() -> None:
    """Raise InvalidInput, saying how to install it, where one is missing."""
    check("the explorer needs", "websockets", "matplotlib", "numba", "PIL")
