"""Runs with shot noise: what is reproducible, what is refused, and the heading of a cell."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.model.parameters import DIMENSIONS
from amoeboid.runs.persistence import of_headings, sampled
from unit_systems import SI

POLAR = am.Parameters(D=0.4, v_p0=6.0)
NOISE = am.Noise(filaments=1e4, seed=3)


def run(p=POLAR, noise=NOISE, end=0.4, **others):
    return am.simulate(p, mesh=am.Icosphere(1), noise=noise, until=am.time(end / p.rate), **others)


def same(a, b):
    return all(
        np.array_equal(getattr(a.last.state, f), getattr(b.last.state, f))
        for f in ("r", "c", "position")
    )


@pytest.fixture(scope="module")
def whole():
    return run()


def test_run_is_a_function_of_its_seed(whole):
    assert same(run(), whole)
    assert not same(run(noise=replace(NOISE, seed=4)), whole)
    assert whole["noise_kept"].min() >= 0.0
    assert whole["dt"][4:-1] == pytest.approx(0.05 / POLAR.rate)
    assert whole.last.stability == "unknown"
    assert whole.last.stability_problem == "shot noise changes the cell until the end of the run"


def test_run_without_filaments_to_count_is_that_without_noise():
    quiet = run(noise=am.Noise(seed=5))
    assert same(quiet, run(noise=None))
    assert "noise_kept" not in quiet.units


def test_resumed_run_is_the_uninterrupted_one_bit_for_bit(whole, tmp_path):
    def halfway(step):
        return step.number == 5

    half = am.simulate(
        POLAR, mesh=am.Icosphere(1), noise=NOISE, until=[halfway, am.time(0.4)],
        folder=tmp_path / "run",
    )  # fmt: skip
    assert half.last.number == 5
    in_memory = half.resume(until=am.time(0.4))
    in_folder = am.load(tmp_path / "run").resume(until=am.time(0.4))
    for again in (in_memory, in_folder):
        assert same(again, whole)
        assert np.array_equal(again["noise_kept"], whole["noise_kept"])


def test_command_runs_with_noise_and_keeps_it_when_it_resumes(tmp_path, capsys):
    short = ["--set", "mesh.subdivisions=1", "--set", "time.end=0.2"]
    noise = ["--set", "noise.filaments=1e4", "--set", "noise.seed=3"]
    folder = str(tmp_path / "run")
    assert main(["run", "-o", folder, *short, *noise]) == 0
    assert main(["run", "--resume", folder, "--set", "time.end=0.4"]) == 0
    assert main(["run", "--resume", folder, "--set", "noise.seed=4"]) == 2
    assert "--resume keeps [noise] unchanged, seed = 3, got 4" in capsys.readouterr().err
    assert am.load(folder).config.noise == NOISE


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ({"time": {"scheme": "explicit"}}, 'time.scheme must be "semi-implicit" with shot noise'),
        ({"time": {"finish": "solve"}}, 'time.finish must be "wait" with shot noise'),
        ({"parameters": {"c0": 0.0}}, "c0 must be > 0 with shot noise"),
        ({"noise": {"filaments": -1.0}}, "noise.filaments must be a finite number >= 0"),
    ],
)
def test_what_noise_does_not_go_with_is_refused(section, says):
    from amoeboid.config import configured, resolved

    with pytest.raises(am.InvalidInput, match=says):
        resolved(configured(am.Config(noise=NOISE), section))


def test_waiting_for_a_steady_cell_is_refused(whole):
    for wait in (lambda: run(until=am.steady()), lambda: whole.resume(until=am.steady())):
        with pytest.raises((am.InvalidInput, TypeError), match="until"):
            wait()
    with pytest.raises(am.InvalidInput, match=r"until must not be steady\(\) with shot noise"):
        am.simulate(POLAR, noise=NOISE, until=am.steady())
    with pytest.raises(am.InvalidInput, match=r"noise must be amoeboid\.Noise"):
        am.simulate(POLAR, noise=1e4)


def test_noise_is_the_same_in_all_units(whole):
    values = {name: getattr(POLAR, name) / SI.of(of) for name, of in DIMENSIONS.items()}
    other = run(am.Parameters(**values))
    assert other.last.number == whole.last.number
    c = other.last.state.c * SI.of("N/L^2")
    assert c == pytest.approx(whole.last.state.c, rel=1e-7)


def test_filaments_of_a_cell_with_units_are_counted():
    cell = am.Parameters.physical(R0="5 um", c0="1000/um^2")
    found = am.Noise.counted(cell, 2)
    assert found.filaments == pytest.approx(4 * np.pi * 25 * 1000, rel=1e-12)
    assert found.seed == 2
    with pytest.raises(am.InvalidInput, match=r"start from Parameters\.physical"):
        am.Noise.counted(POLAR)


def test_path_in_an_environment_and_persistence_of_a_noisy_run():
    found = run(environment="matrix", end=1.0).persistence(lag=0.1, after=0.2)
    assert found.pairs == 7
    assert 0.0 < found.rotational_diffusion_error < found.rotational_diffusion < 5.0
    assert found.time == pytest.approx(0.5 / found.rotational_diffusion)


def walk(D, dt, count, seed, turn=0.0):
    """Headings (30, count, 3) of random walks on the sphere, turning about z."""
    rng = np.random.default_rng(seed)
    u = np.empty((count, 30, 3))
    u[0] = [1, 0, 0]
    for k in range(1, count):
        turned = np.sqrt(2 * D * dt) * rng.normal(size=(30, 3)) + [0, 0, turn * dt]
        u[k] = u[k - 1] + np.cross(turned, u[k - 1])
        u[k] /= np.linalg.norm(u[k], axis=1)[:, None]
    return np.swapaxes(u, 0, 1)


def test_persistence_of_a_random_walk_is_that_of_its_diffusion():
    D, dt, lag = 0.3, 2e-3, 0.1
    t = dt * np.arange(2001)
    several = [sampled(t, u, lag) for u in walk(D, dt, len(t), 1)]
    found = of_headings(POLAR, several, lag)
    print(found, found.turning, found.turning_error)
    assert abs(found.rotational_diffusion - D) < 3 * found.rotational_diffusion_error
    assert found.rotational_diffusion_error < 0.05 * D
    assert abs(found.time - 1 / (2 * D)) < 3 * found.time_error
    assert not found.turns
    lags = np.asarray(found.lags)[:6]
    assert found.autocorrelation[:6] == pytest.approx(np.exp(-2 * D * lags), abs=0.1)


def test_a_steady_turn_is_told_from_a_random_walk():
    dt, lag = 2e-3, 0.1
    t = dt * np.arange(1001)
    found = of_headings(
        POLAR, [sampled(t, u, lag) for u in walk(1e-4, dt, len(t), 4, turn=0.5)], lag
    )
    assert found.turns
    assert found.turning == pytest.approx([0, 0, np.sin(0.5 * lag) / lag], abs=0.01)


def test_persistence_of_too_few_headings_is_refused(whole):
    with pytest.raises(am.InvalidInput, match="at least 4 pairs of headings"):
        whole.persistence(lag=0.2, after=0.0)
    with pytest.raises(am.InvalidInput, match="lag must be > 0"):
        whole.persistence(lag=-1.0)
    other = run(POLAR.replace(D=0.3), end=0.1)
    with pytest.raises(am.InvalidInput, match="must have the same parameters"):
        am.persistence([whole, other])


@pytest.mark.slow
def test_the_lines_of_the_page_run(tmp_path, monkeypatch):
    page = (Path(__file__).parents[2] / "docs/noise.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    command, section, lines = (
        re.search(rf"```{kind}\n(.*?)```", page, flags=re.DOTALL).group(1)
        for kind in ("bash", "toml", "python")
    )
    words = [*shlex.split(command)[1:], "--set", "mesh.subdivisions=1", "--set", "time.end=0.1"]
    assert main(words) == 0
    assert am.load("noisy").config.noise == am.config_from_toml(section).noise
    names = {}
    exec(compile(lines, "docs/noise.md", "exec"), names)  # noqa: S102  (our own file)
    assert names["runs"][0].ended == "end of time"
