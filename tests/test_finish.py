"""Runs that solve for their steady cell once they are near it."""

from dataclasses import replace

import numpy as np
import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.simulation import finish
from amoeboid.simulation.events import SOLVED
from amoeboid.surface.stability import Growth

STIFF = am.Parameters(D=0.4, v_p0=6.0)
SOLVE = am.steady(solve=True)


def test_a_run_ends_with_the_cell_that_it_would_have_waited_for():
    waited = am.simulate(STIFF, mesh=am.Icosphere(1))
    solved = am.simulate(STIFF, mesh=am.Icosphere(1), until=SOLVE)
    assert (waited.ended, solved.ended) == ("steady", SOLVED)
    assert repr(solved).startswith("Solution(steady, solved for at t = ")
    assert solved.steady
    assert solved.stability == "stable"
    assert solved.last.rate < 1e-7
    # the steps before are those of the run that waits
    assert np.array_equal(solved.t, waited.t[: len(solved)])
    assert len(solved) < 0.8 * len(waited)
    for name in ("max_retrograde_speed", "c_front", "c_rear", "zeta0"):
        assert solved[name][-2] == waited[name][len(solved) - 2]
        assert solved[name][-1] == pytest.approx(waited[name][-1], rel=5e-4)  # 42 nodes
    assert solved.growth_rate == pytest.approx(waited.growth_rate, abs=1e-3)
    # the last row is that of the solved cell, which goes on where the run had come to
    assert solved["max_retrograde_speed"][-1] == solved.final.max_retrograde_speed
    moved = np.linalg.norm(np.diff(solved.trajectory, axis=0), axis=1)
    assert moved[-1] < 2.0 * moved[-2]


def test_the_cell_stays_as_it_was_solved_for():
    solved = am.simulate(STIFF, mesh=am.Icosphere(1), until=SOLVE)
    on = solved.resume(am.time(float(solved.t[-1]) + 2.0))
    # but for its nodes, which slide within the surface
    assert on.final.max_retrograde_speed == pytest.approx(
        solved.final.max_retrograde_speed, rel=5e-4
    )


def test_cells_on_circles_and_helices_end_their_runs():
    """Where a run that waits goes on to the end of its time."""
    p = am.Parameters(D=0.4, delta_P=30.0, v_p0=10.0)
    noise = am.Initial(perturbation=0.0, noise=0.9, seed=1)
    run = am.simulate(p, mesh=am.Icosphere(2), initial=noise, until=[SOLVE, am.time(40.0)])
    assert run.ended == SOLVED
    cell = am.steady_state(p, start=run.final)
    assert cell.iterations <= 2
    assert cell.path == "helix"


def test_an_unstable_cell_is_not_where_a_run_ends(monkeypatch):
    """The straight cell at delta_P = 20 that bends, slowly; the run goes on as if nothing were."""
    p = am.Parameters(D=0.4, delta_P=20.0, v_p0=8.0)
    end = am.time(12.0)
    tried = []
    known = finish.leading_growth_rate

    def seen(*args, **options):
        tried.append(known(*args, **options))
        return tried[-1]

    monkeypatch.setattr(finish, "leading_growth_rate", seen)
    straight = am.simulate(p, mesh=am.Icosphere(2), until=[SOLVE, end])
    waited = am.simulate(p, mesh=am.Icosphere(2), until=[am.steady(), end])
    assert straight.ended == "end of time"
    assert tried
    assert all(growth.rate > 0.0 for growth in tried)
    assert np.array_equal(straight["c_rear"], waited["c_rear"])


def test_a_cell_far_away_or_of_unknown_stability_is_not_taken(monkeypatch):
    until = [SOLVE, am.time(4.0)]
    monkeypatch.setattr(finish, "MAX_DISTANCE", 1e-9)
    assert am.simulate(STIFF, mesh=am.Icosphere(1), until=until).ended == "end of time"
    monkeypatch.undo()
    monkeypatch.setattr(finish, "leading_growth_rate", lambda *_, **__: Growth(None))
    assert am.simulate(STIFF, mesh=am.Icosphere(1), until=until).ended == "end of time"


def test_a_resumed_run_solves_where_the_uninterrupted_one_does(tmp_path):
    whole = am.simulate(STIFF, mesh=am.Icosphere(1), until=SOLVE, folder=tmp_path / "whole")

    def early(step):
        return step.number == len(whole) - 4

    part = tmp_path / "part"
    assert (
        am.simulate(STIFF, mesh=am.Icosphere(1), until=[SOLVE, early], folder=part).ended == "early"
    )
    assert main(["run", "--resume", str(part)]) == 0
    again = am.load(tmp_path / "part")
    assert again.ended == SOLVED == am.load(tmp_path / "whole").ended
    assert again["c_rear"][-1] == whole["c_rear"][-1]
    assert np.array_equal(again.final.cell.r, whole.final.cell.r)
    assert again.stability == "stable"


def test_no_steady_cell_is_solved_for_under_a_cue():
    with pytest.raises(am.InvalidInput, match=r'time\.finish must be "wait" under a cue'):
        am.simulate(
            STIFF,
            mesh=am.Icosphere(1),
            cue=am.Cue(strength=0.1),
            until=SOLVE,
        )


def test_the_configuration_and_the_command_line_say_it_too():
    config = am.Config(parameters=STIFF, time=replace(am.Config().time, finish="solve"))
    assert am.simulate(config, mesh=am.Icosphere(1)).ended == SOLVED
    with pytest.raises(am.InvalidInput, match="finish"):
        replace(config.time, finish="guess")
