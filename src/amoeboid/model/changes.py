"""Parameters that change in time: jumps, straight lines, smooth functions.

Between its `breaks` a change is smooth. A time step never crosses a break: it ends there with the
value before a jump, and the next one begins with the value after it.

To add a kind of change, write a subclass of `Change`, here or in a script of your own.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from numbers import Real
from typing import Any

import numpy as np

from amoeboid.model.parameters import DIMENSIONS, RELATIONS
from amoeboid.validation import InvalidInput, refuse_unknown

Points = tuple[tuple[float, float], ...]

# R0 sets the membrane area, which the cell keeps.
FIXED = ("R0",)
CUE_STRENGTH = "cue.strength"
CHANGEABLE: tuple[str, ...] = (*(n for n in DIMENSIONS if n not in FIXED), CUE_STRENGTH)
CHANGE_RULE = (
    "a list of [time, value] for jumps, {ramp = [[time, value], ...]} for straight lines, or in "
    "Python steps(...), ramp(...) or a function of time"
)


class Change(ABC):
    """How one parameter depends on time.

    `breaks`: times > 0 at which it is not smooth. `until`: the time after which it is constant.
    """

    breaks: tuple[float, ...] = ()
    until: float = math.inf

    @abstractmethod
    def at(self, t: float, since: float, given: float) -> float:
        """The value, in the units of the parameter, at time t >= since [T].

        No break lies between `since` and t.

        At a jump: the value before it if `since` is earlier, the value after it if `since` is the
        jump. `given` is the parameter itself, as it stands in the parameters.
        """

    def written(self) -> Any:
        """What a TOML file holds. Raises InvalidInput for a change that no file can hold."""
        raise InvalidInput(
            f"a change that is written to a file must be {CHANGE_RULE.partition(', or')[0]}, got "
            f"{self!r}, which exists only in Python; run it without a folder"
        )


@dataclass(frozen=True)
class Steps(Change):
    """Jumps to given values at given times; before the first the parameter itself."""

    points: Points

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _points("steps", self.points, earliest_allowed=False))

    @property
    def breaks(self) -> tuple[float, ...]:  # type: ignore[override]
        """The times of the jumps."""
        return tuple(t for t, _ in self.points)

    @property
    def until(self) -> float:  # type: ignore[override]
        """The time of the last jump."""
        return self.points[-1][0]

    def at(self, t: float, since: float, given: float) -> float:
        """See Change.at."""
        passed = bisect_right(self.breaks, since)
        return self.points[passed - 1][1] if passed else given

    def written(self) -> Any:
        """See Change.written."""
        return [list(point) for point in self.points]

    def __repr__(self) -> str:
        return f"steps{_shown(self.points)}"


@dataclass(frozen=True)
class Ramp(Change):
    """Straight lines between given values at given times; constant before and after.

    The first value holds from t = 0, whatever the parameter itself is.
    """

    points: Points

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _points("ramp", self.points, earliest_allowed=True))

    @property
    def breaks(self) -> tuple[float, ...]:  # type: ignore[override]
        """The times of the corners."""
        return tuple(t for t, _ in self.points if t > 0)

    @property
    def until(self) -> float:  # type: ignore[override]
        """The time of the last corner."""
        return self.points[-1][0]

    def at(self, t: float, since: float, given: float) -> float:
        """See Change.at."""
        times, values = zip(*self.points, strict=True)
        return float(np.interp(t, times, values))

    def written(self) -> Any:
        """See Change.written."""
        return {"ramp": [list(point) for point in self.points]}

    def __repr__(self) -> str:
        return f"ramp{_shown(self.points)}"


@dataclass(frozen=True)
class Smooth(Change):
    """A smooth function of time from t = 0 on, whatever the parameter itself is.

    `until`: the time after which it is constant. Without it a run does not end as steady. Raises
    InvalidInput where the function gives no finite number.
    """

    f: Callable[[float], float]
    until: float = math.inf

    def __post_init__(self) -> None:
        if not callable(self.f):
            raise InvalidInput(f"a change must be {CHANGE_RULE}, got {self.f!r}")

    @property
    def breaks(self) -> tuple[float, ...]:  # type: ignore[override]
        """The time after which it is constant."""
        return (self.until,) if 0 < self.until < math.inf else ()

    def at(self, t: float, since: float, given: float) -> float:
        """See Change.at."""
        try:
            value = float(self.f(min(t, self.until)))
        except Exception as error:  # a user's function may raise anything
            raise InvalidInput(
                f"the function {_name(self.f)} must return a number; at t = {t:g} it raised "
                f"{type(error).__name__}: {error}"
            ) from error
        if not math.isfinite(value):
            raise InvalidInput(
                f"the function {_name(self.f)} must return a finite number; at t = {t:g} it "
                f"returned {value}"
            )
        return value

    def __repr__(self) -> str:
        until = "" if self.until == math.inf else f", until={self.until:g}"
        return f"smooth({_name(self.f)}{until})"


def steps(*points: tuple[float, float]) -> Steps:
    """A parameter that jumps: `steps((5.0, 0.0), (20.0, 6.0))` is 0 from t = 5, 6 from t = 20.

    `points`: pairs of a time [T] and the value from then on, in the units of the parameter. Times
    must be > 0 and increase. Raises InvalidInput.

    >>> steps((5, 0), (20, 6)).at(7.0, since=6.5, given=3.8)
    0.0
    """
    return Steps(tuple(points))


def ramp(*points: tuple[float, float]) -> Ramp:
    """A parameter on straight lines between `points` (time, value), constant before and after.

    Times [T] must be >= 0 and increase; values are in the units of the parameter. Raises
    InvalidInput.

    >>> ramp((0, 3.0), (10, 6.0)).at(5.0, since=4.5, given=3.8)
    4.5
    """
    return Ramp(tuple(points))


def smooth(f: Callable[[float], float], until: float = math.inf) -> Smooth:
    """A parameter that follows a smooth function f of time [T], constant from `until` on.

    Raises InvalidInput for a value that is not a function.

    >>> smooth(lambda t: 6.0 / (1.0 + t), until=5.0).at(7.0, since=6.5, given=3.8)
    1.0
    """
    return Smooth(f, until)


def change(found: Any) -> Change:
    """The change that a value means: a Change, a function of time, or what a TOML file holds.

    Raises InvalidInput.
    """
    if isinstance(found, Change):
        return found
    if callable(found):
        return Smooth(found)
    if isinstance(found, Mapping) and set(found) == {"ramp"}:
        return Ramp(found["ramp"])
    if isinstance(found, list | tuple):
        return Steps(tuple(found))
    raise InvalidInput(f"it must be {CHANGE_RULE}, got {found!r}")


class Changes(Mapping[str, Change]):
    """The parameters that change in time, by name; values are what `change` takes.

    Names are those of the numbers in Parameters, also of law and stress (`law.n`, `stress.k`),
    and `cue.strength`.

    Raises InvalidInput for an unknown name, R0, and a value that is no change.
    """

    def __init__(self, given: Mapping[str, Any] | None = None) -> None:
        self._changes: dict[str, Change] = {}
        for name, found in flat_changes(given or {}).items():
            if name in FIXED:
                raise InvalidInput(
                    f"changes may name any parameter except {name}, got {name}, which sets the "
                    "conserved membrane area; change delta_P or the viscosities instead"
                )
            if not _of_a_relation(name):
                refuse_unknown([name], CHANGEABLE, "parameter", "in changes")
            try:
                self._changes[name] = change(found)
            except InvalidInput as error:
                raise InvalidInput(f"changes.{name}: {error}") from None

    def __getitem__(self, name: str) -> Change:
        return self._changes[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._changes)

    def __len__(self) -> int:
        return len(self._changes)

    def __hash__(self) -> int:
        return hash(frozenset(self._changes.items()))

    def __repr__(self) -> str:
        return f"Changes({', '.join(f'{name}: {found!r}' for name, found in self.items())})"

    def written(self) -> dict[str, Any]:
        """What a TOML file holds. Raises InvalidInput for a change that no file can hold."""
        written = {}
        for name, found in self.items():
            try:
                written[name] = found.written()
            except InvalidInput as error:
                raise InvalidInput(f"changes.{name}: {error}") from None
        return _nested(written)


def _of_a_relation(name: str) -> bool:
    """Whether a name is that of a parameter of law or stress: `law.n`."""
    kind, dot, _ = name.partition(".")
    return bool(dot) and kind in RELATIONS


def flat_changes(given: Mapping[str, Any]) -> dict[str, Any]:
    """Names and values, where a file has tables such as `cue` within its section."""
    flat: dict[str, Any] = {}
    for name, found in given.items():
        table = name in (*RELATIONS, "cue") and isinstance(found, Mapping)
        flat |= {f"{name}.{own}": value for own, value in found.items()} if table else {name: found}
    return flat


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """The tables that `flat_changes` reads."""
    nested: dict[str, Any] = {}
    for name, found in flat.items():
        table, dot, own = name.partition(".")
        nested |= {table: nested.get(table, {}) | {own: found}} if dot else {name: found}
    return nested


def _points(kind: str, points: Iterable[Any], *, earliest_allowed: bool) -> Points:
    """Pairs of numbers in the order of time. Raises InvalidInput."""
    sign = ">= 0" if earliest_allowed else "> 0"
    problem = InvalidInput(
        f"{kind} must have pairs (time, value) of finite numbers, with times {sign} that increase, "
        f"got {points!r}"
    )
    try:
        pairs = [(t, value) for t, value in points]
    except (TypeError, ValueError):
        raise problem from None
    plain = all(isinstance(x, Real) and not isinstance(x, bool) for pair in pairs for x in pair)
    if not (pairs and plain):
        raise problem
    checked = tuple((float(t), float(value)) for t, value in pairs)
    times = [t for t, _ in checked]
    ordered = all(a < b for a, b in pairwise(times))
    first_fits = times[0] > 0 or (earliest_allowed and times[0] == 0)
    if not (ordered and first_fits and all(math.isfinite(x) for pair in checked for x in pair)):
        raise problem
    return checked


def _shown(points: Points) -> str:
    shown = [f"({t:g}, {value:g})" for t, value in points]
    if len(shown) > 8:
        shown = [*shown[:6], "...", shown[-1]]
    return f"({', '.join(shown)})"


def _name(f: Any) -> str:
    return str(getattr(f, "__name__", type(f).__name__))
