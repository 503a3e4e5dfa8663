"""Where the bifurcation changes from supercritical to subcritical: nu = 0 in the (c0, D) plane.

The theory behind figure 3C of the paper: docs/theory.md. All arguments broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.amplitude import cubic_coefficient_at_speed, second_harmonic
from amoeboid.closed_forms.linear import (
    MAX_THRESHOLDS,
    critical_slope,
    flow_response,
    growth_rate,
    mode_derivatives,
    thresholds,
)
from amoeboid.closed_forms.points import AnyPoints, Points, points
from amoeboid.closed_forms.roots import roots_about
from amoeboid.validation import InvalidInput


@dataclass(frozen=True)
class PhaseBoundary:
    """Points (c0, D, v_p0) with lambda_1 = nu = 0, shape (n,) each, in the order of c0.

    A c0 may carry none or several. reason: why the curve is empty, otherwise empty itself.
    """

    c0: Array
    D: Array
    v_p0: Array
    reason: str


def phase_boundary(p: AnyPoints, c0: ArrayLike) -> PhaseBoundary:
    """All D > 0 at which nu = 0 at the threshold, for each c0, at delta_P of p.

    Main text figure 3C is `phase_boundary(infinite_pressure(p), c0)`. For any law, viscosity ratio
    and isotropic stress; D and v_p0 of p are not used. On the curve lambda_1 = 0 gives D as a
    function of v_p0, so nu = 0 is one equation in v_p0. Raises InvalidInput for c0 <= 0.
    """
    base = points(p)
    values = np.atleast_1d(points(base, c0=c0).c0)
    if np.any(values <= 0):
        raise InvalidInput(f"c0 must be > 0 on the phase boundary, got {values.min():.6g}")
    found = [(c, *pair) for c in values for pair in _crossings(points(base, c0=c))]
    curve = np.reshape(np.array(found, dtype=float), (-1, 3))
    reason = "" if found else "nu has one sign for every D > 0 at these c0"
    return PhaseBoundary(curve[:, 0], curve[:, 1], curve[:, 2], reason)


def diffusion_at_threshold(p: Points, v_p0: ArrayLike) -> Array:
    """D at which lambda_1 = 0 at this v_p0 [L^2/T]; negative where there is none."""
    w1 = mode_derivatives(p.at_speed(v_p0), 1, 1)[1]
    return -p.R0 * (p.c0 * flow_response(p, 1) * w1 + p.beta * p.R0 / 2)


def _crossings(p: Points) -> list[tuple[float, float]]:
    """Pairs (D, v_p0) with lambda_1 = nu = 0 at one c0."""
    still = points(p, D=1e-12 * (p.R0**2 * p.beta or 1.0))
    start = thresholds(still)
    if start.reason and not growth_rate(still.at_speed(0.0), 1) > 0:
        return []
    # where the stress alone polarizes at small D: the speed that would do so without it
    scale = start.v_p0[0] if start.v_p0.size else abs(critical_slope(still)) * p.c_r

    def numerator(v: Array) -> Array:
        # nu without its pole, where harmonic 2 is neutral; D < 0 is no model and gives no root.
        D = diffusion_at_threshold(p, v)
        allowed = D > 0
        at = points(p, D=np.where(allowed, D, 1.0)).at_speed(v)
        nu, rate = cubic_coefficient_at_speed(at), second_harmonic(at).rate_at_rest
        return np.where(allowed, nu * rate, np.nan)

    roots = islice(roots_about(numerator, float(scale)), MAX_THRESHOLDS)
    return [(float(diffusion_at_threshold(p, v)), v) for v in roots]
