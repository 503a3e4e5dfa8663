"""What acts on a cell from outside: parameters that change in time, and a cue."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from amoeboid.model.changes import CUE_STRENGTH, Changes
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput


@dataclass(frozen=True)
class Inputs:
    """A cell's parameters as they are given, how they change, and the cue that acts on it.

    `cue` is None, or an object with `factor` as that of `Cue`. Raises InvalidInput for values out
    of range and for a cue without `factor`.
    """

    given: Parameters
    changes: Changes = field(default_factory=Changes)
    cue: Any = None

    def __post_init__(self) -> None:
        if self.cue is not None and not callable(getattr(self.cue, "factor", None)):
            raise InvalidInput(
                f"a cue must be a Cue or an object with factor(directions, t), got {self.cue!r}"
            )
        if CUE_STRENGTH in self.changes and not isinstance(self.cue, Cue):
            raise InvalidInput(
                f"changes.{CUE_STRENGTH} needs a Cue, got {self.cue!r}; make the factor of your "
                "cue depend on time"
            )
        times = [0.0, *self.breaks]
        for begin, end in zip(times, [*times[1:], times[-1]], strict=True):
            for t in (begin, end):
                self.parameters_at(t, begin)
                self.cue_at(t, begin)

    @cached_property
    def breaks(self) -> tuple[float, ...]:
        """Times at which an input is not smooth, in order."""
        return tuple(sorted({t for found in self.changes.values() for t in found.breaks}))

    @cached_property
    def until(self) -> float:
        """The time after which all inputs are constant; -inf if they always are."""
        ends = [found.until for found in self.changes.values()]
        ends += [] if self.cue is None else [getattr(self.cue, "until", math.inf)]
        return float(max(ends, default=-math.inf))

    def next_break(self, t: float) -> float:
        """The first break after t, or infinity."""
        return next((b for b in self.breaks if b > t), math.inf)

    def parameters_at(self, t: float, since: float) -> Parameters:
        """The parameters at time t, where no break lies between `since` and t; see Change.at."""
        values = {
            name: self._value(name, t, since, self.given.value(name))
            for name in self.changes
            if name != CUE_STRENGTH
        }
        return self._checked(t, lambda: self.given.replace(**values)) if values else self.given

    def cue_at(self, t: float, since: float) -> Any:
        """The cue at time t, or None; see `parameters_at`."""
        if CUE_STRENGTH not in self.changes:
            return self.cue
        strength = self._value(CUE_STRENGTH, t, since, self.cue.strength)
        return self._checked(t, lambda: replace(self.cue, strength=strength))

    def _value(self, name: str, t: float, since: float, given: float) -> float:
        try:
            return self.changes[name].at(t, since, given)
        except InvalidInput as error:
            raise InvalidInput(f"changes.{name}: {error}") from None

    @staticmethod
    def _checked(t: float, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except InvalidInput as error:
            raise InvalidInput(f"[changes] at t = {t:g}: {error}") from None


def inputs_of(given: Parameters, changes: Changes, cue: Any) -> Inputs | None:
    """What acts on a cell, None if its parameters are constant and no cue acts.

    Raises InvalidInput as Inputs.
    """
    idle = cue is None or (isinstance(cue, Cue) and not cue.acts)
    if idle and CUE_STRENGTH not in changes:
        return Inputs(given, changes) if changes else None
    return Inputs(given, changes, Cue() if cue is None else cue)
