"""What polymerization and myosin do alone and together, and where inhibition ends the flow."""

import numpy as np
import pytest

import amoeboid as am
from amoeboid import figures
from amoeboid.closed_forms.linear import growth_rate
from amoeboid.figures import computed
from amoeboid.figures.gallery import extra_myosin as module
from amoeboid.figures.results import Results
from figures.drawn import drawn, lines


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


def made_up_branch(p, motor, start, end):
    """States that flow at a speed of 2 - share down to half of the motor, and unstable ones."""
    full = max(start, end)
    share = np.array([0.5, 0.75, 1.0, 1.0, 0.75])
    return {
        "points": {
            motor: (full * share).tolist(),
            "piece": [0, 0, 0, 1, 1],
            "kind": ["state"] * 5,
            "stable": [True, True, True, False, False],
            **dict.fromkeys(computed.SHOWN, (2.0 - share).tolist()),
        },
        "problems": [f"made up for {motor}"],
    }


def test_flow_of_the_drawing_ends_where_the_stable_branch_does(monkeypatch):
    monkeypatch.setattr(computed, "branch_points", made_up_branch)
    data = figures.extra_myosin.data(results=Results())
    assert len(data.problems) == 4
    share, flow = module.remaining(data, "both needed", "chi")
    np.testing.assert_allclose(share, [1.0, 0.75, 0.5, 0.5, 0.0])
    np.testing.assert_allclose(flow, [1.0, 1.25, 1.5, 0.0, 0.0])
    above, below = drawn(figures.extra_myosin, data)
    found = lines(below)
    x, y = found["both needed: less myosin"]
    np.testing.assert_allclose(x, [0.0, 25.0, 50.0, 50.0, 100.0])
    np.testing.assert_allclose(y, flow)
    assert len(found) == 4
    words = {text.get_text() for text in above.texts}
    assert {name for name, *_ in module.REGIONS} <= words
