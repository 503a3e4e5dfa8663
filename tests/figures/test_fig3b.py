"""Figure 3B: hysteresis between the fold and the threshold, from both starts of the paper."""

import numpy as np
import pytest

from amoeboid import Parameters, figures, steady_states
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures import computed
from amoeboid.figures.computed import ERRORS, error_of_fold

THRESHOLD, FOLD = 6.0256610770, 5.20959845  # closed form and axisymmetric; docs: numerics


@pytest.fixture(scope="module")
def data():
    return figures.fig3b.data()


def test_window_is_relative_to_fold_and_threshold():
    p = Parameters(D=0.4)
    window = computed.bistable_window(p, [FOLD])
    assert window.threshold == pytest.approx(THRESHOLD, rel=1e-9)
    assert window.low < 0.99 * FOLD < 1.03 * THRESHOLD < window.high
    for place in (FOLD, THRESHOLD):  # runs on both sides, half a percent from each other
        below = max(v for v in window.speeds if v < place)
        above = min(v for v in window.speeds if v > place)
        assert above - below < 0.005 * place
    doubled = computed.bistable_window(p.replace(c_r=2.0, c0=6.0, D=0.8, beta=2.0), [2 * FOLD])
    np.testing.assert_allclose(doubled.speeds, 2 * np.array(window.speeds), rtol=1e-12)


def test_window_without_a_fold_surrounds_the_threshold():
    window = computed.bistable_window(Parameters(), [])
    assert window.fold is None
    assert 0.8 * window.threshold < window.low < window.threshold < window.high
    assert len(window.speeds) >= 6


def test_both_starts_end_in_different_states_between_fold_and_threshold():
    """On 162 nodes; 1.45368 at v_p0 = 5.5 is that of the axisymmetric solver (README)."""
    p = Parameters(D=0.4, v_p0=5.5)
    weak, strong = (computed.steady_run(p, 2, share * p.c0) for share in (0.01, 1.0))
    assert weak["steady"]
    assert strong["steady"]
    assert not weak["polarized"]
    assert strong["max_retrograde_speed"] == pytest.approx(1.45368, rel=0.01)


def test_mesh_error_of_a_fold_is_the_one_of_the_speed_over_the_slope():
    rows = [
        {"max_retrograde_speed": 1.0, ERRORS[0]: 0.02},
        {"max_retrograde_speed": 1.4, ERRORS[0]: 0.01},
    ]
    assert error_of_fold([5.0, 5.2], rows) == pytest.approx(0.01)
    assert error_of_fold([5.0], rows[:1]) is None


def test_runs_at_rest_above_the_fold_are_told():
    window = computed.Window(6.0, 5.0, 4.5, 6.5, (4.9, 5.01, 5.1, 5.2, 5.4))
    rows = [{"polarized": False, "max_retrograde_speed": 0.0, ERRORS[0]: 0.0}] * 3
    rows += [{"polarized": True, "max_retrograde_speed": s, ERRORS[0]: 0.1} for s in (1.0, 2.0)]
    (note,) = computed.lost(Parameters(), window, rows)  # error of the fold: 0.1 0.2/1 = 0.02
    assert "at v_p0 = 5.1000, runs from the strong start end at rest" in note
    polarized = [rows[3] | {"max_retrograde_speed": s} for s in (1.0, 1.2, 1.4, 1.6)]
    assert computed.lost(Parameters(), window, [rows[0], *polarized]) == []


@pytest.mark.slow
def test_runs_jump_at_the_fold_and_at_the_threshold_within_the_mesh_error(data):
    speeds = data["runs-weak"]["v_p0"]
    for start, place in (("weak", THRESHOLD), ("strong", FOLD)):
        runs = data[f"runs-{start}"]
        assert np.all(runs["steady"])
        polarized = runs["polarized"]
        assert np.array_equal(polarized, np.sort(polarized))  # one jump
        k = int(np.argmax(polarized))
        if start == "weak":
            error = float(runs[ERRORS[1]][k - 1])
        else:
            rows = [
                {key: None if np.isnan(runs[key][j]) else runs[key][j]
                 for key in ("max_retrograde_speed", ERRORS[0])}
                for j in range(k, len(speeds))
            ]  # fmt: skip
            error = error_of_fold(speeds[k:].tolist(), rows)
        assert error < 0.003 * place
        assert speeds[k - 1] - error < place < speeds[k] + error
        assert speeds[k] - speeds[k - 1] < 0.005 * place
    assert any("mesh error" in note for note in data.notes)


@pytest.mark.slow
def test_polarized_runs_lie_on_the_branch_within_the_mesh_error(data):
    """Nearer to the fold than the coarser mesh has the state no error is stated."""
    runs, p = data["runs-strong"], data.parameters
    checked = 0
    for v, speed, error in zip(
        runs["v_p0"], runs["max_retrograde_speed"], runs[ERRORS[0]], strict=True
    ):
        if speed > 0.5 and np.isfinite(error):
            exact = steady_states(p.replace(v_p0=v)).fastest_stable.number("max_retrograde_speed")
            assert abs(speed - exact) < error, v
            checked += 1
    assert checked >= 7


@pytest.mark.slow
def test_theory_meets_the_unstable_branch_at_the_threshold(data):
    """The slope at the onset: a cubic theory within 5 % at a flow of a tenth of the fold's."""
    branch, theory = data["branch"], data["theory"]
    found = (branch["v_p0"] > 0.995 * THRESHOLD) & (branch["v_p0"] < THRESHOLD)
    found &= branch["max_retrograde_speed"] < 0.2
    line = np.interp(branch["v_p0"][found], theory["v_p0"], theory["at_delta_P"])
    assert found.sum() >= 1
    np.testing.assert_allclose(line, branch["max_retrograde_speed"][found], rtol=0.1)
    assert float(critical_speed(data.parameters)) == pytest.approx(THRESHOLD)
