"""What polymerization and myosin do alone and together, and where inhibition ends the flow."""

import numpy as np
import pytest

import amoeboid as am
from amoeboid import figures
from amoeboid.closed_forms.linear import growth_rate
from amoeboid.figures.gallery import extra_myosin as module


def test_either_motor_polarizes_the_cell_alone_from_its_own_threshold_on():
    p = am.Parameters()
    speed, contractility = module.alone(p)
    assert contractility == pytest.approx(0.706667, abs=1e-6)
    for chi, v_p0 in ((0.0, speed), (contractility, 0.0), (0.3 * contractility, 0.7 * speed)):
        assert growth_rate(p.replace(chi=chi, v_p0=v_p0), 1) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_inhibition_of_a_motor_ends_the_flow_on_the_line():
    """The line is chi/chi_c + v_p0/v_p^c = 1: less of either at (0.8, 0.5) and (1.2, 0.3)."""
    data = figures.extra_myosin.data()
    line, alone = data["threshold"], data["alone"]
    total = line["v_p0"] / alone["v_p0"] + line["chi"] / alone["chi"]
    np.testing.assert_allclose(total, 1.0, rtol=1e-9)
    for name, motor, left in (
        ("both needed", "chi", 0.4),
        ("both needed", "v_p0", 0.625),
        ("polymerization enough", "v_p0", 0.7 / 1.2),
        ("polymerization enough", "chi", 0.0),
    ):
        share, flow = module.remaining(data, name, motor)
        assert np.all(np.diff(flow) <= 0)
        if left > 0:
            assert share[flow > 0].min() == pytest.approx(left, abs=2e-3)
            assert flow[-1] == 0.0
        else:
            assert flow[-1] > 0.5 * flow[0]
