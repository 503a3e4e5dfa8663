"""Observables of a script of the user on the command line: `--observe SCRIPT.py:NAME`."""

import json

import pytest

import amoeboid as am
from amoeboid.cli import scripts
from amoeboid.cli.main import main
from command import SHORT

pytestmark = pytest.mark.usefixtures("without_pictures")

SCRIPT = """
import numpy as np
import amoeboid as am
import beside

@am.observable("N/L^2")
def rms_c(cell):
    return np.sqrt(cell.integral(cell.c**2) / cell.area)

@am.observable("L", on_meshes=True)
def longest_edge(cell):
    return beside.longest(cell.x[cell.faces])
"""
BESIDE = """
import numpy as np

def longest(corners):
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
"""


@pytest.fixture
def script(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(SCRIPT)
    (tmp_path / "beside.py").write_text(BESIDE)
    saved = dict(am.OBSERVABLES)
    yield tmp_path / "mine.py"
    am.OBSERVABLES.clear()
    am.OBSERVABLES.update(saved)
    scripts._run.cache_clear()


def test_observables_of_a_script_are_columns_of_a_run_and_of_tables(script, monkeypatch, capsys):
    monkeypatch.setattr("amoeboid.cli.run._draw", lambda *_: None)  # takes processes
    assert main(["run", *SHORT, "--json", "-o", "a", "--observe", "mine.py:longest_edge"]) == 0
    run = am.load("a")
    assert run.units["rms_c"] == "N/L^2"  # all that the script registers
    assert 0.5 < run["longest_edge"][-1] < 1.0
    capsys.readouterr()
    words = ["--set", "v_p0=6", "--set", "D=0.4", "--json", "--observe", f"{script}:rms_c"]
    assert main(["steady", *words]) == 0
    assert json.loads(capsys.readouterr().out)["states"][-1]["rms_c"] > 3.0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("mine.py", "add the name"),
        ("mine.py:", "SCRIPT.py:NAME"),
        ("mine.txt:rms_c", "SCRIPT.py:NAME"),
        ("mine.py:__import__('os')", "SCRIPT.py:NAME"),
        ("other.py:rms_c", "is not a file"),
        ("mine.py:rms_v", "must register the observable 'rms_v'"),
        ("broken.py:a", "raised ZeroDivisionError: division by zero"),
        ("wrong.py:a", "raised SyntaxError"),
        ("rms_v", "unknown observable"),
    ],
)
def test_what_is_no_observable_of_a_script_is_refused_in_one_line(script, words, says, capsys):
    script.with_name("broken.py").write_text("1 / 0")
    script.with_name("wrong.py").write_text("def")
    assert main(["run", *SHORT, "-o", "a", "--observe", words]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert not script.with_name("a").exists()
