"""Linear response to a cue."""

import numpy as np
import pytest

from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import points
from amoeboid.closed_forms.response import polarization_by_cue
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput


def test_response_at_the_point_of_the_table():
    """-2 c0 f_0/(R0 |lambda_1|), f_0 = 3 exp(-3), lambda_1 = 6 f_0 - 0.06 - 1."""
    f0 = 3 * np.exp(-3.0)
    found = polarization_by_cue(Parameters(v_p0=3.0), 1e-3)
    assert found == pytest.approx(-1e-3 * 6 * f0 / (1.06 - 6 * f0))
    assert found == pytest.approx(-5.470e-3, abs=5e-7)


def test_response_broadcasts_and_diverges_at_the_threshold():
    p = Parameters()
    threshold = float(critical_speed(p))
    distance = np.array([[1e-2], [1e-3], [1e-4]])
    found = polarization_by_cue(points(p, v_p0=threshold * (1 - distance)), np.array([0.1, 0.2]))
    assert found.shape == (3, 2)
    assert found[:, 1] == pytest.approx(2 * found[:, 0])
    assert (found * distance)[:, 0] == pytest.approx((found * distance)[-1, 0], rel=0.011)


def test_unstable_sphere_has_no_linear_response():
    with pytest.raises(
        InvalidInput, match=r"lambda_1 must be < 0 .* polarizes by itself; lower v_p0"
    ):
        polarization_by_cue(Parameters(), 0.1)
