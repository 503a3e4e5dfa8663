"""Progress of a long computation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One step of a long computation: the task, where it is, how finely resolved, how far.

    `value` is that of the parameter `name` at the latest point of a branch, `modes` the length of
    its series and `points` the number of points so far; 0 where a step has none of them.
    """

    task: str
    name: str
    value: float
    modes: int
    points: int


Watch = Callable[[Progress], None]
"""A callback that gets every step."""


def unwatched(_: Progress) -> None:
    """No-op callback."""
