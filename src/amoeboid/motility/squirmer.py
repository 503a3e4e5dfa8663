"""A flow as the modes of a squirmer, B_1, B_2, ... (Blake, J. Fluid Mech. 46, 199, 1971)."""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.motility.surfaces import TANGENTIAL, Surroundable

MODES = 5


def squirmer_modes(surface: Surroundable, count: int = MODES) -> Array:
    """B_1, ..., B_count of the tangential flow [L/T], by least squares over all directions.

    u_theta = sum B_l V_l, V_l = 2/(l (l + 1)) sin(theta) P_l'(cos theta), theta the angle from the
    front as seen from the center of volume. On a sphere in a fluid the speed is 2 B_1/3. Parts of
    the flow that are not axisymmetric about the front have no mode here.
    """
    points, front = surface.everywhere, surface.front
    distance = np.linalg.norm(points.x, axis=1)
    directions = points.x / distance[:, None]
    cos = directions @ front
    sin = np.sqrt(np.maximum(1.0 - cos**2, 0.0))
    away = cos[:, None] * directions - front  # sin(theta) times the unit vector of rising theta
    flow = np.einsum("qi,qi->q", points.ways[TANGENTIAL], away)
    outward = np.einsum("qi,qi->q", points.normals, directions)
    angles = np.maximum(points.weights * outward / distance**2, 0.0)
    basis = []
    for l in range(1, count + 1):  # noqa: E741
        series = np.polynomial.legendre.Legendre.basis(l).deriv()
        basis.append(2.0 / (l * (l + 1)) * sin**2 * series(cos))
    # both sides times sin(theta), which the weights take out again
    weights = np.sqrt(angles) / np.maximum(sin, 1e-12)
    found = np.linalg.lstsq((np.array(basis) * weights).T, flow * weights, rcond=None)[0]
    return np.asarray(found)
