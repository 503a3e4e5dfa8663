"""`python -m benchmarks.speed`: what it reports, and that its parts measure what they say."""

import json
import time
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from benchmarks.speed import peers, steady_state
from benchmarks.speed.__main__ import main
from benchmarks.speed.sizes import growth_exponents, step_times
from benchmarks.speed.stopwatch import PHASES, Stopwatch, Timing, phases_timed, timed

from amoeboid.config import Config, Initial, Mesh
from amoeboid.model.parameters import Parameters
from amoeboid.simulation.loop import evolve, start
from amoeboid.surface import stepping

SMALL = ["--subdivisions", "1", "2", "--steps", "2", "--explicit-steps", "5", "--repetitions", "1"]
SOLVED = ["--solved-subdivisions", "1"]
QUICK = [*SMALL, *SOLVED, "--peer-subdivisions", "1", "--set", "mesh.subdivisions=1"]


@pytest.fixture(scope="module")
def result():
    from contextlib import redirect_stderr, redirect_stdout
    from io import StringIO

    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        assert main([*QUICK, "--set", "time.end=0.2", "--json"]) == 0
    assert "amoeboid: steps on 42 nodes" in err.getvalue()
    return json.loads(out.getvalue())


def test_json_has_every_size_phase_and_ratio(result):
    assert [s["nodes"] for s in result["sizes"]] == [42, 162]
    for size in result["sizes"]:
        assert set(size["phases"]) == set(PHASES)
        assert 0 < size["step"]["best_s"] <= size["step"]["median_s"]
        assert size["step"]["repetitions"] == 2
        for phase in size["phases"].values():
            assert 0 < phase["best_s"] <= phase["median_s"]
        # the phases make up the step: no time is lost or counted twice
        assert sum(p["best_s"] for p in size["phases"].values()) <= size["step"]["best_s"] * 1.001
        assert size["peak_memory_MiB"] is None or size["peak_memory_MiB"] > 10
    assert [g["to_nodes"] for g in result["growth_exponents"]] == [162]
    assert np.isfinite(result["growth_exponents"][0]["exponent"])
    assert result["machine"]["packages"]["numpy"] == np.__version__


def test_the_explicit_time_is_labelled_and_extrapolated_to_the_same_end(result):
    run = result["steady_state"]
    default, explicit = run["default"], run["explicit"]
    assert default["how"] == "measured"
    assert default["ended"] == "end of time"
    assert explicit["how"] == "extrapolated"
    assert explicit["dt"] == 1e-5
    assert explicit["steps"] == round(default["t"] / 1e-5) == 20000
    assert explicit["wall_s"] == pytest.approx(explicit["s_per_step"] * explicit["steps"])
    assert run["ratio"] == pytest.approx(explicit["wall_s"] / default["wall_s"])
    assert run["cpu_ratio"] == pytest.approx(explicit["cpu_s"] / default["cpu_s"])
    assert min(run["ratio"], run["cpu_ratio"]) > 0


def test_steady_states_are_solved_for_and_waited_for(result):
    (one,), (found,) = result["solved"], result["branches"]
    assert one["nodes"] == found["nodes"] == 42
    assert min(one["cpu_s"].values()) > 0
    assert one["ratios"]["state"] == pytest.approx(one["cpu_s"]["run"] / one["cpu_s"]["solved"])
    assert min(one["steps"], one["iterations"]) > 3
    assert found["points"] > 3


def test_the_peer_is_compared_or_said_to_be_missing(result):
    (peer,) = result["peers"]
    assert peer["peer"] == "NGSolve"
    assert peer["nodes"] == 42
    if "missing" in peer:
        assert "amoeboid[peers]" in peer["missing"]
    else:
        assert peer["difference"] < peers.AGREEMENT
        assert set(peer["ratios"]) == {"assembly", "factorization", "solve", "total"}
        assert min(peer["ratios"].values()) > 0


def test_a_missing_peer_is_said_to_be_missing(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    entry = peers.compared_with_ngsolve(Parameters(), 1, 1)
    assert entry == {"peer": "NGSolve", "nodes": 42, "missing": peers.REMEDY}


def test_our_side_of_the_comparison_solves_the_force_balance():
    """Against a dense solve: K v = f with the shift, which pins the six rigid motions."""
    from amoeboid.meshes.geometry import geometry
    from amoeboid.meshes.operators import block_matrix
    from amoeboid.surface.dissipation import dissipation_blocks

    p = Parameters(eta_b=2.0)
    task = peers.problem(p, 1)
    v, times = peers._ours(task, 1)
    mesh = task.model.mesh
    blocks = dissipation_blocks(geometry(task.r, mesh.faces), mesh, 1.0, 2.0)
    K = block_matrix(blocks, mesh).toarray() + np.diag(np.repeat(task.shift, 3))
    np.testing.assert_allclose(v.ravel(), np.linalg.solve(K, task.force.ravel()), atol=1e-6)
    assert set(times) == {"assembly", "factorization", "solve"}


def test_a_peer_with_another_solution_is_not_timed(monkeypatch):
    task = peers.problem(Parameters(), 1)
    v, times = peers._ours(task, 1)
    monkeypatch.setattr(peers, "find_spec", lambda name: object())
    monkeypatch.setattr(peers, "_ngsolve", lambda task, n: (1.00001 * v, times, "another"))
    with pytest.raises(peers.Disagreement, match=r"must agree to 1e-06, they differ by 1e-05"):
        peers.compared_with_ngsolve(Parameters(), 1, 1)


@pytest.mark.parametrize("name", ["eta_s", "eta_b"])
def test_a_change_of_the_form_for_the_peer_alone_is_noticed(monkeypatch, name):
    if find_spec("ngsolve") is None:
        assert "missing" in peers.compared_with_ngsolve(Parameters(), 1, 1)
        return
    build = peers._ngsolve_form

    def changed(task):
        p = task.model.parameters
        other = p.replace(**{name: 1.001 * getattr(p, name)})
        return build(replace(task, model=replace(task.model, parameters=other)))

    monkeypatch.setattr(peers, "_ngsolve_form", changed)
    with pytest.raises(peers.Disagreement):
        peers.compared_with_ngsolve(Parameters(), 1, 1)


def test_each_moment_belongs_to_the_innermost_phase(monkeypatch):
    clock = iter([0.0, 1.0, 3.0, 7.0, 7.5, 9.5])
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    watch = Stopwatch()
    solve = watch.timing("solve", lambda: None)
    with watch.phase("step"):  # 0 to 1, 3 to 7
        solve()  # 1 to 3
    solve()  # 7.5 to 9.5
    assert watch.read() == {"step": 5.0, "solve": 4.0}
    assert watch.read() == {}


def test_timing_keeps_best_and_median_and_leaves_out_the_first_call():
    calls = []
    timing = timed(lambda: calls.append(1), 3)
    assert len(calls) == 4
    assert timing.repetitions == 3
    assert Timing.of([3.0, 1.0, 8.0]) == Timing(1.0, 3.0, 3)


def test_solvers_are_as_before_once_the_phases_have_been_timed():
    """Timing changes no number, and leaves nothing behind, not even after an error."""
    config = Config(mesh=Mesh(subdivisions=1), initial=Initial(perturbation=1.0))
    first = start(config)
    model = first.model
    original, solver = stepping.force_balance, model.vector_solver
    plain = next(evolve(first, config.time))
    with pytest.raises(KeyError), phases_timed() as watch:
        assert stepping.force_balance is not original
        seen = next(evolve(first, config.time))
        raise KeyError
    assert {"geometry", "assembly", "factorization", "solve", "shape"} <= watch.read().keys()
    assert stepping.force_balance is original
    assert model.vector_solver is solver
    assert np.array_equal(plain.state.r, seen.state.r)
    assert np.array_equal(plain.state.c, seen.state.c)


def test_growth_exponent_of_a_known_law():
    sizes = [{"nodes": n, "step": {"best_s": 1e-6 * n**1.25}} for n in (642, 2562)]
    (growth,) = growth_exponents(sizes)
    assert growth["exponent"] == pytest.approx(1.25)


def test_steps_are_timed_beyond_the_end_and_the_steady_state_of_a_run():
    config = Config(time=replace(Config().time, end=1e-3))
    assert step_times(config, 1, 3)["step"]["repetitions"] == 3
    at_rest = Config(initial=Initial(perturbation=0.0))
    assert step_times(at_rest, 1, 40)["step"]["repetitions"] == 40


def test_an_explicit_step_that_is_too_long_is_reported(monkeypatch):
    monkeypatch.setattr(steady_state, "EXPLICIT_STEP", 0.1)
    config = Config(mesh=Mesh(subdivisions=1), time=replace(Config().time, end=0.5))
    run = steady_state.time_to_steady_state(config, 50)
    assert run["ratio"] is None
    assert run["explicit"]["how"] == "not measured"
    assert "too long" in run["explicit"]["why"]


def test_the_table_names_sizes_ratios_and_the_peer(capsys):
    assert main([*QUICK, "--set", "time.end=0.05"]) == 0
    out = capsys.readouterr().out
    for text in ("42 nodes", "factorization", "nodes^", "extrapolated", "ratio", "NGSolve"):
        assert text in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--subdivisions", "0"], "from 1 to 6, got '0'"),
        (["--subdivisions", "three"], "from 1 to 6, got 'three'"),
        (["--subdivisions"], "expected at least one argument"),
        (["--steps", "0"], "from 1 to 1000000, got '0'"),
        (["--explicit-steps", "-5"], "from 1 to 1000000, got '-5'"),
        (["--peer-subdivisions", "9"], "from 1 to 6, got '9'"),
    ],
)
def test_wrong_options_exit_with_2(arguments, says, capsys):
    with pytest.raises(SystemExit) as leaving:
        main([*arguments])
    assert leaving.value.code == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("initial.from_frame=cell.vtp", "initial.from_frame must be left out, got 'cell.vtp'"),
        ("initial.surface=cell.stl", "initial.surface must be left out, got 'cell.stl'"),
        ("time.scheme=explicit", "time.scheme must be semi-implicit, got 'explicit'"),
        ("time.max_step=1e-9", "time.max_step must be > 1e-07"),
    ],
)
def test_what_cannot_be_compared_is_refused_at_once(setting, says, capsys):
    assert main(["--set", setting]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("amoeboid: ")
    assert says in err
    assert err.count("\n") == 1


def test_wrong_settings_exit_with_2(capsys):
    assert main(["--set", "beta=-1"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("amoeboid: beta must be")
