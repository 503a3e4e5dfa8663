"""Backward differences of second order with steps of any length, and their error.

BDF2 (Hairer & Wanner, *Solving Ordinary Differential Equations II*, section V.1; steps may grow by
up to 1 + sqrt(2) at a time, E. Hairer, S. P. Norsett, G. Wanner, volume I, theorem III.5.5).
The iteration that solves the implicit equations starts from the extrapolated past, and the error is
estimated from it. Without iteration the step is linearly implicit, with one linear solve; for
evolving surfaces see B. Kovacs, B. Li, C. Lubich, Numer. Math. 143, 797 (2019).

Past times are given newest first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from amoeboid.arrays import Array


@dataclass(frozen=True)
class BackwardDifference:
    """The implicit step y(new) = sum_k past[k] y_k + dt y'(new); the weights `past` sum to 1."""

    past: tuple[float, ...]
    dt: float

    def combined(self, values: Sequence[Array]) -> Array:
        """The known part, sum_k past[k] values[k]."""
        known = self.past[0] * values[0]
        for weight, y in zip(self.past[1:], values[1:], strict=False):
            known = known + weight * y
        return known


def backward_difference(times: Sequence[float], new: float) -> BackwardDifference:
    """BDF2 from the last two times, BDF1 if there is only one."""
    h = new - times[0]
    if len(times) == 1:
        return BackwardDifference((1.0,), h)
    ratio = h / (times[0] - times[1])
    total = 1.0 + 2.0 * ratio
    return BackwardDifference(
        ((1 + ratio) ** 2 / total, -(ratio**2) / total), h * (1 + ratio) / total
    )


def extrapolated(times: Sequence[float], values: Sequence[Array], new: float) -> Array:
    """The polynomial through the given values (all of them) at time `new`."""
    result = 0.0 * values[0]
    for i, y in enumerate(values):
        weight = 1.0
        for j in range(len(values)):
            if j != i:
                weight *= (new - times[j]) / (times[i] - times[j])
        result = result + weight * y
    return result


def error_share(times: Sequence[float], new: float) -> float:
    """Local error of the step as a share of its distance from `extrapolated(times, ...)`.

    Both are multiples of the same derivative of y (W. E. Milne's device). With three past times the
    error is that of BDF2, with two that of BDF1.
    """
    h = new - times[0]
    back = [new - t for t in times]
    if len(times) == 2:
        error, prediction = 0.5 * h * h, 0.5 * h * back[1]
    else:
        error = h**2 * back[1] ** 2 / (6.0 * (h + back[1]))
        prediction = h * back[1] * back[2] / 6.0
    return float(error / (error + prediction))
