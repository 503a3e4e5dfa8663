"""Time integration of stiff autonomous systems y' = f(y) with an exact Jacobian.

RODAS, a linearly implicit (Rosenbrock) method of order 4 with an embedded one of order 3, L-stable
and stiffly accurate: six linear solves with one factorization a step, no nonlinear iteration, and
a steady state of f is a steady state of the steps at any step length. Coefficients: Hairer &
Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. 1996, section VI.4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput

GAMMA = 0.25
STAGES = (
    (),
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950),
)
COUPLINGS = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (
        8.083246795921522,
        -7.981132988064893,
        -31.52159432874371,
        16.31930543123136,
        -6.058818238834054,
    ),
)


@dataclass(frozen=True)
class Step:
    """The solution y (n,) at time t, the step that led there and its estimated error.

    `error` is in units of the tolerance; `rejected` counts the trials before it.
    """

    t: float
    y: Array
    step: float
    error: float
    rejected: int


@dataclass(frozen=True)
class Control:
    """Error control: the error of a step is kept below tolerance * (scale + |y|).

    `scale` is a number or an array (n,); steps stay between `min_step` and `max_step`.
    """

    tolerance: float = 1e-6
    scale: Any = 1.0
    first_step: float = 1e-3
    min_step: float = 1e-12
    max_step: float = np.inf

    def __post_init__(self) -> None:
        for name in ("tolerance", "first_step", "min_step", "max_step"):
            if not getattr(self, name) > 0:
                raise InvalidInput(f"{name} must be > 0, got {getattr(self, name)!r}")


class StepTooSmall(Exception):
    """The error cannot be kept below the tolerance with steps of at least `min_step`."""


def rodas_step(
    rate: Callable[[Array], Array], jacobian: Array, y: Array, f: Array, step: float
) -> tuple[Array, Array]:
    """(y after one step, estimate of its error), given f = rate(y)."""
    inverse = np.linalg.inv(np.eye(y.size) / (GAMMA * step) - jacobian)
    k: list[Array] = []
    stage = y
    for i, couplings in enumerate(COUPLINGS):
        if i < len(STAGES):
            stage = y + sum((a * kj for a, kj in zip(STAGES[i], k, strict=True)), np.zeros_like(y))
        else:
            stage = stage + k[-1]
        value = f if i == 0 else rate(stage)
        history = sum((c * kj for c, kj in zip(couplings, k, strict=True)), np.zeros_like(y))
        k.append(inverse @ (value + history / step))
    return stage + k[-1], k[-1]


def integrate(
    rate: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    y: Array,
    control: Control,
    t: float = 0.0,
    end: float = np.inf,
) -> Iterator[Step]:
    """Steps from (t, y) to `end`, each accepted by the error control.

    A rate that raises InvalidInput or is not finite counts as a step too long. Raises StepTooSmall.
    """
    step = control.first_step
    while t < end * (1 - 1e-14):
        f, matrix = rate(y), jacobian(y)
        rejected = 0
        while True:
            step = min(step, control.max_step, end - t)
            new, error = _trial(rate, matrix, y, f, step, control)
            factor = float(np.clip(0.9 * max(error, 1e-10) ** -0.25, 0.2, 5.0))
            if error <= 1.0:
                break
            rejected += 1
            step *= min(factor, 0.5)
            if step < control.min_step:
                raise StepTooSmall(
                    f"the step fell below min_step = {control.min_step:g} at t = {t:.6g}; "
                    "start from a smoother state or allow a larger tolerance"
                )
        t, y = t + step, new
        yield Step(t, y, step, error, rejected)
        step *= factor if rejected == 0 else min(factor, 1.0)


def _trial(
    rate: Callable[[Array], Array],
    matrix: Array,
    y: Array,
    f: Array,
    step: float,
    control: Control,
) -> tuple[Array, float]:
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            new, difference = rodas_step(rate, matrix, y, f, step)
    except (InvalidInput, np.linalg.LinAlgError):
        return y, np.inf
    size = control.scale + np.maximum(np.abs(y), np.abs(new))
    error = float(np.sqrt(np.mean((difference / (control.tolerance * size)) ** 2)))
    return new, error if np.isfinite(error) else np.inf
