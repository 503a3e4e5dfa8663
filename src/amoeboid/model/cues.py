"""Cues: what the polymerization speed depends on besides c, from outside the cell.

A cue is any object with `factor`; see `CueLike`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from numbers import Real
from typing import Any, Protocol

import numpy as np

from amoeboid.arrays import Array
from amoeboid.display import short_repr
from amoeboid.validation import InvalidInput, number, rows, validate, vector

POKE_WIDTH = 0.5
"""Angle [rad] over which a poke falls to exp(-1/2) of what it is in its direction."""

POKE_RULE = (
    "a list of [begin, duration, x, y, z, strength]: begin >= 0, duration > 0, a direction that is "
    "not zero and strength >= -1, in the order of begin"
)


class CueLike(Protocol):
    """What the polymerization speed depends on besides c: any object with this method.

    If it does not change in time it should say so by `until = -inf` (after a time: that time);
    without `until` a run never ends as steady.
    """

    def factor(self, directions: Array, t: float) -> Array:
        """Factor (V,) of v_p at unit vectors (V, 3) from the center of volume, axes of the lab."""


@dataclass(frozen=True, kw_only=True)
class Cue:
    """A cue along one direction, and pokes: v_p(c) (1 + strength cos(theta)) times those.

    theta is the angle between `direction` and r - r_cm, in the axes of the laboratory: nodes turn
    with the cell, the cue does not. A poke is local and passes: in a direction (x, y, z), from time
    `begin` on for a `duration` [T], it multiplies v_p by 1 + strength s(t) g(gamma). Here gamma is
    the angle to its direction, g = exp((cos(gamma) - 1)/POKE_WIDTH^2), and s rises smoothly from 0
    to 1 and falls back to 0, s = sin(pi (t - begin)/duration)^2. Any other object with a method
    `factor` is a cue as well.

    >>> Cue(strength=0.1).factor(np.array([[0.0, 0.0, -1.0]]), t=0.0)
    array([0.9])
    >>> Cue(pokes=[(1.0, 2.0, 0.0, 0.0, 1.0, 0.5)]).factor(np.array([[0.0, 0.0, 1.0]]), t=2.0)
    array([1.5])
    """

    __repr__ = short_repr

    strength: float = number(
        0.0,
        "strength of the cue, v_p(c) (1 + strength cos(theta)), theta the angle to cue.direction",
        ge=-1,
        le=1,
    )
    direction: tuple[float, float, float] = vector((0.0, 0.0, 1.0), "direction of the cue")
    pokes: tuple[tuple[float, ...], ...] = rows(
        "transient local cues: v_p is multiplied by 1 + strength near a direction",
        POKE_RULE,
        lambda found: _pokes(found),
        ("T", "T", "1", "1", "1", "1"),
    )

    def __post_init__(self) -> None:
        validate(self, "cue")

    @property
    def until(self) -> float:
        """The time after which it is constant [T]; -inf without pokes."""
        return max((begin + duration for begin, duration, *_ in self.pokes), default=-math.inf)

    @property
    def acts(self) -> bool:
        """Whether its factor is ever anything but 1."""
        return self.strength != 0.0 or bool(self.pokes)

    @property
    def axis(self) -> Array:
        """Unit vector (3,) along the direction [1]."""
        return np.array(self.direction) / np.linalg.norm(self.direction)

    def factor(self, directions: Array, t: float) -> Array:
        """The factor of v_p (V,) [1] at the unit vectors `directions` (V, 3) and the time t [T]."""
        found = np.asarray(1.0 + self.strength * (directions @ self.axis))
        for begin, duration, x, y, z, strength in self.pokes:
            if begin < t < begin + duration:
                towards = np.array([x, y, z]) / math.hypot(x, y, z)
                near = np.exp((directions @ towards - 1.0) / POKE_WIDTH**2)
                found = found * (
                    1.0 + strength * math.sin(math.pi * (t - begin) / duration) ** 2 * near
                )
        return found


def written_cue(cue: Any) -> dict[str, Any]:
    """What a TOML file holds of a cue. Raises InvalidInput for one that no file can hold."""
    if not isinstance(cue, Cue):
        raise InvalidInput(
            f"a cue that is written to a file must be a Cue, got {type(cue).__name__}, which "
            "exists only in Python; run it without a folder"
        )
    return asdict(cue)


def factor_of(cue: Any, directions: Array, t: float) -> Array:
    """The factor (V,) of a cue at unit vectors (V, 3).

    Raises InvalidInput unless it is a finite number for each of them.
    """
    try:
        found = np.asarray(cue.factor(directions, t), dtype=float)
    except Exception as error:  # a user's cue may raise anything
        raise InvalidInput(
            f"the factor of a cue must be a number for each direction, {type(cue).__name__} raised "
            f"{type(error).__name__}: {error}"
        ) from error
    if found.shape != (len(directions),) or not np.isfinite(found).all():
        raise InvalidInput(
            f"the factor of a cue must be one finite number for each of the {len(directions)} "
            f"directions, {type(cue).__name__} returned {str(found)[:60]} of shape {found.shape}"
        )
    return found


def _pokes(found: Any) -> tuple[tuple[float, ...], ...]:
    """Pokes as they are kept. Raises ValueError or TypeError for what is none."""
    pokes = tuple(tuple(float(x) for x in _numbers(row)) for row in found)
    for poke in pokes:
        begin, duration, x, y, z, strength = poke
        fits = begin >= 0 and duration > 0 and math.hypot(x, y, z) > 1e-150 and strength >= -1
        if not (all(map(math.isfinite, poke)) and fits):
            raise ValueError
    if list(pokes) != sorted(pokes, key=lambda poke: poke[0]):
        raise ValueError
    return pokes


def _numbers(row: Any) -> Any:
    if any(isinstance(x, bool) or not isinstance(x, Real) for x in row):
        raise TypeError
    return row
