"""Contacts of a cell with walls: a patch of adhesion, two plates, a channel."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from amoeboid.arrays import Array
from amoeboid.motility.environments import FRICTION, SOFT, Environment, dimensional
from amoeboid.motility.surfaces import RIGID, Points, Surroundable
from amoeboid.validation import InvalidInput


@dataclass(frozen=True, repr=False)
class Contact(Environment):
    """Base of contacts with walls, which drag along the wall and hold the cell off it.

    `friction` [M/(L^2 T)]: a quantity such as "1 Pa s/um" for a cell with units, else a number.

    A cell in contact does not rotate but around the normal of the wall.
    """

    friction: Any = field(default=None, kw_only=True, metadata=dimensional(FRICTION, SOFT))

    def regions(self, surface: Surroundable) -> list[tuple[Points, Array]]:
        """Parts of the surface in contact, and the normals of the wall at their points (P, 3)."""
        raise NotImplementedError

    def dissipation(self, surface: Surroundable) -> Array:
        """Power taken up by the mean of all regions."""
        found = self.regions(surface)
        powers = [points.drag(self.friction, 0.0, walls) for points, walls in found]
        return np.asarray(np.mean(powers, axis=0))

    def free(self, surface: Surroundable) -> Array:
        """Translation along the axis of polarity."""
        return np.concatenate([surface.front, np.zeros(3)])[None, :]


@dataclass(frozen=True, repr=False)
class Patch(Contact):
    """A substrate to which the cell adheres with a cap of half-angle `half_angle` [degrees].

    The cap is around an `axis` (3,) from the center of the cell to the substrate, across the
    polarity; where it is left out, the mean over the substrates on all sides, along the polarity.
    Adhesion sites drag along the substrate in proportion to the velocity of the surface there.
    """

    half_angle: float = 30.0
    axis: Any = None
    name: ClassVar[str] = "patch"
    walls: ClassVar[tuple[float, ...]] = (1.0,)

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_angle(f"{self.name}.half_angle", self.half_angle, 90.0)
        if self.axis is not None:
            found = _three(self.axis)
            if found.size != 3 or not np.isfinite(found).all() or not np.any(found):
                raise InvalidInput(
                    f"{self.name}.axis must be three finite numbers, not all zero, got "
                    f"{self.axis!r}"
                )
            object.__setattr__(self, "axis", tuple(float(x) for x in found))

    def _wall(self, surface: Surroundable) -> Array | None:
        if self.axis is None:
            return None
        axis = np.array(self.axis)
        across = axis - (axis @ surface.front) * surface.front
        size = float(np.linalg.norm(across))
        if size < 0.1 * float(np.linalg.norm(axis)):
            raise InvalidInput(
                f"{self.name}.axis must not be parallel to the polarity of the cell, "
                f"{surface.front} towards the front, got {self.axis}"
            )
        return np.asarray(across / size)

    def regions(self, surface: Surroundable) -> list[tuple[Points, Array]]:
        """The caps, with the normals of the substrate."""
        wall, angle = self._wall(surface), math.radians(self.half_angle)
        found: list[tuple[Points, Array]] = []
        for side in self.walls:
            found += surface.cap(angle, None if wall is None else side * wall)
        return found

    def free(self, surface: Surroundable) -> Array:
        """Translation along the substrate, and rotation around its normal."""
        wall = self._wall(surface)
        if wall is None:
            return super().free(surface)
        along = np.stack([surface.front, np.cross(wall, surface.front)])
        motions = np.zeros((3, RIGID))
        motions[:2, :3], motions[2, 3:] = along, wall
        return motions


@dataclass(frozen=True, repr=False)
class Plates(Patch):
    """Two parallel plates, to each of which the cell adheres with a cap; see `Patch`."""

    name: ClassVar[str] = "plates"
    walls: ClassVar[tuple[float, ...]] = (1.0, -1.0)


@dataclass(frozen=True, repr=False)
class Channel(Contact):
    """A round channel along the polarity, in contact within `half_width` [degrees] of the equator.

    Directions are seen from the center of volume; the equator lies across the polarity.
    """

    half_width: float = 30.0
    name: ClassVar[str] = "channel"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_angle("channel.half_width", self.half_width, 90.0)

    def regions(self, surface: Surroundable) -> list[tuple[Points, Array]]:
        """The ring of contact, with the normals of the channel."""
        points = surface.band(math.radians(self.half_width))
        across = points.x - (points.x @ surface.front)[:, None] * surface.front
        return [(points, across / np.linalg.norm(across, axis=1)[:, None])]

    def free(self, surface: Surroundable) -> Array:
        """Translation along the channel, and rotation around it."""
        motions = np.zeros((2, RIGID))
        motions[0, :3] = motions[1, 3:] = surface.front
        return motions


def _three(given: Any) -> Array:
    """Numbers of a vector, or none where they are no numbers."""
    try:
        return np.asarray(given, dtype=float).ravel()
    except (TypeError, ValueError):
        return np.zeros(0)


def _check_angle(label: str, angle: Any, highest: float) -> None:
    number = isinstance(angle, int | float | np.number) and not isinstance(angle, bool)
    if not number or not 0.0 < angle <= highest:
        raise InvalidInput(
            f"{label} must be > 0 and <= {highest:g} degrees, got {angle!r}; write patch:30"
        )
