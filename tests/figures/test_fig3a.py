"""Figure 3A, and what the bifurcation diagrams share: 3D runs, mesh errors, theory, windows."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from amoeboid import Parameters, figures, growth_rate, steady_states
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures import computed
from amoeboid.figures.gallery import fig3a
from amoeboid.figures.results import Results
from amoeboid.model.natural_units import in_units
from amoeboid.model.units import Units

OTHER_UNITS = Units(length=2.0, time=0.5, mass=3.0, filaments=7.0)
COARSE = 2  # 162 nodes


@pytest.fixture(scope="module")
def data():
    return figures.fig3a.data()


def exact_speed(p):
    """Max retrograde speed of the axisymmetric solver, which shares no mesh with the 3D runs."""
    return steady_states(p).fastest_stable.number("max_retrograde_speed")


def test_theory_line_is_the_printed_one():
    """SI `lambda1`, `eq_non_linear_coefficient` and `eq_v0_epsilon`, evaluated here."""
    p = Parameters()
    v = np.array([3.56, 3.7, 3.9])
    # at eta = 1, c0 = 3: nu = 0 at D = 1/22 (docs/errata.md); the general nu as printed
    D, c, eta = p.D, p.c0, 1.0
    rate = 2 * (v * c * np.exp(-c) - D) - 1
    nu = (
        (2 * D + 1)
        * (2 * D * ((8 * eta + 5) * c**2 - (12 * eta + 8) * c - 2 * eta)
           + (3 * eta + 2) * c**2 - (10 * eta + 6) * c - 2 * eta)
        / (10 * c**2 * (6 * D * (2 * eta + 1) + eta))
    )  # fmt: skip
    expected = v * np.exp(-c) * np.sqrt(-rate / nu)
    table = computed.theory_table(p, v)
    np.testing.assert_allclose(table["at_infinite_pressure"], expected, rtol=1e-12)
    assert np.all(np.isnan(computed.theory_table(p, np.array([3.5]))["at_delta_P"]))


def test_mesh_error_of_the_threshold_bounds_how_far_the_mesh_shifts_it():
    p = Parameters(D=0.4)
    q = p.replace(v_p0=0.98 * float(critical_speed(p)))
    fine, coarse = (computed.steady_run(q, n, 0.0) for n in (COARSE, COARSE - 1))
    flow, error = computed.mesh_errors(q, fine, coarse)
    assert flow == fine["max_retrograde_speed"] > 0  # the exact sphere has none
    slope = (float(growth_rate(q, 1)) + p.beta + 2 * p.D) / q.v_p0  # lambda_1 is linear in v_p0
    shift = (float(growth_rate(q, 1)) - fine["growth_rate"]) / slope
    assert 0 < shift < error < 2 * shift


def test_run_near_the_threshold_is_steady_and_one_below_ends_at_rest():
    """The flow 2 % above is 0.19089 by the axisymmetric solver; the mesh makes it slower."""
    p = Parameters()
    threshold = float(critical_speed(p))
    above = computed.steady_run(p.replace(v_p0=1.02 * threshold), COARSE, 0.03)
    below = computed.steady_run(p.replace(v_p0=0.98 * threshold), COARSE, 0.03)
    assert above["steady"]
    assert below["steady"]
    assert above["polarized"]
    assert not below["polarized"]
    assert below["max_retrograde_speed"] < 1e-3
    assert 0.85 * 0.19089 < above["max_retrograde_speed"] < 0.19089


def test_state_that_the_coarser_mesh_does_not_have_has_no_mesh_error():
    row = {"polarized": True, "max_retrograde_speed": 1.0, "growth_rate": -1.0}
    at_rest = row | {"polarized": False}
    assert computed.mesh_errors(Parameters(), row, at_rest) == (None, None)
    half = row | {"max_retrograde_speed": 0.4}
    assert computed.mesh_errors(Parameters(), row, half) == (pytest.approx(0.25), None)


def test_run_that_is_not_steady_is_told_and_drawn_as_such():
    from matplotlib.figure import Figure

    from amoeboid.figures.drawing import draw_runs

    p = Parameters()
    row = dict.fromkeys(computed.SHOWN, 1.0) | dict.fromkeys(computed.ERRORS)
    row |= {"polarized": True, "steady": False, "t": 5.0, "ended": "end of time"}
    assert "not steady at t = 5: end of time" in computed.not_steady(p, [3.9], [row])[0]
    axes = Figure().subplots()
    table = computed.runs_table(p, "v_p0", [3.9], [row], COARSE)
    assert "on 162 nodes; mesh errors from runs on 42 nodes" in table.about
    draw_runs(axes, table, "3D")
    assert axes.get_legend_handles_labels()[1] == ["3D, not steady"]


def test_figure_is_the_same_in_other_units(monkeypatch):
    """With one run, below the threshold, on 162 nodes; the next test has a polarized one."""
    monkeypatch.setattr(fig3a, "SUBDIVISIONS", COARSE)
    monkeypatch.setattr(fig3a, "RUNS", (0.95,))
    one = fig3a.compute(Parameters(), Results())
    other = fig3a.compute(in_units(Parameters(), OTHER_UNITS), Results())
    speed = OTHER_UNITS.of("L/T")
    for key, name in (
        ("theory", "v_p0"),
        ("theory", "at_delta_P"),
        ("branch", "v_p0"),
        ("branch", "max_retrograde_speed"),
        ("threshold", "v_p0"),
        ("runs", "v_p0"),
    ):
        np.testing.assert_allclose(
            other[key][name] * speed, one[key][name], rtol=1e-5, atol=1e-8, err_msg=name
        )
    assert other["branch"].unit("v_p0") == "L/T"
    axes = Figure().add_subplot()
    fig3a.draw(one, axes)
    assert "3D, 162 nodes" in axes.get_legend_handles_labels()[1]  # those of the runs


@pytest.mark.slow
def test_run_is_the_same_in_other_units():
    p = Parameters(v_p0=3.8)
    one = computed.steady_run(p, COARSE, 0.03)
    start = 0.03 / OTHER_UNITS.of("N/L^2")
    other = computed.steady_run(in_units(p, OTHER_UNITS), COARSE, start)
    assert other["max_retrograde_speed"] * OTHER_UNITS.of("L/T") == pytest.approx(
        one["max_retrograde_speed"], rel=1e-5
    )
    assert other["t"] * OTHER_UNITS.of("T") == pytest.approx(one["t"], rel=1e-5)
    assert one["polarized"]
    assert other["polarized"]


@pytest.mark.slow
def test_crosses_lie_on_the_axisymmetric_branch_within_the_mesh_error(data):
    runs, p = data["runs"], data.parameters
    assert np.all(runs["steady"])
    assert not data.problems
    polarized = runs["polarized"]
    assert np.array_equal(polarized, runs["v_p0"] > critical_speed(p))
    for v, speed, error in zip(
        runs["v_p0"][polarized],
        runs["max_retrograde_speed"][polarized],
        runs["mesh_error_of_max_retrograde_speed"][polarized],
        strict=True,
    ):
        assert abs(speed - exact_speed(p.replace(v_p0=v))) < error < 0.03 * max(speed, 0.4), v


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.02, 1.09])
def test_finer_meshes_tend_to_the_branch_in_second_order(share):
    """642 and 2562 nodes, extrapolated: a tenth of the error of the finer mesh is left."""
    p = Parameters()
    q = p.replace(v_p0=share * float(critical_speed(p)))
    rough, fine = (computed.steady_run(q, n, 0.03)["max_retrograde_speed"] for n in (3, 4))
    exact = exact_speed(q)
    assert 3.0 < (rough - exact) / (fine - exact) < 5.0
    assert abs((4 * fine - rough) / 3 - exact) < 1e-3 * exact
