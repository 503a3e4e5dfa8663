"""Newton's method with a backtracking line search, its history kept.

Where it converges fast, a Jacobian serves for several steps (the simplified method). Source:
Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, chapters 2 and 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput

Residual = Callable[[Array], Array]
Jacobian = Callable[[Array], tuple[Array, Array]]


SHORTER = 0.1
"""Ratio of successive steps, with the same Jacobian, from which on the residual may grow."""
KEPT = 0.02
"""Ratio of successive steps up to which the next one is taken with the same Jacobian.

Such a step costs a fifth of one with a new Jacobian.
"""
LEFT = 3e-15
"""Error in units of `scale` that may be left by a step with an old Jacobian: rounding."""


@dataclass(frozen=True)
class NewtonResult:
    """Where Newton's method ended.

    `x` is a solution only if `converged`; `residuals` are the root-mean-square residuals at the
    start and after each step, `steps` the root-mean-square lengths of the steps. After the last
    step the residual is not known where an old Jacobian tells that nothing but rounding is left.
    `jacobian` is the last one, at x or near it; None if there was none that could be factorized.
    """

    x: Array
    converged: bool
    residuals: tuple[float, ...]
    steps: tuple[float, ...]
    jacobian: Factor | None = None


def newton(
    residual: Residual,
    residual_and_jacobian: Jacobian,
    start: Array,
    *,
    scale: Array | float = 1.0,
    step_tolerance: float = 1e-9,
    residual_tolerance: float = 1e-7,
    max_iterations: int = 25,
) -> NewtonResult:
    """Solve residual(x) = 0 from `start`.

    Converged means that the last step, measured in units of `scale`, was below `step_tolerance`
    and the residual after it below `residual_tolerance`. The error left is the square of that step,
    or below `LEFT` where the Jacobian was that of an earlier point.
    A residual that is not finite, or raises InvalidInput, counts as infinitely large; nothing is
    raised.
    """
    x = np.array(start, dtype=float)
    residuals: list[float] = []
    steps: list[float] = []
    jacobian: Factor | None = None
    step = f = x
    for _ in range(max_iterations):
        f, size, jacobian = _factorized(residual_and_jacobian, x)
        residuals = residuals or [size]
        if jacobian is None:
            break
        step, fresh = jacobian.solve(-f), True
        while True:
            x, f, size, fraction = _backtracked(
                residual, jacobian, scale, x, f, step, residuals[-1]
            )
            if fraction == 0.0:
                break
            residuals.append(size)
            steps.append(fraction * _rms(step / scale))
            small = fraction == 1.0 and size <= residual_tolerance
            if small and fresh and steps[-1] <= step_tolerance:
                return NewtonResult(x, True, tuple(residuals), tuple(steps), jacobian)
            step = jacobian.solve(-f)
            following = _rms(step / scale)
            ratio = following / steps[-1] if steps[-1] > 0 else np.inf
            if small and following <= step_tolerance and ratio * following <= LEFT:
                steps.append(following)
                return NewtonResult(x + step, True, tuple(residuals), tuple(steps), jacobian)
            if fraction < 1.0 or ratio > KEPT:
                break
            fresh = False
        if fraction == 0.0 and fresh:
            break
    return NewtonResult(x, False, tuple(residuals), tuple(steps), jacobian)


@dataclass(frozen=True)
class Factor:
    """LU factors of a matrix, of its transpose in fact: that needs no copy."""

    lu: Array
    pivots: Array

    def solve(self, right: Array) -> Array:
        """Solve the system of the matrix."""
        return np.asarray(dgetrs(self.lu, self.pivots, right, trans=1)[0])


def _factorized(residual_and_jacobian: Jacobian, x: Array) -> tuple[Array, float, Factor | None]:
    """The residual, its size, and the factors of the Jacobian.

    Without factors if anything is not finite, or the Jacobian singular to working precision.
    """
    try:
        with np.errstate(all="ignore"):
            f, jacobian = residual_and_jacobian(x)
            size = _rms(f)
    except InvalidInput:
        return np.full(x.shape, np.inf), np.inf, None
    if not (np.isfinite(size) and np.isfinite(np.sum(jacobian))):
        return f, size if np.isfinite(size) else np.inf, None
    lu, pivots, info = dgetrf(jacobian.T)
    return f, size, Factor(lu, pivots) if info == 0 else None


def _backtracked(
    residual: Residual,
    jacobian: Factor,
    scale: Array | float,
    x: Array,
    f: Array,
    step: Array,
    before: float,
) -> tuple[Array, Array, float, float]:
    """The point after the largest of the fractions 1, 1/2, ... that does not harm.

    With its residual and the size of that, and the fraction; 0 if there is none. The whole step
    does not harm either if the next one with the same Jacobian is much shorter, whatever the
    residual (Deuflhard's natural test, which does not depend on how the equations are scaled).
    """
    fraction = 1.0
    rounding = 1e-9
    for _ in range(10):
        trial = x + fraction * step
        there, size = _evaluated(residual, trial)
        if size <= max(2.0 * before if fraction == 1.0 else before, rounding):
            return trial, there, size, fraction
        if fraction == 1.0 and np.isfinite(size):
            with np.errstate(all="ignore"):
                following = _rms(jacobian.solve(there) / scale)  # infinite far from a solution
            if following <= SHORTER * _rms(step / scale):
                return trial, there, size, fraction
        fraction /= 2
    return x, f, before, 0.0


def _evaluated(residual: Residual, x: Array) -> tuple[Array, float]:
    """The residual and its size, infinite where there is none."""
    try:
        with np.errstate(all="ignore"):
            f = residual(x)
            size = _rms(f)
    except InvalidInput:
        return np.full(x.shape, np.inf), np.inf
    return f, (size if np.isfinite(size) else np.inf)


def _rms(values: Array) -> float:
    return math.sqrt(float(values @ values) / values.size)


def solve(matrix: Array, right: Array) -> Array:
    """Solve a dense system; raises LinAlgError if the matrix is singular to working precision.

    NumPy's LAPACK: on matrices this small SciPy's threads cost more than they give.
    """
    return np.linalg.solve(matrix, right)
