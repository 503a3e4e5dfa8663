"""The laws of a cell with given parameters: polymerization, stress and friction."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.stress import (
    NoStress,
    isotropic_stress,
)


class Material:
    """Polymerization and isotropic stress of the cortex as functions of c, at some parameters.

    The parameters may be numbers, complex numbers, or arrays that broadcast.
    """

    law: Any
    stress: Any
    gamma_t: Any
    gamma_n: Any
    gamma_c: Any
    alpha: Any
    chi: Any
    c_r: Any
    v_p0: Any

    def v_p(self, c: ArrayLike) -> Array:
        """Polymerization speed [L/T] at concentration c [N/L^2]; main text `vp`.

        Of the shape that c and the parameters broadcast to.
        """
        return self.v_p_derivatives(c, 0)[0]

    def v_p_derivatives(self, c: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """(v_p, v_p', v_p'', ...) at c, to `order` [L/T over powers of N/L^2]."""
        return self.law.derivatives(c, self.v_p0, self.c_r, order)

    def tau(self, c: ArrayLike) -> Array:
        """Isotropic stress at concentration c, (chi - alpha) c and the active one [M/T^2].

        Of the shape that c [N/L^2] and the parameters broadcast to; `tau_derivatives` likewise.
        """
        return self.tau_derivatives(c, 0)[0]

    def tau_derivatives(self, c: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """(tau, tau', tau'', ...) at c, to `order` [M/T^2 over powers of N/L^2]."""
        return isotropic_stress(self.stress, c, self.chi - self.alpha, self.c_r, order)

    @property
    def has_isotropic_stress(self) -> bool:
        """Whether tau is anything but 0 for all c."""
        return self.alpha != self.chi or not isinstance(self.stress, NoStress)

    @property
    def has_friction(self) -> bool:
        """Whether the surroundings resist the motion of the cell; `forces.friction`."""
        return bool(self.gamma_t or self.gamma_n or self.gamma_c)

    @property
    def share_along(self) -> Any:
        """Friction along the surface in units of gamma_t + gamma_n + gamma_c; 1 without any."""
        total = self.gamma_t + self.gamma_n + self.gamma_c
        none = total == 0  # so that arrays will do, too
        return (self.gamma_t + self.gamma_c + none) / (total + none)

    @property
    def share_across(self) -> Any:
        """The same along the normal."""
        total = self.gamma_t + self.gamma_n + self.gamma_c
        none = total == 0
        return (self.gamma_n + self.gamma_c + none) / (total + none)
