"""What a long computation tells whoever waits for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One step of a long computation: what is under way, where, how finely, how far.

    `value` is that of the parameter `name` at the latest point of a branch, `modes` the length of
    its series and `points` the number of points so far.
    """

    task: str
    name: str
    value: float
    modes: int
    points: int


Watch = Callable[[Progress], None]
"""Called with every step as it is made."""


def unwatched(_: Progress) -> None:
    """Tell nobody."""
