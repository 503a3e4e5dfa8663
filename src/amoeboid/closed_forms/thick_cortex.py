"""A cortex of finite thickness, exactly: 3D Stokes flow in a cylinder wall and in a ball's shell.

R0 - h < r < R0; the outer face moves inwards with v_p, the inner face is free of traction, and the
stress is that of a compressible viscous fluid (SI `eq3DStress`). lambda_3d is the first
Lame-type coefficient: the bulk viscosity is lambda_3d + 2 mu_3d/3, not lambda_3d. Values of a
cortex and r broadcast.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput


@dataclass(frozen=True, kw_only=True)
class Cortex:
    """Arrays that broadcast: R0, h [L], lambda_3d, mu_3d [M/(L T)], v_p [L/T].

    Raises InvalidInput unless 0 < h < R0, mu_3d > 0 and lambda_3d + 2 mu_3d/3 >= 0.
    """

    R0: ArrayLike
    h: ArrayLike
    lambda_3d: ArrayLike
    mu_3d: ArrayLike
    v_p: ArrayLike = 1.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = np.asarray(getattr(self, name))
            if value.dtype.kind not in "iuf" or not np.all(np.isfinite(value)):
                raise InvalidInput(f"{name} must be finite numbers, got {getattr(self, name)!r}")
            object.__setattr__(self, name, value.astype(float))
        R0, h, lam, mu, _ = (np.asarray(getattr(self, name)) for name in self.__dataclass_fields__)
        _require(h > 0, "h must be > 0", h)
        _require(h < R0, "h must be < R0 (the cortex must fit into the cell)", h)
        _require(mu > 0, "mu_3d must be > 0", mu)
        _require(3 * lam + 2 * mu >= 0, "lambda_3d must be >= -2 mu_3d/3", lam)


@dataclass(frozen=True, kw_only=True)
class Stresses:
    """Normal stresses, or their integrals over the thickness: radial, hoop and axial.

    On the ball the two tangential stresses are equal.
    """

    radial: Array
    hoop: Array
    axial: Array


_StressesOf = Callable[[Cortex], Stresses]


@dataclass(frozen=True)
class _Solution:
    """v_r = A r + B/r^(dimension - 1), with dimension 2 (cylinder) or 3 (ball)."""

    A: Array
    B: Array
    inner: Array


def surface_viscosities(cortex: Cortex) -> tuple[Array, Array]:
    """(eta_s, eta_b) of the thin shell [M/T]; SI `eq2DViscosities3D`."""
    _, h, lam, mu, _ = _numbers(cortex)
    return h * mu, 2 * h * lam * mu / (lam + 2 * mu)


def cylinder_velocity(cortex: Cortex, r: ArrayLike) -> Array:
    """v_r(r) in the wall of the cylinder [L/T], of the shape of r [L]; SI `eqvR`."""
    s = _cylinder(cortex)
    return s.A * _inside(cortex, r) + s.B / np.asarray(r)


def sphere_velocity(cortex: Cortex, r: ArrayLike) -> Array:
    """v_r(r) in the shell of the ball [L/T], for r [L]; behind SI `eqViscositiesSphere`."""
    s = _sphere(cortex)
    return s.A * _inside(cortex, r) + s.B / np.asarray(r) ** 2


def cylinder_stresses(cortex: Cortex, r: ArrayLike) -> Stresses:
    """3D stresses at r [M/(L T^2)]; SI `eq3DStress` with `eqvR`."""
    _, _, lam, mu, _ = _numbers(cortex)
    s, r = _cylinder(cortex), _inside(cortex, r)
    uniform, varying = 2 * (lam + mu) * s.A, 2 * mu * s.B / r**2
    axial = 2 * lam * s.A + 0 * r
    return Stresses(radial=uniform - varying, hoop=uniform + varying, axial=axial)


def sphere_stresses(cortex: Cortex, r: ArrayLike) -> Stresses:
    """3D stresses at r in the shell of the ball [M/(L T^2)]."""
    _, _, lam, mu, _ = _numbers(cortex)
    s, r = _sphere(cortex), _inside(cortex, r)
    uniform, varying = (3 * lam + 2 * mu) * s.A, 2 * mu * s.B / r**3
    tangential = uniform + varying
    return Stresses(radial=uniform - 2 * varying, hoop=tangential, axial=tangential)


def cylinder_surface_stresses(cortex: Cortex) -> Stresses:
    """Their integrals over r [M/T^2], exact; SI `eqStressesIntegrated`."""
    R0, h, lam, mu, _ = _numbers(cortex)
    s = _cylinder(cortex)
    uniform, varying = 2 * (lam + mu) * s.A * h, 2 * mu * s.B * h / (s.inner * R0)
    return Stresses(radial=uniform - varying, hoop=uniform + varying, axial=2 * lam * s.A * h)


def sphere_surface_stresses(cortex: Cortex) -> Stresses:
    """The same for the ball: plain integrals over r, not weighted with the area [M/T^2]."""
    R0, h, lam, mu, _ = _numbers(cortex)
    s = _sphere(cortex)
    uniform = (3 * lam + 2 * mu) * s.A * h
    varying = mu * s.B * h * (s.inner + R0) / (s.inner * R0) ** 2
    tangential = uniform + varying
    return Stresses(radial=uniform - 2 * varying, hoop=tangential, axial=tangential)


def thin_cylinder_stresses(cortex: Cortex) -> Stresses:
    """The thin shell's active stresses on the cylinder [M/T^2]; `eqSurfaceStressesThinShell`."""
    R0, *_, v_p = _numbers(cortex)
    eta_s, eta_b = surface_viscosities(cortex)
    hoop, axial = -v_p * (eta_b + 2 * eta_s) / R0, -v_p * eta_b / R0
    return Stresses(radial=np.zeros_like(hoop), hoop=hoop, axial=axial)


def thin_sphere_stresses(cortex: Cortex) -> Stresses:
    """The thin shell's active stresses on the sphere, -2 v_p (eta_s + eta_b)/R0 [M/T^2]."""
    R0, *_, v_p = _numbers(cortex)
    tangential = -2 * v_p * sum(surface_viscosities(cortex)) / R0
    return Stresses(radial=np.zeros_like(tangential), hoop=tangential, axial=tangential)


def thin_cylinder_error(cortex: Cortex) -> Array:
    """Relative error of the thin shell's hoop stress on the cylinder [1]; does not depend on v_p.

    -(3 lambda + 2 mu)/(2 (lambda + 2 mu)) h/R0 to first order: the thin shell is too weak.
    """
    return _error(thin_cylinder_stresses, cylinder_surface_stresses, cortex)


def thin_sphere_error(cortex: Cortex) -> Array:
    """The same on the sphere; -(5 lambda + 2 mu)/(2 (lambda + 2 mu)) h/R0 to first order [1]."""
    return _error(thin_sphere_stresses, sphere_surface_stresses, cortex)


def _error(thin: _StressesOf, exact: _StressesOf, cortex: Cortex) -> Array:
    unit = Cortex(R0=cortex.R0, h=cortex.h, lambda_3d=cortex.lambda_3d, mu_3d=cortex.mu_3d)
    return thin(unit).hoop / exact(unit).hoop - 1


def _cylinder(cortex: Cortex) -> _Solution:
    R0, h, lam, mu, v_p = _numbers(cortex)
    inner = R0 - h
    scale = -v_p * R0 / ((lam + mu) * inner**2 + mu * R0**2)
    return _Solution(scale * mu, scale * (lam + mu) * inner**2, inner)


def _sphere(cortex: Cortex) -> _Solution:
    R0, h, lam, mu, v_p = _numbers(cortex)
    inner = R0 - h
    stiff = (3 * lam + 2 * mu) * inner**3
    scale = -v_p * R0**2 / (4 * mu * R0**3 + stiff)
    return _Solution(scale * 4 * mu, scale * stiff, inner)


def _numbers(cortex: Cortex) -> tuple[Array, Array, Array, Array, Array]:
    R0, h, lam, mu, v_p = (np.asarray(getattr(cortex, n)) for n in cortex.__dataclass_fields__)
    return R0, h, lam, mu, v_p


def _inside(cortex: Cortex, r: ArrayLike) -> Array:
    R0, h, *_ = _numbers(cortex)
    r = np.asarray(r, dtype=float)
    # The edges themselves are allowed to be off by rounding.
    slack = 1e-12 * R0
    _require((r >= R0 - h - slack) & (r <= R0 + slack), "r must lie in R0 - h <= r <= R0", r)
    return r


def _require(good: Array, rule: str, value: Array) -> None:
    if not np.all(good):
        where = np.broadcast_to(value, np.shape(good))[~np.asarray(good)]
        raise InvalidInput(f"{rule}, got {where.flat[0]:.6g}")
