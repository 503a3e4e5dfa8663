"""Parameters that change in time: what a run makes of them, and what is refused."""

import json
import math
import pickle
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from amoeboid.axisymmetric import evolution as axisymmetric
from amoeboid.config import config_from_toml, config_to_toml, resolved, with_settings
from amoeboid.model.changes import Changes
from amoeboid.numerics.integrators import Control
from amoeboid.observables import observed, polarization
from amoeboid.output.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from amoeboid.output.folder import new_run, resumed_run
from amoeboid.surface import steadiness

POLAR = am.Parameters(D=0.4, v_p0=6.0)


def config_of(p=POLAR, nodes=42, perturbation=0.5, changes=None, cue=None, **time):
    return am.Config(
        parameters=p,
        mesh=am.Mesh(subdivisions={42: 1, 162: 2, 642: 3}[nodes]),
        initial=am.Initial(perturbation=perturbation),
        changes=changes or {},
        cue=cue,
        time=am.Time(**time),
    )


def steps_of(config):
    first = am.start(config)
    return [first, *am.evolve(first, config.time)]


def amplitude(step):
    return float(np.linalg.norm(polarization(step.cell)))


@pytest.mark.parametrize(
    ("nodes", "error"), [(162, 0.04), pytest.param(642, 0.01, marks=pytest.mark.slow)]
)
def test_washout_stops_the_growth_of_a_polarization_at_the_exact_rates(nodes, error):
    """Growth at lambda_1, decay at beta + 2 D/R0^2 without polymerization, growth again.

    The errors are those of the mesh.
    """
    p = POLAR.replace(v_p0=9.0)
    changes = {"v_p0": am.steps((0.5, 0.0), (1.0, 9.0))}
    config = config_of(p, nodes, 1e-4, changes, end=1.5, max_step=0.05)
    run = steps_of(config)
    at = {t: amplitude(next(s for s in run if s.state.t == t)) for t in (0.0, 0.5, 1.0, 1.5)}
    rates = [math.log(at[b] / at[a]) / 0.5 for a, b in ((0.0, 0.5), (0.5, 1.0), (1.0, 1.5))]
    grows = float(am.growth_rate(p, 1))
    print(rates, grows)
    assert rates == pytest.approx([grows, -(p.beta + 2 * p.D), grows], rel=error)


def test_switched_cell_follows_the_axisymmetric_one():
    changes = {"v_p0": am.steps((1.0, 0.0), (1.5, 8.0)), "D": am.steps((1.0, 0.2))}
    last = steps_of(config_of(POLAR, 162, 1.0, changes, end=2.5))[-1]
    y, control = axisymmetric.perturbed_sphere(POLAR, {1: 1.0}), Control(tolerance=1e-7)
    for p, duration in (
        (POLAR, 1.0),
        (POLAR.replace(v_p0=0.0, D=0.2), 0.5),
        (POLAR.replace(v_p0=8.0, D=0.2), 1.0),
    ):
        *_, exact = axisymmetric.evolve(p, y, duration, control)
        y = exact.y
    found = observed(last.cell)
    for name in ("c_front", "c_rear", "max_retrograde_speed"):
        print(name, found[name], getattr(exact, name))
        assert found[name] == pytest.approx(getattr(exact, name), rel=0.02)


def test_steps_end_at_jumps_with_the_value_before_and_begin_anew():
    changes = {"v_p0": am.steps((0.7, 0.0), (1.1, 6.0))}
    run = steps_of(config_of(changes=changes, end=1.5))
    times = [s.state.t for s in run]
    assert {0.7, 1.1} < set(times)
    for step in run[1:]:
        expected = 0.0 if 0.7 < step.state.t <= 1.1 else 6.0
        assert step.model.parameters.v_p0 == expected
        assert np.any(step.flow.v_p) == (expected > 0)
    first = run[times.index(0.7) + 1]
    assert len(first.history) == 2
    assert first.dt < run[times.index(0.7) - 1].next_dt


@pytest.mark.parametrize("scheme", ["semi-implicit", "explicit"])
def test_jumps_at_any_time_are_met_exactly(scheme):
    jumps = sorted(np.random.default_rng(1).uniform(1e-4, 4e-3, 10).tolist())
    changes = {"beta": am.steps(*((t, 1.0 + k % 2) for k, t in enumerate(jumps)))}
    run = steps_of(config_of(changes=changes, end=0.005, scheme=scheme, max_step=3e-4))
    assert set(jumps) < {s.state.t for s in run}
    assert run[-1].state.t == 0.005


@pytest.mark.parametrize(
    "changes",
    [
        {
            "v_p0": lambda t: 4 + 2 * math.sin(2 * t),
            "cue.strength": lambda t: 0.3 * math.sin(2 * t),
        },
        pytest.param(
            {"D": lambda t: 0.4 + 0.3 * math.sin(3 * t), "beta": lambda t: 1 + 0.5 * math.cos(t)},
            marks=pytest.mark.slow,
        ),
        pytest.param({"v_p0": am.ramp((0.25, 5.0), (0.75, 1.0))}, marks=pytest.mark.slow),
        pytest.param({"v_p0": am.steps((0.35, 0.0), (0.65, 6.0))}, marks=pytest.mark.slow),
    ],
    ids=["speed and cue", "diffusion and turnover", "ramp", "steps"],
)
def test_order_in_time_stays_two(changes):
    cue = am.Cue(direction=(1.0, 0.0, 0.0))

    def end(dt):
        config = config_of(changes=changes, cue=cue, end=0.8, max_step=dt, tolerance=1e9)
        return steps_of(config)[-1].state.c

    exact = end(0.00625)
    coarse, fine = (np.abs(end(dt) - exact).max() for dt in (0.05, 0.025))
    print(math.log2(coarse / fine))
    assert math.log2(coarse / fine) > 1.6


@pytest.mark.parametrize("count", [1, 6, 10, 12])
def test_resumed_run_is_the_uninterrupted_one_bit_for_bit(count, tmp_path):
    changes = {"v_p0": am.steps((0.1, 0.0), (0.3, 6.0)), "cue.strength": am.ramp((0, 0), (0.4, 1))}
    config = config_of(changes=changes, cue=am.Cue(direction=(1, 2, 0)), end=0.6)
    whole = steps_of(config)
    assert any(s.state.t == 0.1 for s in whole[:12])
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, Checkpoint(config, whole[count], (whole[count].state.t,)))
    for first in (read_checkpoint(path).step, pickle.loads(pickle.dumps(whole[count]))):  # noqa: S301
        rest = list(am.evolve(first, config.time))
        assert [s.state.t for s in rest] == [s.state.t for s in whole[count + 1 :]]
        assert np.array_equal(rest[-1].state.c, whole[-1].state.c)
        assert np.array_equal(rest[-1].state.r, whole[-1].state.r)
        assert rest[-1].model.parameters == whole[-1].model.parameters


def test_cell_at_rest_waits_for_the_last_jump():
    """The sphere rests until polymerization begins; the run must not end before."""
    p = POLAR.replace(v_p0=0.0)
    changes = {"v_p0": am.steps((8.0, 1.0), (12.0, 7.0))}
    run = steps_of(config_of(p, 42, 1e-3, changes, end=20.0))
    waiting = [s for s in run if s.state.t <= 12.0]
    assert min(s.rate for s in waiting) < steadiness.STEADY
    assert not any(s.steady or s.rest for s in waiting)
    assert waiting[-1].stability_problem == "a parameter or cue changes until t = 12"
    assert run[-1].state.t == 20.0
    assert amplitude(run[-1]) > 2 * amplitude(waiting[-1])


def test_function_of_time_is_waited_for_until_it_is_constant():
    p = POLAR.replace(v_p0=1.0)
    constant = {"v_p0": am.smooth(lambda t: 1.0 + 0.1 * t, until=2.0)}
    last = steps_of(config_of(p, 42, 1e-3, constant, end=60.0))[-1]
    assert last.ended == "steady"
    assert last.model.parameters.v_p0 == 1.2
    last = steps_of(config_of(p, 42, 1e-3, {"v_p0": lambda t: 1.0}, end=20.0))[-1]
    assert last.ended == "end of time"
    assert "end of the run" in last.stability_problem


def test_cell_in_which_nothing_is_left_to_change_has_the_given_unit_of_time():
    p = am.Parameters(D=0.0, beta=0.0, v_p0=4.0)
    run = steps_of(config_of(p, 42, 0.5, {"v_p0": am.steps((0.5, 0.0))}, end=30.0))
    assert run[-1].model.rate == p.rate
    assert run[-1].state.t > 0.5
    assert run[-1].ended == "steady"


def test_cell_whose_whole_treadmilling_stops_keeps_its_time_series():
    stops = {name: am.steps((0.5, 0.0)) for name in ("beta", "D", "v_p0")}
    run = am.simulate(POLAR, mesh=am.Icosphere(1), until=am.time(0.7), changes=stops)
    assert (run.status, run.t[-1]) == ("finished", 0.7)
    assert np.isfinite(run["cortex_drag_heading"]).all()


def test_unit_of_time_is_that_of_the_present_parameters():
    first = am.start(config_of(changes={"beta": am.steps((1.0, 0.01)), "v_p0": am.steps((1, 0))}))
    assert first.model.rate == 1.0
    assert first.model.at(1.0, since=0.9).rate == 1.0
    assert first.model.at(1.0, since=1.0).rate == 0.4
    assert first.model.at(1.0, since=1.0).given == POLAR
    assert resolved(config_of(changes={"beta": am.steps((7.0, 0.01))})).time.end == 207.0


def test_parameters_of_law_and_stress_change_too():
    """Contractility that is switched on polarizes a cell that polymerization alone does not."""
    given = {"stress": "saturating", "stress.chi": 0.0, "stress.c_s": 1e12}
    p = am.Parameters(v_p0=1.0).replace(**given)
    changes = {"stress.chi": am.steps((0.3, 1.2))}
    config = config_of(p, 162, 1e-3, changes, end=0.6, max_step=0.05)
    run = steps_of(config)
    at = {t: amplitude(next(s for s in run if s.state.t == t)) for t in (0.0, 0.3, 0.6)}
    exact = [float(am.growth_rate(p.replace(**{"stress.chi": chi}), 1)) for chi in (0.0, 1.2)]
    found = [math.log(at[0.3] / at[0.0]) / 0.3, math.log(at[0.6] / at[0.3]) / 0.3]
    print(found, exact)
    assert exact[0] < 0 < exact[1]
    assert found == pytest.approx(exact, abs=0.04)
    assert config_from_toml(config_to_toml(config)) == config
    with pytest.raises(am.InvalidInput, match=r"stress\.x"):
        am.start(config_of(p, changes={"stress.x": am.steps((1, 2))}))


@dataclass(frozen=True)
class Pulses(am.Change):
    """A kind of change from a script: on for the first half of every period."""

    period: float
    count: int

    @property
    def breaks(self):
        return tuple(0.5 * self.period * k for k in range(1, 2 * self.count))

    @property
    def until(self):
        return self.breaks[-1]

    def at(self, t, since, given):
        half = round(since // (0.5 * self.period))
        return given if half % 2 == 0 and half < 2 * self.count else 0.0


def test_kind_of_change_comes_from_outside():
    run = steps_of(config_of(changes={"v_p0": Pulses(0.5, 2)}, end=1.2))
    values = {s.state.t: s.model.parameters.v_p0 for s in run}
    assert [values[t] for t in (0.25, 0.5, 0.75, 1.2)] == [6.0, 0.0, 6.0, 0.0]


def test_configuration_reads_back_equal():
    text = """
        [changes]
        v_p0 = [[5.0, 0], [20, 6.0]]
        D = { ramp = [[0, 0.4], [3, 0.1]] }
        cue.strength = [[7.0, -0.1]]
        [cue]
        strength = 0.2
        direction = [0, 1, 0]
    """
    config = config_from_toml(text)
    assert config.changes["v_p0"] == am.steps((5, 0), (20, 6))
    assert config.changes["D"] == am.ramp((0, 0.4), (3, 0.1))
    assert config.changes["cue.strength"] == am.steps((7, -0.1))
    assert config_from_toml(config_to_toml(config)) == config
    settings = ["changes.v_p0=[[5, 0.0], [20, 6]]", "changes.cue.strength=[[7, -0.1]]"]
    settings += ["changes.D={ramp=[[0, 0.4], [3, 0.1]]}", "cue.strength=0.2"]
    assert with_settings(am.Config(), [*settings, "cue.direction=[0, 1, 0]"]) == config
    assert pickle.loads(pickle.dumps(config)) == config  # noqa: S301
    assert hash(config) == hash(config_from_toml(config_to_toml(config)))
    assert "steps((5, 0), (20, 6))" in repr(config.changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"R0": [[1, 2]]}, "any parameter except R0.*membrane"),
        ({"v_p": [[1, 2]]}, "did you mean v_p0"),
        ({"law": [[1, 2]]}, "unknown parameter 'law' in changes"),
        ({"v_p0": [[5, -1]]}, r"at t = 5: v_p0 must be .* >= 0, got -1"),
        ({"v_p0": 5}, "changes.v_p0: it must be a list"),
        ({"v_p0": [[5, 0], [5, 1]]}, "that increase"),
        ({"v_p0": [[0, 1]]}, "times > 0"),
        ({"v_p0": []}, "pairs"),
        ({"v_p0": [[1, True]]}, "finite numbers"),
        ({"v_p0": {"ramp": [[0, 1], [math.inf, 2]]}}, "finite numbers"),
        ({"v_p0": {"slope": 3}}, "it must be a list"),
        ({"v_p0": lambda t: -1.0}, r"at t = 0: v_p0 must be"),
        ({"v_p0": lambda t: "fast"}, "must return a number; at t = 0 it raised"),
        ({"v_p0": lambda t: math.nan}, "finite number; at t = 0 it returned nan"),
        ({"cue.strength": [[3, 2.0]]}, r"at t = 3: cue.strength must be .* <= 1"),
        ({"cue": {"speed": [[3, 2.0]]}}, "unknown parameter 'cue.speed' in changes"),
    ],
)
def test_what_is_no_change_is_refused_with_the_remedy(changes, words):
    with pytest.raises(am.InvalidInput, match=words):
        am.start(config_of(changes=changes))


def test_change_that_no_file_can_hold_runs_in_python_alone(tmp_path):
    config = config_of(changes={"v_p0": math.exp}, end=0.02)
    assert steps_of(config)[-1].model.parameters.v_p0 == math.exp(0.02)
    with pytest.raises(
        am.InvalidInput, match=r"changes.v_p0: .*smooth\(exp\), which exists only in Python"
    ):
        new_run(tmp_path / "run", config)
    assert not (tmp_path / "run").exists()


def test_function_that_fails_later_ends_the_run_with_its_message():
    with pytest.raises(am.Diverged, match=r"changes.v_p0: .* at t = .* ZeroDivisionError"):
        steps_of(config_of(changes={"v_p0": lambda t: 1 / 0 if t > 0.05 else 6.0}, end=0.2))


def stored(folder, config):
    """A run in a folder: as new, or from where it stopped."""
    if folder.exists():
        run, first = resumed_run(folder, config)
    else:
        first = am.start(config)
        folder.mkdir()
        run = new_run(folder, config)
        run.take(first)
    last = first
    for last in am.evolve(first, run.config.time):
        run.take(last)
    run.save(last)
    run.write_manifest("finished")
    return np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True)


def test_time_series_has_what_changes_also_of_a_resumed_run(tmp_path):
    changes = {"v_p0": am.steps((0.1, 2.0)), "cue.strength": am.ramp((0, 0), (0.2, 1))}
    config = config_of(changes=changes, end=0.3)
    table = stored(tmp_path / "whole", config)
    assert np.array_equal(table["v_p0"], np.where(table["t"] <= 0.1, 6.0, 2.0))
    assert table["cue_strength"] == pytest.approx(np.minimum(table["t"] / 0.2, 1.0))
    manifest = json.loads((tmp_path / "whole" / "manifest.json").read_text())
    assert manifest["changes"]["v_p0"] == [[0.1, 2.0]]
    assert manifest["units"]["v_p0"] == "L/T"

    stored(tmp_path / "halved", replace(config, time=am.Time(end=0.1)))
    stored(tmp_path / "halved", config)
    texts = [(tmp_path / name / "timeseries.csv").read_text() for name in ("whole", "halved")]
    assert texts[0] == texts[1]
    for other, section in (
        (replace(config, changes={"v_p0": am.steps((0.1, 3.0))}), "changes"),
        (replace(config, cue=am.Cue(direction=(1, 0, 0))), "cue"),
    ):
        with pytest.raises(am.InvalidInput, match=rf"--resume keeps \[{section}\] unchanged"):
            resumed_run(tmp_path / "halved", other)


def test_simulate_takes_changes_and_a_cue(tmp_path):
    p = POLAR.replace(v_p0=5.0)
    inputs = {"changes": {"v_p0": am.steps((0.1, 0.0))}, "cue": am.Cue(strength=0.2)}
    mesh = am.Icosphere(1)
    short = am.simulate(p, mesh=mesh, until=am.time(0.1), progress=False, **inputs)
    whole = am.simulate(p, mesh=mesh, until=am.time(0.2), progress=False, **inputs)
    assert np.array_equal(whole["v_p0"], np.where(whole["t"] <= 0.1, 5.0, 0.0))
    again = short.resume(until=am.time(0.2), progress=False)
    assert np.array_equal(again.final.c, whole.final.c)
    folder = tmp_path / "run"
    am.simulate(p, mesh=mesh, until=am.time(0.1), folder=folder, progress=False, **inputs)
    loaded = am.load(folder).resume(until=am.time(0.2), progress=False)
    assert np.array_equal(loaded.final.c, whole.final.c)
    assert np.array_equal(am.load(folder)["v_p0"], whole["v_p0"])
    static = am.simulate(p, mesh=mesh, until=am.time(0.2), cue=am.Cue(), progress=False)
    assert "v_p0" not in static.units


@pytest.mark.slow
def test_documented_lines_run():
    text = (Path(__file__).parents[1] / "docs" / "inputs.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        scope = {}
        exec(block, scope)  # noqa: S102
        assert scope["solution"].status == "finished"
    for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL):
        assert config_from_toml(block) != am.Config()


def test_reprs_are_short():
    many = am.steps(*((t + 1.0, 0.5 * t) for t in range(1000)))
    for found in (many, Changes({"v_p0": many, "D": math.exp}), am.Cue(strength=0.2)):
        assert len(repr(found)) < 300
