"""Whether the sphere polarizes continuously or by a jump, measured on the steady branch.

Near its origin the polarized branch is v_p0 = threshold + k a^2, a the amplitude of cos(x) in c:
supercritical for k > 0, subcritical (hysteresis) for k < 0. k = -nu/(d lambda_1/d v_p0) with the
closed form nu of amoeboid.closed_forms.amplitude at delta_P; `criticality` measures it on the
branch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np

from amoeboid.axisymmetric.onset import branch_tangent, onset_speed
from amoeboid.axisymmetric.unknowns import mode_count, split
from amoeboid.closed_forms.amplitude import at_threshold
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.bracketed import bracketed_root
from amoeboid.numerics.branch_points import Options, Point, at_distance
from amoeboid.validation import InvalidInput

DISTANCE = 0.06
HALVINGS = 8
AGREEMENT = 1e-4
"""Relative difference of two estimates, at a distance and at half of it, that is accepted."""


def criticality(p: Parameters) -> float | None:
    """k = d(v_p0)/d(a^2) at the origin of the polarized branch; None where it is unknown.

    Extrapolated from three small amplitudes, which are halved until two estimates agree to
    AGREEMENT. None without a threshold, and too close to a pole of k, where the thresholds of
    l = 1 and l = 2 meet. Raises InvalidInput where the sphere has no single neutral mode.
    """
    threshold = onset_speed(p)
    if threshold is None:
        return None
    options = Options(parameter_scale=threshold)
    start = branch_tangent(p, "v_p0", threshold, options)
    # k itself may vanish: below this size differences count absolutely
    small = 0.1 * threshold / p.c0**2
    previous: float | None = None
    for halving in range(HALVINGS + 1):
        k = _estimate(start, threshold, DISTANCE / 2**halving, options)
        if k is None:
            continue
        if previous is not None and abs(k - previous) <= AGREEMENT * max(abs(k), small):
            return k
        previous = k
    return None


def _estimate(start: Point, threshold: float, distance: float, options: Options) -> float | None:
    """k extrapolated from the branch at a distance, 1.5 and 2 times as far off."""
    squares, slopes = [], []
    for share in (1.0, 1.5, 2.0):
        point = at_distance(start, share * distance, options)
        if point is None:
            return None
        square = float(split(point.x, mode_count(point.x))[2][1] ** 2)
        if square == 0:
            return None
        squares.append(square)
        slopes.append((point.parameter - threshold) / square)
    return float(np.polyfit(squares, slopes, 2)[-1])


def critical_values(p: Parameters, name: str, values: Sequence[float]) -> tuple[float, ...]:
    """Values of the parameter `name` within the ascending `values` where k passes zero.

    The zeros of nu in closed form. Where it changes sign through a pole there is none; a zero and a
    pole between the same two neighbors hide each other.
    """

    def nu(value: float) -> float:
        return float(at_threshold(p.replace(**{name: float(value)})).nu)

    known = []
    for v in values:
        with suppress(InvalidInput):
            known.append((float(v), nu(v)))
    roots = (_root(nu, a, f, b, g) for (a, f), (b, g) in pairwise(known) if f * g < 0)
    return tuple(root for root in roots if root is not None)


def _root(
    function: Callable[[float], float], a: float, f: float, b: float, g: float
) -> float | None:
    """The zero of the function between a and b; None if it changes sign through a pole."""
    try:
        root = bracketed_root(function, a, b, xtol=1e-9 * max(abs(a), abs(b)))
        return root if abs(function(root)) <= min(abs(f), abs(g)) else None
    except InvalidInput:
        return None
