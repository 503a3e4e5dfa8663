"""A cell as its surroundings feel it: the ways in which its surface can move, and integrals.

The surface moves in nine ways at once: six rigid motions, whose speeds the surroundings decide, and
three that the cell gives, in the frame in which its shape rests,

    0-2  translation along x, y, z with unit speed
    3-5  rotation around x, y, z through the center of volume with unit angular velocity
    6    the tangential flow u of the full velocity
    7    its normal part: none for a steady cell
    8    the flow of the cortex, the full velocity without that of polymerization

What surroundings do to the cell is the matrix (9, 9) of the power that they take up: D[i, j] is the
power of the force that way i meets, at the velocity of way j. `Surroundings` hold the rest.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array

RIGID = 6
TANGENTIAL, NORMAL, CORTEX = 6, 7, 8
WAYS = 9
MIN_POLARITY = 1e-6  # below it a cell has no front


@dataclass(frozen=True, eq=False, repr=False)
class Points:
    """Points of a surface, or of a part of it, with weights: sums over them are integrals.

    `x` (Q, 3) relative to the center of volume [L], `normals` (Q, 3) outward, `weights` (Q,) areas
    [L^2], `c` (Q,) concentration of filaments [N/L^2], 1 where none is known, `ways` (9, Q, 3).
    """

    x: Array
    normals: Array
    weights: Array
    c: Array
    ways: Array

    def __repr__(self) -> str:
        return f"Points({len(self.weights)} points, area {self.weights.sum():.6g})"

    def drag(self, tangential: ArrayLike, normal: ArrayLike, about: Array | None = None) -> Array:
        """The matrix (9, 9) of a drag that acts on each point by itself.

        `tangential` and `normal`: drag per area and velocity [M/(L^2 T)], numbers or (Q,), along
        the surface and along its normals; or along a wall and its normals `about` (Q, 3) or (3,).
        """
        n = self.normals if about is None else np.broadcast_to(about, self.x.shape)
        along = np.einsum("kqi,qi->kq", self.ways, n)
        across = self.ways - along[..., None] * n
        weights_t = self.weights * tangential
        weights_n = self.weights * normal
        return np.asarray(
            np.einsum("kqi,lqi,q->kl", across, across, weights_t, optimize=True)
            + np.einsum("kq,lq,q->kl", along, along, weights_n, optimize=True)
        )


class Surroundable(Protocol):
    """The surface of a cell, whose surroundings are to be given."""

    @property
    def everywhere(self) -> Points:
        """Points of the whole surface."""

    @property
    def front(self) -> Array:
        """Unit vector (3,) from the center of volume to the front."""

    @property
    def has_cortex(self) -> bool:
        """Whether the flow of the cortex is known."""

    @property
    def has_concentration(self) -> bool:
        """Whether the concentration of filaments is known."""

    @property
    def mesh_error(self) -> float:
        """Estimate of the relative error by the points of the surface."""

    @property
    def fluid(self) -> Array:
        """The matrix (9, 9) of a fluid of viscosity 1 that is at rest far away.

        Row and column of the cortex are zero.
        """

    @property
    def fluid_error(self) -> Array:
        """Difference (6, 2) between two ways to compute the force of that fluid on the flow.

        It is that of the tangential flow and of the normal motion.
        """

    def cap(self, half_angle: float, axis: Array | None) -> list[tuple[Points, Array]]:
        """Points within an angle [rad] of an axis (3,) across the polarity, with that axis.

        Angles are seen from the center. Without an axis such caps on all sides, the mean of which
        counts.
        """

    def band(self, half_width: float) -> Points:
        """Points within an angle [rad] of the equator, seen from the center of volume."""


class SurfaceInFluid(ABC):
    """What is known of the drag of a surface in a fluid; a part of `Surroundable`."""

    @property
    @abstractmethod
    def drag(self) -> tuple[Array, Array]:
        """The matrix (9, 9) of a fluid of viscosity 1, and `fluid_error` (6, 2).

        That is the difference of the couplings to the flow by the reciprocal theorem and directly.
        """

    @property
    def fluid(self) -> Array:
        """See `Surroundable`."""
        return self.drag[0]

    @property
    def fluid_error(self) -> Array:
        """See `Surroundable`."""
        return self.drag[1]


def front_of(polarization: Array) -> Array | None:
    """Unit vector to the front, None for a cell that has none."""
    size = float(np.linalg.norm(polarization))
    return -polarization / size if size > MIN_POLARITY else None


def ways_of(x: Array, u: Array, normal: Array, cortex: Array) -> Array:
    """The nine ways (9, Q, 3) at points x (Q, 3) with the three that the cell gives."""
    found = np.empty((WAYS, len(x), 3))
    for d, axis in enumerate(np.eye(3)):
        found[d] = axis
        found[3 + d] = np.cross(axis, x)
    found[TANGENTIAL], found[NORMAL], found[CORTEX] = u, normal, cortex
    return found
