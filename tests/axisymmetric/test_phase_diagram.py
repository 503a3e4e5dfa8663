"""Phase diagram: regions against single branches, edges against theory and direct continuation."""

from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from amoeboid.axisymmetric.branches import branch_from_sphere
from amoeboid.axisymmetric.criticality import critical_values, criticality
from amoeboid.axisymmetric.phase_diagram import (
    REGIONS,
    UNRESOLVED,
    diagram_of_columns,
    phase_column,
    phase_columns,
)
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import unstable_modes
from amoeboid.axisymmetric.window import Window
from amoeboid.closed_forms.linear import critical_pressure, critical_speed
from amoeboid.model.parameters import Parameters
from amoeboid.numerics import continuation
from amoeboid.numerics.branch_points import Options
from amoeboid.validation import InvalidInput


@pytest.fixture(scope="module")
def diagram():
    values, speeds = np.linspace(0.04, 0.4, 3), np.linspace(3.2, 6.2, 5)
    columns = tuple(phase_columns(Parameters(), "D", values, speeds))
    return diagram_of_columns(Parameters(), "D", values, speeds, columns)


def test_regions_are_what_the_states_at_each_point_say(diagram):
    for i, j in ((0, 0), (1, 0), (4, 1), (3, 2), (0, 2)):
        p = Parameters(D=float(diagram.values[j]), v_p0=float(diagram.speeds[i]))
        states = steady_solutions(p, degrees=(1,))
        stable = [not any(unstable_modes(s).values()) for s in states]
        word = {
            (True, False): "rest",
            (False, True): "polarized",
            (True, True): "bistable",
            (False, False): "neither stable",
        }[stable[0], len(states) > 1 and stable[-1]]
        assert REGIONS[diagram.regions[i, j]] == word
        flow = states[-1].max_retrograde_speed if word in ("polarized", "bistable") else 0.0
        assert diagram.flow[i, j] == pytest.approx(flow, rel=1e-8)
    assert {"rest", "polarized", "bistable"} == {REGIONS[k] for k in np.unique(diagram.regions)}


def test_the_threshold_column_by_column_is_that_of_the_theory(diagram):
    for column in diagram.columns:
        exact = float(critical_speed(Parameters(D=column.value)))
        assert column.threshold == pytest.approx(exact, rel=1e-11)


def test_the_fold_line_passes_through_the_folds_of_the_columns(diagram):
    line = np.array(diagram.fold_line)
    assert np.all(np.diff(line[:, 0]) > 0)
    inner = line[line[:, 0] > 0.1][3]
    direct = branch_from_sphere(
        Parameters(D=float(inner[0])), "v_p0", Window(0.0, 7.0), options=Options(max_step=0.05)
    )
    assert direct.folds[0].value == pytest.approx(inner[1], abs=1e-8)


def test_the_fold_line_ends_at_the_tip(diagram):
    ((D, v),) = diagram.tips
    assert v == pytest.approx(float(critical_speed(Parameters(D=D))), rel=1e-9)
    nearest = min(abs(point[0] - D) for point in diagram.fold_line)
    assert nearest < 0.02


@pytest.mark.slow
def test_the_tip_tends_to_the_boundary_of_the_theory_at_high_pressure():
    """nu = 0 at delta_P -> infinity, exponential law: D = 1/22 for c0 = 3, eta_s = eta_b."""
    c0, eta = 3.0, 1.0
    D = ((10 * eta + 6) * c0 + 2 * eta - (3 * eta + 2) * c0**2) / (
        2 * ((8 * eta + 5) * c0**2 - (12 * eta + 8) * c0 - 2 * eta)
    )
    tips = [
        critical_values(Parameters(delta_P=pressure), "D", [0.03, 0.06])[0]
        for pressure in (1e3, 4e3)
    ]
    extrapolated = np.polyfit(1 / np.array([1e3, 4e3]), tips, 1)[-1]
    assert extrapolated == pytest.approx(D, rel=1e-4)
    assert abs(tips[1] - D) < abs(tips[0] - D)


def test_criticality_has_the_sign_that_the_branches_show():
    assert criticality(Parameters(D=0.03)) > 0
    assert criticality(Parameters(D=0.4)) < 0
    assert criticality(Parameters(law="v_p0*(1 + c/c_r)")) is None


def test_criticality_near_its_pole_is_a_simple_pole():
    """At delta_P* of the theory the thresholds of l = 1 and 2 meet and k goes through infinity.

    k (delta_P - delta_P*) is smooth, so that values on either side predict those nearer by.
    """
    pole = float(critical_pressure(Parameters()))
    known = np.array([0.7, 0.8, 1.0, 1.1]) - pole
    residues = [criticality(Parameters(delta_P=pole + d)) * d for d in known]
    fit = np.polyfit(known, residues, 3)
    for d in (0.93 - pole, 0.9 - pole):
        assert criticality(Parameters(delta_P=pole + d)) == pytest.approx(
            np.polyval(fit, d) / d, rel=0.01
        )
    assert criticality(Parameters(delta_P=pole * (1 + 1e-5))) is None


@pytest.mark.slow
def test_a_pole_of_the_criticality_is_no_tip_and_stops_nothing():
    p = Parameters()
    assert 0.5 < float(critical_pressure(p)) < 1.6
    assert critical_values(p, "delta_P", [0.5, 1.6]) == ()
    (tip,) = critical_values(p, "delta_P", [2.0, 10.0])
    assert abs(criticality(p.replace(delta_P=tip))) < 1e-6


@pytest.mark.parametrize(
    ("D", "v_p0"), [(0.234615, 4.53846), (0.263846, 4.66667), (0.453846, 5.4359)]
)
def test_cells_between_the_fold_and_the_first_point_beyond_it_are_bistable(D, v_p0):
    column = phase_column(Parameters(D=D), D, np.array([v_p0 - 0.1, v_p0, v_p0 + 0.1]))
    assert REGIONS[column.regions[1]] == "bistable"


def test_cells_right_next_to_fold_and_threshold_are_on_the_right_side():
    p = Parameters(D=0.4)
    first = phase_column(p, 0.4, np.array([5.0, 6.5]))
    (fold,), threshold = (f.parameter for f in first.folds), first.threshold
    near = 1e-7
    speeds = np.array([v * (1 + s * near) for v in (fold, threshold) for s in (-1, 1)])
    regions = phase_column(p, 0.4, speeds).regions
    assert [REGIONS[k] for k in regions] == ["rest", "bistable", "bistable", "polarized"]
    threshold = phase_column(Parameters(), 0.03, speeds).threshold
    speeds = threshold * np.array([1 - near, 1 + near])
    assert [REGIONS[k] for k in phase_column(Parameters(), 0.03, speeds).regions] == [
        "rest",
        "polarized",
    ]


@pytest.mark.slow
def test_every_cell_of_the_default_diagram_agrees_with_its_fold_line_and_threshold():
    values, speeds = np.linspace(0.03, 0.6, 40), np.linspace(3.0, 8.0, 40)
    columns = tuple(phase_columns(Parameters(), "D", values, speeds))
    diagram = diagram_of_columns(Parameters(), "D", values, speeds, columns)
    assert diagram.complete
    for j, column in enumerate(columns):
        fold = min((f.parameter for f in column.folds), default=column.threshold)
        rests, moves = speeds < column.threshold, speeds > fold
        expected = np.where(rests, np.where(moves, "bistable", "rest"), "polarized")
        assert [REGIONS[k] for k in diagram.regions[:, j]] == list(expected)
    (line,) = diagram.fold_lines
    direct = [(c.value, c.folds[0].parameter) for c in columns if c.folds]
    on_line = np.interp([D for D, _ in direct], *np.array(line).T)
    assert on_line == pytest.approx([v for _, v in direct], rel=2e-3)
    assert line[-1][0] == values[-1]


def test_a_law_without_instability_rests_everywhere():
    column = phase_column(Parameters(law="v_p0*(1 + c/c_r)"), 0.1, np.array([1.0, 2.0]))
    assert column.threshold is None
    assert [REGIONS[k] for k in column.regions] == ["rest", "rest"]


def test_what_the_modes_cannot_resolve_is_marked(monkeypatch):
    monkeypatch.setattr("amoeboid.axisymmetric.system.MAX_MODES", 32)
    column = phase_column(Parameters(D=0.03), 0.03, np.array([3.0, 3.8, 7.9]))
    assert [REGIONS[k] for k in column.regions] == ["rest", "polarized", REGIONS[UNRESOLVED]]


def _stopping(after):
    def follow(*arguments):
        yield from islice(continuation.follow(*arguments), after)
        raise continuation.Stalled("stopped on purpose")

    return follow


def test_a_branch_that_stops_on_its_way_down_leaves_the_column_open(monkeypatch):
    """At D = 0.4 the polarized cell is stable at v_p0 = 5.5: the fold lies below, at 5.21."""
    monkeypatch.setattr("amoeboid.axisymmetric.paths.follow", _stopping(3))
    column = phase_column(Parameters(D=0.4), 0.4, np.array([3.0, 5.5, 7.0]))
    assert np.all(column.regions == UNRESOLVED)
    assert column.problem == "stopped on purpose"


def test_a_crossing_that_newton_misses_is_not_taken_for_none(monkeypatch):
    speeds = np.array([3.0, 5.5, 7.0])

    def lost(arc, value, options):
        if arc.holds(value):
            raise continuation.Stalled("lost on purpose")

    monkeypatch.setattr("amoeboid.axisymmetric.phase_diagram.unknowns_at", lost)
    column = phase_column(Parameters(D=0.4), 0.4, speeds)
    assert [REGIONS[k] for k in column.regions] == ["rest", "unresolved", "unresolved"]


def test_a_line_of_folds_that_stops_says_why(diagram, monkeypatch):
    assert diagram.problems == ()
    monkeypatch.setattr("amoeboid.numerics.arcs.follow", _stopping(2))
    monkeypatch.setattr(
        "amoeboid.axisymmetric.phase_diagram.critical_values", lambda p, name, values: ()
    )
    columns = diagram.columns
    cut = diagram_of_columns(Parameters(), "D", diagram.values, diagram.speeds, columns)
    assert set(cut.problems) == {"line of folds: stopped on purpose"}
    assert 1 < len(cut.fold_line) < len(diagram.fold_line)
    monkeypatch.setattr(
        "amoeboid.axisymmetric.phase_diagram.newton",
        lambda *_, **__: SimpleNamespace(converged=False),
    )
    lost = diagram_of_columns(Parameters(), "D", diagram.values, diagram.speeds, columns)
    assert lost.fold_line == ()
    assert "could not be located" in lost.problems[0]


@pytest.mark.parametrize(
    ("name", "values", "speeds"),
    [
        ("v_p0", [1.0, 2.0], [1.0, 2.0]),
        ("D", [0.2, 0.1], [1.0, 2.0]),
        ("D", [0.1], [1.0, 2.0]),
        ("D", [0.1, 0.2], [2.0, 2.0]),
    ],
)
def test_impossible_axes_are_refused(name, values, speeds):
    with pytest.raises(InvalidInput):
        next(phase_columns(Parameters(), name, np.array(values), np.array(speeds)))


def test_a_sharp_turn_at_which_the_modes_become_more_is_followed():
    # from the tangent alone, a step led to another branch, and v_p0 = 8 was not found
    p = Parameters(delta_P=11.0, D=0.02)
    column = phase_column(p, p.D, np.linspace(1.0, 8.0, 12))
    assert not np.any(column.regions == UNRESOLVED)
    assert column.problem == ""
