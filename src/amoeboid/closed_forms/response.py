"""Linear response of the homogeneous sphere to a cue v_p(c) (1 + strength cos(theta)).

Below threshold the sphere is stable, and a weak cue polarizes it in proportion to its strength.
Derived in docs/theory.md.
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
