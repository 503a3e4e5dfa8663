"""An axisymmetric state on the nodes of a mesh of the sphere."""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.steady import SteadySolution


def on_directions(state: SteadySolution, directions: Array) -> tuple[Array, Array]:
    """Positions r (V, 3) [L] and concentrations c (V,) [N/L^2] at unit vectors (V, 3).

    The polar angle of a direction becomes the scaled arclength along the meridian, so that an even
    mesh of the sphere stays as even as the shape allows. The rear, where c is high, lies at z > 0.
    """
    sine = np.hypot(directions[:, 0], directions[:, 1])
    angle = np.arctan2(sine, directions[:, 2])
    poles = state.concentration(np.array([0.0, np.pi]))
    mirrored = bool(poles[0] < poles[1])
    x = np.pi - angle if mirrored else angle
    distance, z = state.position(x)
    # at the poles themselves the ratio is 0/0, and both are 0
    stretch = np.divide(distance, sine, out=np.zeros_like(distance), where=sine > 0)
    r = np.column_stack([stretch * directions[:, 0], stretch * directions[:, 1], z])
    if mirrored:
        r[:, 2] *= -1.0
    return r, state.concentration(x)
