"""SWEEP.toml: what its tables make, and what they refuse."""

import json
from pathlib import Path

import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.sweeps.document import sweep_document

THEORY = '[solver]\nname = "theory"\n'
VARY = "[vary]\nv_p0 = [4, 6]\n"


def document(text):
    return sweep_document(text, "a.toml", Path())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("solver = 3\n" + VARY, r"\[solver\] must be a table, got 3"),
        (VARY, r"a sweep needs a table \[solver\] with a name \(theory, steady"),
        (THEORY, r"needs a table \[vary\] with names and values, got none"),
        ("vary = 3\n" + THEORY, r"\[vary\] must be a table of names and values, got 3"),
        ("physical = 1\n" + VARY + THEORY, r"\[base\]: physical must be true or false, got 1"),
        (
            VARY + '[sobol]\ncount = 2\n[refine]\nlabel = "x"\n' + THEORY,
            r"must have \[sobol\] or \[refine\], not both",
        ),
        (
            "[[vary]]\nv_p0 = 4\n[sobol]\ncount = 2\n" + THEORY,
            r"\[\[vary\]\] lists the points; leave out \[sobol\] and \[refine\]",
        ),
        (
            "[[vary]]\nv_p0 = 4\n[[vary]]\nD = 4\n" + THEORY,
            r"the same names each time, v_p0; number 2 has D",
        ),
        (VARY + '[solver]\nname = "motility"\nin = 3\n', r"an environment such as 'fluid', got 3"),
        (VARY + '[solver]\nname = "steady"\nmany = 3\n', r"many must be true or false, got 3"),
        (
            VARY + '[solver]\nname = "steady"\nmax_modes = 9\n',
            r"max_modes needs many = true; leave one of them out",
        ),
    ],
)
def test_what_a_document_lacks_or_has_too_much_is_named(text, message):
    with pytest.raises(am.InvalidInput, match=message):
        document(text)


def test_points_one_by_one_are_in_the_order_of_the_file():
    points = document("[[vary]]\nv_p0 = 6\nD = 0.4\n[[vary]]\nD = 0.2\nv_p0 = 4\n" + THEORY).points
    cells = [points.cell(k) for k in range(len(points))]
    assert [(p.v_p0, p.D) for p in cells] == [(6.0, 0.4), (4.0, 0.2)]


def test_a_branch_on_a_mesh_has_the_mesh_of_its_document():
    text = '[vary]\nD = [0.3]\n[solver]\nname = "branch"\nfrom = 4\nto = 7\nmesh = 2\n'
    solver = document(text).solver
    assert (solver.keywords["mesh"], solver.keywords["name"]) == (am.Icosphere(2), "v_p0")
    assert (solver.keywords["start"], solver.keywords["end"]) == (4, 7)


def test_points_are_counted_without_computing_any(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(VARY + THEORY)
    assert main(["sweep", "a.toml", "--dry-run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"points": 2}
    Path("b.toml").write_text(VARY + '[refine]\nlabel = "bifurcation"\n' + THEORY)
    assert main(["sweep", "b.toml", "--dry-run"]) == 0
    assert capsys.readouterr().out == "2 points and more where the label changes\n"
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml", "b.toml"]


def test_many_failures_are_counted_and_results_are_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    negative = ", ".join(f"-{k}" for k in range(1, 40))
    Path("a.toml").write_text(f"[vary]\nc0 = [3, 2, {negative}]\n" + THEORY)
    words = ["sweep", "a.toml", "--plot", "a.png", "--show", "threshold", "--workers", "1"]
    assert main(words) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "41 points: 39 failed, 2 ok; a"
    told = sum(line.startswith("failed: ") for line in out)
    assert out[-1] == f"... and {39 - told} more, see `why` in the table"
    assert Path("a.png").stat().st_size > 5000


def test_the_folder_of_a_sweep_is_not_its_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(VARY + THEORY)
    assert main(["sweep", "a.toml", "-o", "a.toml"]) == 2
    assert "the folder must differ from the file" in capsys.readouterr().err
    assert main(["sweep", "a.toml", "--merge", "a"]) == 2
    assert "--merge takes only the folder" in capsys.readouterr().err
