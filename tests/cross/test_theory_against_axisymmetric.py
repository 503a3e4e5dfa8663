"""Weakly nonlinear theory against the exact steady states, near the threshold and far from it."""

import numpy as np

from amoeboid.parameters import Parameters
from amoeboid.theory.branch import prediction
from amoeboid.theory.linear import critical_speed
from cross.spectral import polarized


def relative_error(p):
    speed = float(prediction(p).max_retrograde_speed)
    return abs(speed / polarized(p).max_retrograde_speed - 1)


def test_the_error_estimate_far_from_threshold_is_not_smaller_than_the_error():
    """Where cubic and next order cross by chance the estimate must not shrink."""
    estimates = []
    for v_p0 in (3.8, 4.5, 5.6, 7.0):
        p = Parameters(v_p0=v_p0)
        estimates.append(float(prediction(p).relative_error))
        error = relative_error(p)
        print(f"v_p0 = {v_p0}: error {error:.3f}, estimate {estimates[-1]:.3f}")
        assert error < 1.1 * estimates[-1]
    assert np.all(np.diff(estimates) > -0.05)


def test_the_theory_becomes_exact_at_the_threshold():
    """At high pressure, on a rigid sphere, the error is proportional to the distance."""
    p = Parameters(delta_P=1e6)
    distances = np.array([4e-3, 2e-3])
    errors = [relative_error(p.replace(v_p0=float(critical_speed(p)) + d)) for d in distances]
    assert errors[1] < 0.03
    assert 1.7 < errors[0] / errors[1] < 2.3
