"""Linear response of the homogeneous sphere: to a cue v_p(c) (1 + strength cos(theta)), to noise.

Below threshold the sphere is stable, and a weak cue polarizes it in proportion to its strength;
shot noise of the filaments maintains a fluctuating polarization. Derived in docs/theory.md. Results
have the shape that all arguments broadcast to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.linear import flow_response, growth_rate, push_share
from amoeboid.closed_forms.points import Points, finite_result
from amoeboid.validation import InvalidInput


@finite_result
def polarization_by_cue(p: Points, strength: ArrayLike) -> Array:
    """Amplitude a of c = c0 + a cos(theta) in the steady state under a weak cue [N/L^2].

    a = -(2 c0 strength v_p(c0)/R0)/|lambda_1|: filaments are swept away from where they grow
    faster, which becomes the front. Exact at any delta_P as strength -> 0; it holds while |a| is
    small against c0, so for ever weaker cues as lambda_1 -> 0. `strength` broadcasts with the
    parameters. Raises InvalidInput unless lambda_1 < 0: an unstable sphere polarizes by itself.

    >>> from amoeboid.model.parameters import Parameters
    >>> print(f"{polarization_by_cue(Parameters(v_p0=3.0), 0.01):.5f}")
    -0.05470
    """
    rate = growth_rate(p, 1)
    if np.any(rate >= 0):
        raise InvalidInput(
            "lambda_1 must be < 0 for a linear response to a cue, got "
            f"{float(np.max(rate)):.6g}: the sphere is unstable and polarizes by itself; lower v_p0"
        )
    (f0,) = p.v_p_derivatives(p.c0, 0)
    push = flow_response(p, 1) * (1 + push_share(p))  # 1 without friction
    return 2 * p.c0 * np.asarray(strength) * f0 * push / (p.R0 * rate)


@finite_result
def polarization_variance(p: Points) -> Array:
    """Variance of a polarization that shot noise keeps up below the threshold [N^2/L^4].

    Of each component of the vector a, c = c0 + a.n + ..., for filaments that appear, vanish and
    diffuse independently: 3 c0 (beta + 2 D/R0^2)/(4 pi R0^2 |lambda_1|). The coefficients of
    normalized spherical harmonics, c_1m with a = sqrt(3/(4 pi)) c_1, have 4 pi/3 times that. To
    leading order in the noise: it must be small against c0^2, and so 4 pi R0^2 c0 filaments many.
    Raises InvalidInput unless lambda_1 < 0.

    >>> from amoeboid.model.parameters import Parameters
    >>> print(f"{polarization_variance(Parameters(v_p0=3.0, c0=3e4, c_r=1e4)):.2f}")
    46338.05
    """
    rate = growth_rate(p, 1)
    if np.any(rate >= 0):
        raise InvalidInput(
            "lambda_1 must be < 0 for fluctuations about the sphere, got "
            f"{float(np.max(rate)):.6g}: it is unstable and polarizes by itself; lower v_p0"
        )
    noise = p.c0 * (p.beta + 2 * p.D / p.R0**2) / (4 * np.pi * p.R0**2)
    return 3 * noise / -rate
