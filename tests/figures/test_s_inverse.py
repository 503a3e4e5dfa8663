"""Both polymerization laws in one plot."""

import numpy as np
import pytest

from amoeboid import figures
from amoeboid.figures.results import Results
from figures.drawn import drawn, lines


@pytest.fixture(scope="module")
def data():
    return figures.s_inverse.data(results=Results())


def test_thresholds_are_those_of_both_formulas(data):
    """Main text `vpc` and SI `vpc_inv`: 0.53 e^3/3 and 3 * 0.53."""
    assert data["threshold-exponential"]["v_p0"][0] == pytest.approx(0.53 * np.exp(3.0) / 3.0)
    assert data["threshold-inverse"]["v_p0"][0] == pytest.approx(1.59)


def test_line_of_the_inverse_law_is_the_printed_one(data):
    """SI `eq_vMig_inv` with `eq_non_linear_coefficient_inv`, evaluated here."""
    theory = data["theory-inverse"]
    v, D, c0 = theory["v_p0"], 0.03, 3.0
    nu = 2 * (2 * D + 1) * (14 * D - 3) / (5 * c0**2 * (18 * D + 1))
    assert nu < 0
    above = v > 1.59
    expected = 1.59 / c0**2 * np.sqrt(2 * (v[above] - 1.59) / (-c0 * nu))
    shown = theory["at_infinite_pressure_prefactor_at_threshold"]
    np.testing.assert_allclose(shown[above], expected, rtol=1e-6)
    assert np.all(np.isnan(shown[~above]))


@pytest.mark.parametrize("law", ["exponential", "inverse"])
def test_branch_starts_as_the_theory_says(data, law):
    """The first states, with a flow below 0.1: cubic theory within 10 %, and all are stable."""
    branch, theory = data[f"branch-{law}"], data[f"theory-{law}"]
    first = branch["max_retrograde_speed"] < 0.1
    assert first.any()
    line = np.interp(
        branch["v_p0"][first],
        theory["v_p0"],
        np.nan_to_num(theory["at_delta_P_prefactor_at_threshold"]),
    )
    np.testing.assert_allclose(line, branch["max_retrograde_speed"][first], rtol=0.1)
    assert np.all(branch["stable"])


def test_window_is_the_same_share_of_both_thresholds(data):
    for law in ("exponential", "inverse"):
        shares = data[f"theory-{law}"]["v_p0"][[0, -1]] / data[f"threshold-{law}"]["v_p0"]
        np.testing.assert_allclose(shares, [0.9, 1.25])


def test_drawing_shows_both_laws_from_their_thresholds_on(data):
    (axes,) = drawn(figures.s_inverse, data)
    found = lines(axes)
    for law in ("exponential", "inverse"):
        branch = data[f"branch-{law}"]
        np.testing.assert_array_equal(
            found[f"{law}, stable"], [branch["v_p0"], branch["max_retrograde_speed"]]
        )
    marks = [float(line.get_xdata()[0]) for line in axes.lines if line.get_marker() == "o"]
    thresholds = [data[f"threshold-{law}"]["v_p0"][0] for law in ("exponential", "inverse")]
    np.testing.assert_array_equal(marks, thresholds)
    first, last = axes.get_xlim()
    assert first < min(thresholds) < max(thresholds) < last
