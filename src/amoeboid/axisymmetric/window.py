"""The window of a parameter inside which a branch is listed."""

from __future__ import annotations

from dataclasses import dataclass

from amoeboid.numerics.arcs import Arc
from amoeboid.validation import InvalidInput

NOTHING = 1e-9
"""Deviations from symmetry below this fraction are rounding."""


@dataclass(frozen=True)
class Window:
    """The values low <= parameter <= high inside which a branch is listed."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InvalidInput(
                f"the window of the parameter must have low < high, got {self.low!r}, {self.high!r}"
            )

    @classmethod
    def of(cls, window: Window | tuple[float, float]) -> Window:
        """The window itself, or that of a pair (low, high). Raises InvalidInput for others."""
        if isinstance(window, Window):
            return window
        try:
            low, high = (float(value) for value in window)
        except (TypeError, ValueError):
            raise InvalidInput(
                f"the window of the parameter must be a pair (low, high), got {window!r}"
            ) from None
        return cls(low, high)

    def holds(self, value: float) -> bool:
        """Whether the value lies inside, ends included."""
        return self.low <= value <= self.high

    def overlap(self, arc: Arc) -> tuple[float, float] | None:
        """(first, last) value on the way from arc.a to arc.b inside the window; None if none."""
        a, b = (min(max(q.parameter, self.low), self.high) for q in (arc.a, arc.b))
        return None if abs(b - a) <= NOTHING * max(abs(a), abs(b)) else (a, b)
