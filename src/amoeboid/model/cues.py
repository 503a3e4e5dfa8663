"""Cues: what the polymerization speed depends on besides c, from outside the cell.

A cue is any object with `factor`; see `CueLike`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput, number, validate, vector


class CueLike(Protocol):
    """What the polymerization speed depends on besides c: any object with this method.

    If it does not change in time it should say so by `until = -inf` (after a time: that time);
    without `until` a run never ends as steady.
    """

    def factor(self, directions: Array, t: float) -> Array:
        """Factor (V,) of v_p at unit vectors (V, 3) from the center of volume, axes of the lab."""


@dataclass(frozen=True, kw_only=True)
class Cue:
    """A cue along one direction: v_p(c) (1 + strength cos(theta)).

    theta is the angle between `direction` and r - r_cm, in the axes of the laboratory: nodes turn
    with the cell, the cue does not. Any other object with a method `factor` is a cue as well.

    >>> Cue(strength=0.1).factor(np.array([[0.0, 0.0, -1.0]]), t=0.0)
    array([0.9])
    """

    strength: float = number(
        0.0, "cue: v_p(c) (1 + strength cos(theta)), theta the angle to its direction", ge=-1, le=1
    )
    direction: tuple[float, float, float] = vector((0.0, 0.0, 1.0), "direction of the cue")
    until: ClassVar[float] = -math.inf

    def __post_init__(self) -> None:
        validate(self, "cue")

    @property
    def axis(self) -> Array:
        """Unit vector (3,) along the direction."""
        return np.array(self.direction) / np.linalg.norm(self.direction)

    def factor(self, directions: Array, t: float) -> Array:
        """1 + strength cos(theta), shape (V,), at unit vectors (V, 3)."""
        return np.asarray(1.0 + self.strength * (directions @ self.axis))


def written_cue(cue: Any) -> dict[str, Any]:
    """What a TOML file holds of a cue. Raises InvalidInput for one that no file can hold."""
    if not isinstance(cue, Cue):
        raise InvalidInput(
            f"a cue that is written to a file must be a Cue, {type(cue).__name__} is known to "
            "Python alone: run it without a folder"
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
            f"directions, {type(cue).__name__} gave {str(found)[:60]} of shape {found.shape}"
        )
    return found
