"""The motion of a cell without force and torque, and what it costs.

With D the power of `surfaces`, U the six rigid speeds and s the motions that the cell gives itself,
force and torque are -(D_UU U + D_Us s). They vanish along all motions that the surroundings leave
free, which gives U. For a fluid this is the reciprocal theorem (Stone and Samuel, Phys. Rev. Lett.
77, 4102, 1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array
from amoeboid.motility.environments import Environment
from amoeboid.motility.surfaces import (
    CORTEX,
    NORMAL,
    RIGID,
    TANGENTIAL,
    WAYS,
    Surroundable,
)
from amoeboid.validation import InvalidInput

# Rigid motions that meet less drag than this share of the largest, in units of the size of the
# cell, are not resisted: nothing decides them.
MIN_DRAG = 1e-10
# Less power than this share of what towing the cell at the speed of its flow takes is rounding.
MIN_POWER = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class Motion:
    """A cell in an environment, in plain numbers and the axes of its surface.

    `velocity` (3,) of the center of volume [L/T], `angular_velocity` (3,) [1/T], `resistance`
    (6, 6) of translations and rotations about that center, `power` that the surroundings take up
    [M L^2/T^3], `towing` power that would move the cell without its flow at this velocity, `front`
    (3,). `error`: estimate of the error of `velocity` by the method [L/T].
    """

    velocity: Array
    angular_velocity: Array
    resistance: Array
    power: float
    towing: float
    front: Array
    error: float

    def __repr__(self) -> str:
        return f"Motion(speed = {self.speed:.6g}, power = {self.power:.6g})"

    @property
    def speed(self) -> float:
        """Velocity towards the front [L/T]; negative for a cell that goes backwards."""
        return float(self.velocity @ self.front)

    @property
    def efficiency(self) -> float:
        """Towing power over power; infinite if the flow slips nowhere, 0 for a cell that rests."""
        if self.power > 0.0:
            return self.towing / self.power
        return np.inf if self.towing > 0.0 else 0.0


def motion(surface: Surroundable, environment: Environment) -> Motion:
    """The motion of a surface in an environment whose quantities are numbers.

    Raises InvalidInput where nothing resists it.
    """
    power, free = joint(environment.parts, surface)
    own = power[RIGID:, RIGID:].sum()
    coupling = power[:RIGID, RIGID:].sum(axis=1)
    resistance = power[:RIGID, :RIGID]
    size = float(np.sqrt(surface.everywhere.weights.sum() / (4.0 * np.pi)))
    units = np.repeat([1.0, 1.0 / size], 3)
    scaled = free * units  # motions of comparable speeds at the surface
    drags, ways = np.linalg.eigh(scaled @ resistance @ scaled.T)
    if not drags.size or not drags[-1] > 0.0:
        raise InvalidInput(
            "an environment must resist the motion of the cell, this one does not; give it a "
            "drag, or combine it with another"
        )
    kept = drags > MIN_DRAG * drags[-1]
    basis = ways[:, kept].T @ scaled

    def answer(couplings: Array) -> Array:
        return np.asarray(-basis.T @ ((basis @ couplings) / drags[kept]))

    speeds = answer(coupling)
    taken = float(own + 2.0 * coupling @ speeds + speeds @ resistance @ speeds)
    towing = float(speeds @ resistance @ speeds)
    least = MIN_POWER * drags[-1] * _mean_square(surface)
    taken, towing = (power if power > least else 0.0 for power in (taken, towing))
    differences = np.sum([part.uncertainty(surface) for part in environment.parts], axis=0)
    error = float(np.linalg.norm(answer(differences)[:3]))
    error += surface.mesh_error * float(np.linalg.norm(speeds[:3]))
    return Motion(speeds[:3], speeds[3:], resistance, taken, towing, surface.front, error)


def _mean_square(surface: Surroundable) -> float:
    """Mean over the surface of the squares of all velocities that the cell gives itself."""
    points = surface.everywhere
    squares = np.einsum("kqi,kqi->q", points.ways[RIGID:], points.ways[RIGID:])
    return float(points.weights @ squares / points.weights.sum())


def joint(parts: tuple[Environment, ...], surface: Surroundable) -> tuple[Array, Array]:
    """Power (9, 9) that environments take up together, with their shares in it, and free motions.

    The last three ways are scaled by what each of them feels.
    """
    power, held = np.zeros((WAYS, WAYS)), []
    for part in parts:
        felt = np.ones(WAYS)
        felt[[TANGENTIAL, NORMAL, CORTEX]] = part.felt(surface)
        found = np.asarray(part.dissipation(surface), dtype=float)
        if found.shape != (WAYS, WAYS) or not np.isfinite(found).all():
            raise InvalidInput(
                f"the dissipation of an environment must be a matrix ({WAYS}, {WAYS}) of finite "
                f"numbers, {type(part).__name__} returned shape {found.shape}"
            )
        power += felt[:, None] * found * felt
        free = part.free(surface)
        held.append(np.eye(RIGID) - free.T @ free)
    sizes, motions = np.linalg.eigh(np.sum(held, axis=0))
    return power, motions[:, sizes < 1e-9].T
