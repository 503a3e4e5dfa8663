"""An axisymmetric steady state is one of the 3D shell, up to the error of the mesh."""

import numpy as np
import pytest

import amoeboid as am
from amoeboid.config import Config, Time
from amoeboid.observables import observed
from amoeboid.simulation.loop import evolve, start

SOFT = am.Parameters(D=0.4, v_p0=6.0, delta_P=11.0)


def stayed(state, subdivisions, end):
    """Observables of a 3D run from the state, at its start and at `end`."""
    first = start(Config(parameters=state.parameters), state.as_initial(subdivisions))
    *_, last = evolve(first, Time(end=end))
    return [observed(step.cell) for step in (first, last)]


def test_a_state_on_a_mesh_has_its_shape_and_concentration():
    state = am.steady_states(SOFT, (1,)).fastest_stable
    cell = state.as_initial(3)
    assert cell.c.min() == pytest.approx(state.c_front, rel=1e-2)
    assert cell.c.max() == pytest.approx(state.c_rear, rel=1e-2)
    assert cell.r[np.argmax(cell.c), 2] > 0.9  # the rear lies at z > 0
    # nodes lie on the outline: distance from the axis as a function of z
    r, z = state.outline(2000)
    flipped = z if state.concentration(0.0) > state.concentration(np.pi) else -z
    order = np.argsort(flipped)
    expected = np.interp(cell.r[:, 2], flipped[order], r[order])
    np.testing.assert_allclose(np.hypot(cell.r[:, 0], cell.r[:, 1]), expected, atol=2e-4)
    with pytest.raises(am.InvalidInput, match="subdivisions"):
        state.as_initial("fine")


def test_a_stable_state_stays_on_a_mesh():
    """162 nodes: the mesh shifts the speed by 1.5 %, and its own steady state lies next to it."""
    state = am.steady_states(SOFT, (1,)).fastest_stable
    before, after = stayed(state, 2, 2.0)
    for name in ("max_retrograde_speed", "c_rear", "zeta0"):
        assert after[name] == pytest.approx(getattr(state, name), rel=0.04), name
        assert after[name] == pytest.approx(before[name], rel=0.04), name
