"""The model with one velocity: treadmilling as an active surface stress.

With v_c = v - v_p n the viscous stress of v_c is exactly that of v plus sigma_active, on any shape.
Tensors are (..., 3, 3) with (grad v)_ij = d_i v_j along the surface, vectors (..., 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput


@dataclass(frozen=True, kw_only=True)
class Meridian:
    """A surface of revolution at some points: its radius r > 0 and derivatives along any parameter.

    The parameter runs from the pole at the top of the axis (z largest) to the one at the bottom.
    """

    r: ArrayLike
    r_x: ArrayLike
    z_x: ArrayLike
    r_xx: ArrayLike
    z_xx: ArrayLike


def strain_tensor(gradient: ArrayLike, normal: ArrayLike) -> Array:
    """E = grad_s v . I_s + I_s . (grad_s v)^T [1/T], tangential, of any velocity (..., 3, 3).

    `gradient` (..., 3, 3) is grad_s v [1/T], `normal` (..., 3) the outward unit normal; SI
    `metric`, text before it.
    """
    P = _projector(normal)
    tangential = P @ np.asarray(gradient) @ P
    return tangential + np.swapaxes(tangential, -1, -2)


def viscous_stress(
    gradient: ArrayLike, normal: ArrayLike, eta_s: ArrayLike, eta_b: ArrayLike
) -> Array:
    """Viscous surface stress of a velocity field (..., 3, 3) [M/T^2]; SI `passive`.

    `gradient` (..., 3, 3) is its surface gradient [1/T], `normal` (..., 3) the outward unit normal;
    eta_s and eta_b [M/T] broadcast.
    """
    E = strain_tensor(gradient, normal)
    dilatation = np.trace(E, axis1=-2, axis2=-1) / 2
    return _scalar(eta_b * dilatation) * _projector(normal) + _scalar(eta_s) * E


def active_stress(
    curvature: ArrayLike,
    normal: ArrayLike,
    v_p: ArrayLike,
    eta_s: ArrayLike,
    eta_b: ArrayLike,
) -> Array:
    """sigma_active = -v_p (eta_b H I_s + 2 eta_s grad_s n) (..., 3, 3) [M/T^2]; SI `activestress3`.

    `curvature` (..., 3, 3) is grad_s n [1/L], whose eigenvalues are the principal curvatures (1/R0
    on a sphere), `normal` (..., 3) the outward unit normal.
    """
    curvature = np.asarray(curvature, dtype=float)
    curvature_sum = np.trace(curvature, axis1=-2, axis2=-1)
    v_p, eta_s, eta_b = (np.asarray(a, dtype=float) for a in (v_p, eta_s, eta_b))
    bulk = _scalar(eta_b * curvature_sum) * _projector(normal)
    return -_scalar(v_p) * (bulk + 2 * _scalar(eta_s) * curvature)


def single_velocity_stress(
    gradient: ArrayLike,
    curvature: ArrayLike,
    normal: ArrayLike,
    v_p: ArrayLike,
    eta_s: ArrayLike,
    eta_b: ArrayLike,
) -> Array:
    """The stress in terms of the full velocity v (..., 3, 3) [M/T^2]; SI `activestress`.

    Equal to `viscous_stress` of v_c = v - v_p n. Arguments as there and in `active_stress`:
    `gradient` is grad_s v, `curvature` grad_s n, `normal` n; v_p [L/T], eta_s and eta_b [M/T]
    broadcast.
    """
    passive = viscous_stress(gradient, normal, eta_s, eta_b)
    return passive + active_stress(curvature, normal, v_p, eta_s, eta_b)


def principal_curvatures(meridian: Meridian) -> tuple[Array, Array]:
    """Curvatures along the meridian and along the parallel [1/L], positive on a sphere.

    Each of the shape of the meridian's points; SI `activestress3`. Raises InvalidInput where r <= 0
    (at the poles both curvatures are that of the meridian).
    """
    r, r_x, z_x, r_xx, z_xx = (
        np.asarray(getattr(meridian, name), dtype=float) for name in meridian.__dataclass_fields__
    )
    if np.any(r <= 0):
        raise InvalidInput(f"r must be > 0 (leave out the poles), got {r.min():.6g}")
    stretch = np.hypot(r_x, z_x)
    if np.any(stretch == 0):
        raise InvalidInput(
            "r_x and z_x must not both be 0: the parameter must move along the curve"
        )
    along = (r_xx * z_x - r_x * z_xx) / stretch**3
    return along, -z_x / (r * stretch)


def principal_active_stresses(
    meridian: Meridian, v_p: ArrayLike, eta_s: ArrayLike, eta_b: ArrayLike
) -> tuple[Array, Array]:
    """sigma_active of a surface of revolution: along the meridian, along the parallel [M/T^2].

    Each of the shape of the meridian's points, which v_p [L/T], eta_s and eta_b [M/T] broadcast
    with. SI `activestress3`.
    """
    curvatures = principal_curvatures(meridian)
    v_p, eta_s, eta_b = (np.asarray(a, dtype=float) for a in (v_p, eta_s, eta_b))
    bulk = eta_b * sum(curvatures)
    along, around = (-v_p * (bulk + 2 * eta_s * kappa) for kappa in curvatures)
    return along, around


def _projector(normal: ArrayLike) -> Array:
    n = np.asarray(normal, dtype=float)
    return np.eye(3) - n[..., :, None] * n[..., None, :]


def _scalar(a: ArrayLike) -> Array:
    return np.asarray(a, dtype=float)[..., None, None]
