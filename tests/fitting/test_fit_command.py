"""`amoeboid fit`, and the lines of docs/fitting.md."""

import json
import re
import sys
from pathlib import Path

import pandas
import pytest

import amoeboid as am
from amoeboid.cli.main import main

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "fitting.md").read_text(encoding="utf-8")
DATA = DOCS / "data/cell.csv"
PLAIN = ["--set", "D=0.4", "--set", "v_p0=6.3", "--starts", "1"]


@pytest.fixture
def plain(tmp_path):
    path = tmp_path / "plain.csv"
    data = am.synthetic(am.Parameters(D=0.4, v_p0=6.0), {"u": 0.04, "c": 0.3})
    pandas.DataFrame(data).to_csv(path, index=False)
    return path


def test_a_fit_is_printed_as_a_table_and_as_json(plain, tmp_path, capsys):
    picture = tmp_path / "fit.png"
    words = ["fit", str(plain), "--free", "v_p0", *PLAIN, "--plot", str(picture)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert re.search(r"Fit to u, c: chi2 = \d+\.\d+, 35 dof", out)
    assert re.search(r"v_p0 +5\.\d+ +0\.\d+ +\d", out)
    assert picture.stat().st_size > 1000
    words[3] = "D,v_p0"
    assert main([*words[:-2], "--json", "--bounds", "D=0.2:0.8"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert set(document["estimates"]) == {"D", "v_p0"}
    entry = document["estimates"]["v_p0"]
    assert entry["low"] < 6.0 < entry["high"]
    assert document["undetermined"] == []


def test_wrong_input_is_one_message_and_exit_code_2(plain, tmp_path, capsys):
    bad = tmp_path / "bad.csv"
    bad.write_text("theta [deg],u\n30,0.1\n60,much\n")
    number = tmp_path / "number.csv"
    number.write_text("zeta0,zeta0_error\n155,1\n")
    for words, message in (
        ([str(bad), "--free", "D"], "line 3, column 'u': must be a number, got 'much'"),
        ([str(tmp_path / "none.csv"), "--free", "D"], "No such file"),
        ([str(number), "--free", "D", "--plot", "a.png"], "--plot draws profiles"),
        ([str(plain), "--free", "D,E"], "unknown parameter 'E'"),
        ([str(plain), "--free", "D", "--bounds", "D=3"], "--bounds takes NAME=LOW:HIGH"),
        ([str(plain), "--free", "D", "--bounds", "D=1:2"], "must enclose its start"),
        ([str(plain), "--free", "D", "--level", "95"], "--level must be a number between 0 and 1"),
        ([str(plain), "--free", "D", "--set", "v_p0=2"], "stable polarized steady state"),
    ):
        assert main(["fit", *words]) == 2, words
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.out == ""
        assert captured.err.count("\n") == 1


def test_the_posterior_names_its_extra(monkeypatch):
    data = am.synthetic(am.Parameters(D=0.4, v_p0=6.0), {"u": 0.04})
    found = am.fit(data, ["v_p0"], am.Parameters(D=0.4, v_p0=6.0), starts=1)
    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(am.InvalidInput, match=r"pip install 'amoeboid\[posterior\]'"):
        found.posterior()


@pytest.mark.slow
def test_the_lines_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(DOCS.parent)
    names = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(block, "docs/fitting.md", "exec"), names)  # noqa: S102  (our own file)
    out = capsys.readouterr().out
    said = [line.partition("  # ")[2] for line in PAGE.splitlines() if "print(" in line]
    assert said
    assert all(text in out for text in said if text), out
    for command in re.findall(r"```sh\n(.*?)```", PAGE, flags=re.DOTALL):
        for line in command.strip().splitlines():
            words = [w.strip('"') for w in re.findall(r'"[^"]*"|\S+', line)]
            assert words[0] == "amoeboid"
            assert main(words[1:]) == 0


@pytest.mark.slow
def test_the_data_of_the_page_are_made_by_its_lines(tmp_path, monkeypatch):
    block = next(b for b in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "to_csv" in b)
    monkeypatch.chdir(tmp_path)
    Path("docs/data").mkdir(parents=True)
    exec(compile(block, "docs/fitting.md", "exec"), {})  # noqa: S102  (our own file)
    made, kept = (pandas.read_csv(path) for path in ("docs/data/cell.csv", DATA))
    pandas.testing.assert_frame_equal(made, kept, rtol=1e-4)
