"""Whether the sphere polarizes continuously or by a jump, from the steady branch itself.

Near its origin the polarized branch is v_p0 = threshold + k a^2, a the amplitude of cos(x) in c:
supercritical for k > 0, subcritical (hysteresis) for k < 0. At delta_P -> infinity
k = -nu/(d lambda_1/d v_p0); here delta_P and the shape are whatever they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from amoeboid.axisymmetric.onset import departure, onset_speed
from amoeboid.axisymmetric.unknowns import split
from amoeboid.numerics.continuation import Options, at_distance
from amoeboid.parameters import Parameters
from amoeboid.validation import InvalidInput

DISTANCE = 0.06


def criticality(p: Parameters) -> float | None:
    """k = d(v_p0)/d(a^2) at the origin of the polarized branch; None if there is no threshold.

    Extrapolated from two small amplitudes; its relative error is about 1e-5. Raises InvalidInput
    if the branch cannot be entered.
    """
    threshold = onset_speed(p)
    if threshold is None:
        return None
    options = Options(parameter_scale=threshold)
    start = departure(p, "v_p0", threshold, options)
    squares, slopes = [], []
    for distance in (DISTANCE, 1.5 * DISTANCE, 2 * DISTANCE):
        point = at_distance(start, distance, options)
        if point is None:
            raise InvalidInput(f"no branch leaves the sphere at v_p0 = {threshold:.10g}")
        square = float(split(point.x, (point.x.size - 3) // 3)[2][1] ** 2)
        squares.append(square)
        slopes.append((point.parameter - threshold) / square)
    return float(np.polyfit(squares, slopes, 2)[-1])


def critical_values(p: Parameters, name: str, values: Sequence[float]) -> tuple[float, ...]:
    """Values of the parameter `name` within the ascending `values` where k changes sign."""

    def k(value: float) -> float | None:
        return criticality(p.replace(**{name: float(value)}))

    found = [(v, k(v)) for v in values]
    known = [(v, f) for v, f in found if f is not None]
    return tuple(_root(k, a, b) for (a, f), (b, g) in pairwise(known) if f * g < 0)


def _root(function: Callable[[float], float | None], a: float, b: float) -> float:
    return float(brentq(lambda v: function(v) or 0.0, a, b, xtol=1e-9 * max(abs(a), abs(b))))
