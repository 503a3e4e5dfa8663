"""`amoeboid sweep`."""

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

import amoeboid as am
from amoeboid.cli.main import main
from command import COMMAND

DOCUMENT = """
[base]
D = 0.4
law = "v_p0/(1 + (c/c_r)**n)"
"law.n" = 2

[vary]
v_p0 = [6]
law.n = [1, 3]
c0 = [3, -1]

[solver]
name = "theory"

[record]
names = ["threshold"]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Commands write here."""
    monkeypatch.chdir(tmp_path)


def write(text, name="a.toml"):
    """A file of a sweep."""
    Path(name).write_text(text)
    return name


def test_impossible_points_are_named_and_the_command_has_finished(capsys):
    assert main(["sweep", write(DOCUMENT), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["output"], found["done"]) == ("a", 2)
    assert len(found["failed"]) == 2
    why = "c0 must be a finite number >= 0, got -1.0"
    assert found["failed"][0] == {"v_p0": 6.0, "law.n": 1.0, "c0": -1.0, "why": why}
    assert main(["sweep", "a.toml"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "4 points: 2 failed, 2 ok; a"
    assert out[1] == f"failed: v_p0 = 6, law.n = 1, c0 = -1: {why}"
    p = am.Parameters(D=0.4, v_p0=6).replace(law="v_p0/(1 + (c/c_r)**n)", **{"law.n": 3})
    single = am.theory(p).threshold
    table = am.load_sweep("a")["threshold"].sel(v_p0=6, c0=3, **{"law.n": 3})
    assert table.item() == single


def test_shards_are_merged(capsys):
    write(DOCUMENT)
    assert main(["sweep", "a.toml", "--shard", "2/2"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "4 points: 2 failed, 2 missing; a"
    assert main(["sweep", "--merge", "a", "--json"]) == 1
    told = capsys.readouterr()
    assert json.loads(told.out)["missing"] == 2
    assert "2 of 4 points are missing" in told.err
    assert main(["sweep", "a.toml", "--shard", "1/2"]) == 0
    assert main(["sweep", "--merge", "a"]) == 0
    merged = Path("a/sweep.nc").read_bytes()
    assert main(["sweep", "a.toml", "-o", "b"]) == 0
    assert Path("b/sweep.nc").read_bytes() == merged


def test_runs_are_configured_by_their_sections():
    text = "[vary]\ncue.strength = [0.0, 0.2]\n[base]\nD = 0.4\nv_p0 = 6\n[solver]\n"
    text += 'name = "simulate"\nmesh.subdivisions = 1\ntime.end = 0.2\n'
    assert main(["sweep", write(text)]) == 0
    config = am.Config(
        parameters=am.Parameters(D=0.4, v_p0=6),
        mesh=am.Mesh(subdivisions=1),
        time=am.Time(end=0.2),
        cue=am.Cue(strength=0.2),
    )
    expected = am.simulate(config).final.c_rear
    assert am.load_sweep("a")["c_rear"].values[1] == expected


@pytest.mark.slow
def test_a_branch_and_pairs_and_units():
    text = 'physical = true\n[base]\nD = "1 um^2/s"\n[[vary]]\ndelta_P = "100 Pa"\n[[vary]]\n'
    text += 'delta_P = "300 Pa"\n[solver]\nname = "branch"\nto = "2.2 um/s"\nmax_step = 0.4\n'
    assert main(["sweep", write(text)]) == 0
    found = am.load_sweep("a")
    cell = am.Parameters.physical(D="1 um^2/s", delta_P="100 Pa")
    single = am.branch(cell, "v_p0", 0, "2.2 um/s", max_step=0.4)
    assert found["delta_P"].values == pytest.approx([100, 300])
    threshold = single.thresholds[0].to("um/s").magnitude
    assert found["threshold_v_p0"].values[0].item() == pytest.approx(threshold)
    assert found["v_p0"].attrs["units"] == "um/s"


def test_motility_is_that_of_the_fastest_stable_state():
    text = '[base]\nD = 0.4\n[vary]\nv_p0 = [6]\n[solver]\nname = "motility"\nin = "patch:30"\n'
    assert main(["sweep", write(text)]) == 0
    state = am.steady_states(am.Parameters(D=0.4, v_p0=6), (1,)).fastest_stable
    assert am.load_sweep("a")["speed"].item() == am.migrate(state, "patch:30").speed


def test_random_points_and_refinement(capsys):
    text = '[vary]\nD = [0.03, 0.6]\n[solver]\nname = "theory"\n[sobol]\ncount = 5\nseed = 3\n'
    assert main(["sweep", write(text), "--dry-run"]) == 0
    assert capsys.readouterr().out == "5 points\n"
    text = text.replace(
        "[sobol]\ncount = 5\nseed = 3", '[refine]\nlabel = "bifurcation"\ndepth = 2'
    )
    assert main(["sweep", write(text)]) == 0
    found = am.load_sweep("a").dataset.sortby("D")
    turns = found.D.values[found.bifurcation.values == "subcritical"].min()
    before = found.D.values[found.bifurcation.values == "supercritical"].max()
    assert turns - before == pytest.approx(0.57 / 4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[solver]", "[solvr]", "unknown table 'solvr' of a sweep"),
        ('name = "theory"', 'name = "theorie"', r"\[solver\] name must be one of theory, steady"),
        ('name = "theory"', 'name = "theory"\nx = 1', r"unknown key 'x' in \[solver\] theory"),
        ('name = "theory"', 'name = "steady"\ndegrees = [0]', r"\[solver\] degrees must be whole"),
        ('name = "theory"', 'name = "branch"', r"\[solver\] to must be given"),
        (
            'name = "theory"',
            'name = "simulate"\nmesh.size = 1',
            r"\[solver\]: unknown field 'size'",
        ),
        ('name = "theory"', 'name = "motility"\nin = "air"', r"\[solver\]: "),
        ("D = 0.4", "E = 0.4", r"\[base\]: unknown parameter 'E'"),
        ("c0 = [3, -1]", "c0 = 3", r"\[vary\]: the values of c0 must be a list"),
        ("c0 = [3, -1]", "c0 = {linspace = 3}", r"\[vary\]: linspace of c0 must be"),
        ("[vary]", "[sobol]\nseed = 1\n[vary]", r"\[sobol\] needs count"),
        ("[vary]", "[refine]\nlabel = 3\n[vary]", r"\[refine\]: label must be a name"),
        ("c0 = [3, -1]", "c0 = [[3, -1]]", r"\[vary\]: c0 must be a number"),
        ("law.n = [1, 3]", "law.m = [1, 3]", r"\[vary\]: the law .* has no parameter 'm'"),
        ("c0 = [3, -1]", "mesh.subdivisions = [1]", "mesh.subdivisions with 'theory'; leave"),
        (
            'name = "theory"',
            'name = "branch"\nto = 7\nmax_step = "x"',
            r"\[solver\]: max_step must",
        ),
        (
            'name = "theory"',
            'name = "branch"\nto = 7\nmax_points = 0',
            "max_points must be a whole",
        ),
        ("[vary]", "[sobol]\ncount = 0\n[vary]", r"\[sobol\]: count must be a whole number"),
        ("[vary]", "[sobol]\ncount = 2\nseed = -1\n[vary]", r"\[sobol\]: seed must be a whole"),
        (
            "[vary]\nv_p0 = [6]\nlaw.n = [1, 3]\nc0 = [3, -1]",
            "[[vary]]",
            r"\[\[vary\]\] must be tables",
        ),
        ('names = ["threshold"]', 'names = "x"', r"\[record\] names must be a list of names"),
        ("[base]", "[base", "'a.toml' must be valid TOML"),
    ],
)
def test_a_wrong_file_is_refused_by_table_and_key(old, new, message, capsys):
    assert old in DOCUMENT
    assert main(["sweep", write(DOCUMENT.replace(old, new, 1))]) == 2
    err = capsys.readouterr().err
    assert err.startswith("amoeboid sweep: ")
    assert re.search(message, err)
    assert os.listdir() == ["a.toml"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "needs SWEEP.toml"),
        (["nowhere.toml"], "No such file"),
        (["a.toml", "--workers", "0"], "--workers must be >= 1"),
        (["--merge", "nowhere"], "must have a sweep.json"),
        (["a.toml", "-o", "."], "must be new, empty"),
        (["a.toml", "--plot", "x.txt"], "--plot must end in"),
    ],
)
def test_a_wrong_command_is_refused(arguments, message, capsys):
    write(DOCUMENT)
    assert main(["sweep", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_wrong_shard_is_refused(capsys):
    for text in ("0/3", "4/3", "1", "a/b"):
        with pytest.raises(SystemExit):
            main(["sweep", write(DOCUMENT), "--shard", text])
        assert "must be K/N" in capsys.readouterr().err


@pytest.mark.slow
def test_ctrl_c_says_how_to_go_on():
    text = '[vary]\nD = {linspace = [0.1, 0.6, 500]}\n[solver]\nname = "theory"\n'
    process = subprocess.Popen(
        [*COMMAND, "sweep", write(text)], stderr=subprocess.PIPE, stdout=subprocess.PIPE
    )
    results = Path("a/results/1-of-1.jsonl")
    while process.poll() is None and not (results.exists() and results.stat().st_size):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert (process.returncode, out) == (130, b"")
    assert b"finished points are kept in 'a'; the same command continues" in err
    assert 0 < am.load_sweep("a").done < 500


@pytest.mark.slow
def test_nobody_at_an_address_is_told():
    pytest.importorskip("distributed", reason="distributed is not installed")
    words = ["sweep", write(DOCUMENT), "--scheduler", "tcp://127.0.0.1:9"]
    found = subprocess.run([*COMMAND, *words], capture_output=True, check=False)
    assert found.returncode == 2
    assert b"--scheduler must be the address" in found.stderr
    assert b"Traceback" not in found.stderr
