"""Folds as regular solutions of an extended system, so that they can be found and followed.

Moore & Spence, SIAM J. Numer. Anal. 17, 567 (1980): F(x, q) = 0, F_x phi = 0, <l, phi> = 1 for
(x, phi, q_1); second derivatives come from complex steps through the exact Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.branch_points import COMPLEX_STEP, System, parameter_derivative


@dataclass(frozen=True)
class FoldSystem:
    """The folds of `system` in its first parameter, as a function of its other parameters.

    Unknowns (x, phi, q_1); `normal` (n,) is the functional l and `parameter_scale` the magnitude of
    q_1. Itself a `System`.
    """

    system: System
    normal: Array
    parameter_scale: float

    @cached_property
    def scale(self) -> Array:
        """Magnitudes of (x, phi, q_1)."""
        s = self.system.scale
        return np.concatenate([s, s, [self.parameter_scale]])

    @cached_property
    def weights(self) -> Array:
        """Inner product of x and q_1 only: phi follows from them."""
        weights = self.system.weights
        return np.concatenate([weights, 0.0 * weights, [self.parameter_scale**-2]])

    def residual(self, x: Array, q: Array) -> Array:
        """(F, F_x phi, <l, phi> - 1)."""
        state, phi, full = self._parts(x, q)
        f, f_x = self.system.residual_and_jacobian(state, full)
        return np.concatenate([f, f_x @ phi, [self.normal @ phi - 1.0]])

    def residual_and_jacobian(self, x: Array, q: Array) -> tuple[Array, Array]:
        """Residual and its derivative to (x, phi, q_1), at real arguments."""
        state, phi, full = self._parts(x, q)
        n = state.size
        f, f_x = self.system.residual_and_jacobian(state, full)
        moved = self.system.residual_and_jacobian(state + 1j * COMPLEX_STEP * phi, full)[1]
        shifted = full.astype(complex)
        shifted[0] += 1j * COMPLEX_STEP
        turned = self.system.residual_and_jacobian(state, shifted)[1]
        matrix = np.zeros((2 * n + 1, 2 * n + 1))
        matrix[:n, :n] = matrix[n : 2 * n, n : 2 * n] = f_x
        matrix[:n, 2 * n] = parameter_derivative(self.system, state, full)
        matrix[n : 2 * n, :n] = moved.imag / COMPLEX_STEP
        matrix[n : 2 * n, 2 * n] = (turned.imag / COMPLEX_STEP) @ phi
        matrix[2 * n, n : 2 * n] = self.normal
        return np.concatenate([f, f_x @ phi, [self.normal @ phi - 1.0]]), matrix

    def resolved(self, x: Array, q: Array) -> bool:
        """Whether the solution at the fold is resolved."""
        state, _, full = self._parts(x, q)
        return self.system.resolved(state, full)

    def refined(self, x: Array, q: Array) -> FoldSystem | None:
        """The folds of the refined system."""
        state, _, full = self._parts(x, q)
        finer = self.system.refined(state, full)
        if finer is None:
            return None
        normal = self.system.prolonged(self.normal, finer)
        return FoldSystem(finer, normal, self.parameter_scale)

    def prolonged(self, x: Array, finer: FoldSystem) -> Array:
        """(x, phi, q_1) carried to the refined system."""
        n = self.normal.size
        state, phi = (self.system.prolonged(part, finer.system) for part in (x[:n], x[n : 2 * n]))
        return np.concatenate([state, phi, x[2 * n :]])

    def _parts(self, x: Array, q: Array) -> tuple[Array, Array, Array]:
        n = self.normal.size
        return x[:n], x[n : 2 * n], np.concatenate([x[2 * n :], q])


def fold_system(
    system: System, x: Array, null_vector: Array, parameter: float
) -> tuple[FoldSystem, Array]:
    """The folds of `system` near a solution x with its null vector, and where to start from.

    phi has the length 1 in units of `system.scale`, so that nothing depends on the units of x.
    """
    phi = null_vector / np.linalg.norm(null_vector / system.scale)
    folds = FoldSystem(system, phi / system.scale**2, abs(parameter) or 1.0)
    return folds, np.concatenate([x, phi, [parameter]])
