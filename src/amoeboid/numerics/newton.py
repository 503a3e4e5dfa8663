"""Newton's method with a backtracking line search, its history kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput

Residual = Callable[[Array], Array]
Jacobian = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class NewtonResult:
    """Where Newton's method ended.

    `x` is a solution only if `converged`; `residuals` are the root-mean-square residuals at the
    start and after each step, `steps` the root-mean-square lengths of the steps.
    """

    x: Array
    converged: bool
    residuals: tuple[float, ...]
    steps: tuple[float, ...]


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
    (the error left is its square) and the residual after it below `residual_tolerance`.
    A residual that is not finite, or raises InvalidInput, counts as infinitely large; nothing is
    raised. Source: Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, chapter 3.
    """
    x = np.array(start, dtype=float)
    residuals = [_size(residual, x)[0]]
    steps: list[float] = []
    for _ in range(max_iterations):
        step = _newton_step(residual_and_jacobian, x)
        if step is None or not np.isfinite(residuals[-1]):
            break
        x, size, fraction = _backtracked(residual, x, step, residuals[-1])
        if fraction == 0.0:
            break
        residuals.append(size)
        steps.append(fraction * _rms(step / scale))
        if fraction == 1.0 and steps[-1] <= step_tolerance and size <= residual_tolerance:
            return NewtonResult(x, True, tuple(residuals), tuple(steps))
    return NewtonResult(x, False, tuple(residuals), tuple(steps))


def _newton_step(residual_and_jacobian: Jacobian, x: Array) -> Array | None:
    try:
        with np.errstate(all="ignore"):
            f, jacobian = residual_and_jacobian(x)
        if not (np.all(np.isfinite(jacobian)) and np.all(np.isfinite(f))):
            return None
        return solve(jacobian, -f)
    except (InvalidInput, LinAlgError):
        return None


def _backtracked(
    residual: Residual, x: Array, step: Array, before: float
) -> tuple[Array, float, float]:
    """The point after the largest of the fractions 1, 1/2, ... that does not harm."""
    fraction = 1.0
    rounding = 1e-9
    for _ in range(10):
        size, trial = _size(residual, x + fraction * step)
        if size <= max(2.0 * before if fraction == 1.0 else before, rounding):
            return trial, size, fraction
        fraction /= 2
    return x, before, 0.0


def _size(residual: Residual, x: Array) -> tuple[float, Array]:
    try:
        with np.errstate(all="ignore"):
            size = _rms(residual(x))
    except InvalidInput:
        return np.inf, x
    return (size if np.isfinite(size) else np.inf), x


def _rms(values: Array) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def solve(matrix: Array, right: Array) -> Array:
    """Solve a dense system; raises LinAlgError if the matrix is singular to working precision.

    NumPy's LAPACK: on matrices this small SciPy's threads cost more than they give.
    """
    return np.linalg.solve(matrix, right)
