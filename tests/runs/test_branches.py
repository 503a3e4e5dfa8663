"""Branches of 3D cells: folds, thresholds, and cells on circles."""

import json
import pickle
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.runs import branches as traced_branches
from amoeboid.studies.branch import BIFURCATION, HOPF
from amoeboid.surface import branches
from amoeboid.surface.branches import Options
from amoeboid.surface.stability import Growth
from surface.shapes import observed_orders

STIFF = am.Parameters(D=0.4)
TURNS = am.Parameters(D=0.4, delta_P=20.0)
FOLD = 5.20959845  # of `am.branch(am.Parameters(D=0.4), "v_p0", 0, 8)`, without a mesh
ONSET = 7.90323  # of m = 1 of the axisymmetric branch at delta_P = 20
# Without a mesh, by spherical harmonics, at delta_P = 20 and v_p0 = 8.
CIRCLE = {"turning": 0.16500, "radius_of_curvature": 13.450, "cortex_drag_speed": 2.21935}


@cache
def figure_3b(subdivisions):
    mesh = am.Icosphere(subdivisions)
    return am.branch(STIFF, "v_p0", 0, 8, mesh=mesh, stability=False)


@cache
def straight(subdivisions):
    """Around the onset of its mesh."""
    mesh = am.Icosphere(subdivisions)
    return am.branch(TURNS, "v_p0", 7.86, 7.91, mesh=mesh)


@cache
def circles(subdivisions, end=8.0):
    """Those from the onset on."""
    return am.branch(TURNS, "v_p0", 7.8, end, through=straight(subdivisions).bifurcations[0])


def test_the_branch_of_figure_3B_passes_its_fold_and_meets_the_sphere():
    found = figure_3b(2)
    assert found.complete
    assert found.v_p0[0] == 8.0
    (fold,) = found.folds
    assert abs(fold.number - FOLD) < 0.005
    # no state lies below the fold, and both branches beyond it
    assert found.v_p0.min() > fold.number
    turn = int(np.argmin(found.v_p0))
    assert np.all(np.diff(found.max_retrograde_speed) < 0.0)
    assert np.all(np.diff(found.v_p0[:turn]) < 0.0)
    assert np.all(np.diff(found.v_p0[turn:]) > 0.0)
    (threshold,) = found.thresholds
    assert abs(threshold - 6.02566) < 0.05
    assert pickle.loads(pickle.dumps(found)).v_p0[3] == found.v_p0[3]  # noqa: S301
    assert "not asked for" in repr(found)


def test_states_of_a_branch_are_steady_and_change_stability_at_the_fold():
    found = figure_3b(2)
    assert max(state.residual for state in found.states) < 1e-7
    turn = int(np.argmin(found.v_p0))
    above, below = found.states[turn - 2], found.states[turn + 3]
    assert (above.stability, below.stability) == ("stable", "unstable")


@pytest.mark.slow
def test_the_fold_converges_at_second_order():
    folds = np.array([figure_3b(n).folds[0].number for n in (3, 4, 5)])
    orders = observed_orders((642, 2562, 10242), folds - FOLD)
    print(folds, orders)
    assert np.abs(orders - 2.0).max() < 0.1
    assert abs(folds[-1] - FOLD) < 1e-4


def test_a_branch_through_a_cell_in_its_window_is_followed_both_ways():
    cell = am.steady_state(replace(STIFF, v_p0=6.5), mesh=am.Icosphere(1))
    found = am.branch(STIFF, "v_p0", 6.2, 7.0, through=cell, stability=False)
    assert found.complete
    assert (found.v_p0[0], found.v_p0[-1]) == (6.2, 7.0)
    assert np.all(np.diff(found.v_p0) > 0.0)
    assert np.all(np.diff(found.lengths[0]) > 0.0)
    other = am.branch(replace(STIFF, v_p0=6.5), "D", 0.35, 0.5, through=cell, stability=False)
    assert other.complete
    assert {0.35, 0.5} == {other.D[0], other.D[-1]}


def test_a_circle_leaves_the_straight_cell_where_a_mode_of_m_1_is_neutral():
    branch, left = straight(2), circles(2, 7.91)
    (point,) = branch.bifurcations
    assert (point.kind, point.m) == (BIFURCATION, 1)
    # the error of 162 nodes
    assert abs(point.number - ONSET) < 0.04
    assert abs(point.state.number("growth_rate")) < 1e-3
    assert left.bifurcations[0].number == point.number
    assert {cell.path for cell in left.states} == {"circle"}
    # supercritical: the square of the turning grows in proportion, 0.28 to 0.29 without a mesh
    near = left.states[0]
    share = near.number("turning") ** 2 / (near.parameters.v_p0 - point.number)
    assert share == pytest.approx(0.285, rel=0.1)
    assert near.stability == "stable"


def test_only_steady_cells_of_the_parameters_leave_a_bifurcation_within_the_window():
    """From elsewhere the iteration led to a straight cell, given as a branch of circles."""
    (point,) = straight(2).bifurcations
    oscillating = replace(point, kind=HOPF)
    soft = replace(TURNS, D=0.5)
    for p, ends, through, why in (
        (TURNS, (8.0, 8.2), point, "the window must contain the bifurcation .* v_p0 = 7.87"),
        (TURNS, (7.0, 7.5), point, "the window must contain the bifurcation .* v_p0 = 7.87"),
        (soft, (7.8, 8.0), point, "at the parameters p, but D of the .* differs"),
        (TURNS, (7.8, 8.0), oscillating, "bifurcation to steady cells"),
    ):
        with pytest.raises(am.InvalidInput, match=why):
            am.branch(p, "v_p0", *ends, through=through)
    with pytest.raises(am.InvalidInput, match="mesh must be left out"):
        am.branch(TURNS, "v_p0", 7.8, 8.0, through=point, mesh=am.Icosphere(2))


def test_circles_are_followed_in_another_parameter_from_their_onset():
    (point,) = straight(2).bifurcations
    p = point.state.parameters
    found = am.branch(p, "delta_P", 19, 21, through=point, stability=False)
    assert found.complete
    assert {cell.path for cell in found.states} == {"circle"}
    assert found.delta_P[-1] == 19.0
    (begin,) = found.bifurcations
    assert (begin.name, begin.number) == ("delta_P", 20.0)


def test_a_pickled_cell_keeps_its_growth_rate():
    cell = straight(2).states[0]
    again = pickle.loads(pickle.dumps(cell))  # noqa: S301
    assert again.known_stability == cell.stability
    assert again.number("growth_rate") == cell.number("growth_rate")


def test_what_is_said_of_cells_in_physical_units_has_units():
    cell = am.Parameters.physical()
    with pytest.raises(am.InvalidInput, match=r"there is none at v_p0 = 0.1 um/s or 0.2 um/s"):
        am.branch(cell, "v_p0", "0.1 um/s", "0.2 um/s", mesh=am.Icosphere(1))
    found = am.steady_state(cell, mesh=am.Icosphere(1))
    found.__dict__["_growth"] = Growth(0.001, 0.5)
    assert "perturbation, 0.0001 1/s, is known only to +- 0.05 1/s" in found.stability_problem


@pytest.mark.slow
def test_circles_converge_at_second_order():
    """Observed from 642 nodes on: 1.82 and 1.97 for the turning."""
    cells = [circles(n).states[-1] for n in (3, 4, 5)]
    for name, exact in CIRCLE.items():
        errors = np.array([cell.number(name) for cell in cells]) - exact
        orders = observed_orders((642, 2562, 10242), errors)
        print(name, [cell.number(name) for cell in cells], orders)
        assert np.abs(orders - 2.0).max() < 0.25
    onsets = np.array([straight(n).bifurcations[0].number for n in (3, 4)])
    print(onsets)
    assert abs(onsets[1] - ONSET) < 0.35 * abs(onsets[0] - ONSET)


@pytest.mark.slow
def test_a_circling_cell_is_that_of_a_run_and_turns_as_it_does():
    p = replace(TURNS, v_p0=8.0)
    cell = circles(3).states[-1]
    run = am.simulate(p, initial=cell, until=am.time(3.0))
    x, t = run.trajectory, run.t
    v = np.gradient(x, t, axis=0)
    heading = np.unwrap(np.arctan2(v @ np.eye(3)[1], v @ np.eye(3)[0]))
    print(cell.turning, heading)
    speed = np.linalg.norm(v[5:-5], axis=1).mean()
    assert abs(speed / cell.cortex_drag_speed - 1.0) < 2e-3


def test_a_branch_that_cannot_be_followed_says_why(monkeypatch):
    monkeypatch.setattr(branches, "MIN_COSINE", 1.1)
    found = am.branch(STIFF, "v_p0", 5, 6.5, mesh=am.Icosphere(1), stability=False)
    assert not found.complete
    assert "the branch bends too sharply" in found.problems[0]


def test_what_no_branch_can_be_made_from_is_refused():
    with pytest.raises(am.InvalidInput, match="polarized state at an end of its window"):
        am.branch(STIFF, "v_p0", 1, 2, mesh=am.Icosphere(1))
    with pytest.raises(am.InvalidInput, match="max_step must be"):
        am.branch(STIFF, "v_p0", 1, 7, mesh=am.Icosphere(1), max_step=-1.0)
    with pytest.raises(am.InvalidInput, match=r"^through must be a steady"):
        am.branch(STIFF, "v_p0", 1, 7, through="a cell")


def test_the_command_follows_3D_cells(capsys):
    words = ["branch", "--set", "D=0.4", "--from", "6.2", "--to", "6.5", "--mesh", "1"]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["complete"]
    assert found["points"][0]["v_p0"] == 6.5
    assert found["points"][-1]["v_p0"] == 6.2
    assert all(point["stable"] and point["path"] == "straight" for point in found["points"])
    assert main(words) == 0
    assert "stability" in capsys.readouterr().out
    assert main([*words[:-1], "7"]) == 2
    assert "--mesh must be 1 to 6" in capsys.readouterr().err


def test_a_step_that_passed_a_fold_is_taken_back():
    """On 42 nodes a step of up to 0.3 of the scale leads over the fold to the other side."""
    found = am.branch(STIFF, "v_p0", 4, 7, mesh=am.Icosphere(1), stability=False, max_step=0.3)
    assert found.complete
    assert found.problems == ()
    assert found.folds[0].number == pytest.approx(5.2215, abs=1e-3)
    # it is the extremum of the points, each of which lies farther than the one before
    assert found.v_p0.min() >= found.folds[0].number
    assert np.all(np.diff(found.lengths[0]) > 0.0)
    # without a mesh it is the only one; next to the sphere the mesh makes another
    assert [fold.state.number("polarity") < 0.1 for fold in found.folds] == [False, True]


def test_a_branch_begins_with_a_cell_that_turns_the_same_way(monkeypatch):
    """A far neighbour that the iteration found on the other half of the circles is left out."""
    omega = np.array([0.0, 0.0, 0.5])
    model = am.steady_state(STIFF.replace(v_p0=6.0), mesh=am.Icosphere(1)).model

    def turning(way, q):
        return SimpleNamespace(model=model, cell=SimpleNamespace(angular_velocity=way * omega), q=q)

    monkeypatch.setattr(
        traced_branches, "found_from", lambda _, cell, q: turning(-1.0 if q > 6.1 else 1.0, q)
    )
    traced = traced_branches._Traced(STIFF, "v_p0", (6.0, 8.0), Options(6.0), None)
    second = traced._second(lambda q: q, turning(1.0, 6.0), 6.0, 2.0)
    assert 6.0 < second.q <= 6.1
    # where none turns the same way the branch is at its end
    monkeypatch.setattr(traced_branches, "found_from", lambda _, cell, q: turning(-1.0, q))
    assert traced._second(lambda q: q, turning(1.0, 6.0), 6.0, 2.0).q > 6.0
