"""Every block of docs/sweeps.md does what it says."""

import json
import re
import shlex
from pathlib import Path

import pytest

from amoeboid.cli.main import main

PAGE = (Path(__file__).parents[2] / "docs/sweeps.md").read_text(encoding="utf-8")


def blocks(language, text):
    """The blocks of code of a language."""
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def run_blocks(text, names):
    """Run blocks of Python one after the other."""
    for block in blocks("python", text):
        exec(compile(block, "docs/sweeps.md", "exec"), names)  # noqa: S102  (our own file)


@pytest.mark.slow
def test_the_python_lines_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    run_blocks(PAGE.partition("## Dask")[0], names)
    out = capsys.readouterr().out
    assert "Sweep of steady_states at 6 points (3 x 2)" in out
    assert "\n3.0\n" in out
    assert "(D = -1: D must be a finite number >= 0, got -1.0,)" in out
    assert "('v_p0', 'step')" in out
    assert re.search(r"^True$", out, flags=re.MULTILINE)
    edges = names["edges"].dataset.sortby("v_p0")
    assert f"print(len(edges))  # {len(names['edges'])} points" in PAGE
    single = edges.v_p0.values[edges.n_states.values == 1].max()
    several = edges.v_p0.values[edges.n_states.values == 3].min()
    assert single < 5.20960 < several == single + 1 / 16


@pytest.mark.slow
def test_the_lines_of_dask_run(capsys):
    pytest.importorskip("distributed", reason="distributed is not installed")
    import amoeboid as am

    text = PAGE.partition("## Dask")[2].partition("## The command line")[0]
    run_blocks(text, {"__name__": "__main__", "am": am, "p": am.Parameters(D=0.4)})
    assert "Sweep of theory at 2 points" in capsys.readouterr().out


@pytest.mark.slow
def test_the_commands_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (document,) = blocks("toml", PAGE)
    Path("phases.toml").write_text(document)
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "1")
    outputs = []
    lines = [line for block in blocks("sh", PAGE) for line in block.splitlines()]
    for line in [line for line in lines if line.startswith("amoeboid ")]:
        words = shlex.split(line.replace("$SLURM_ARRAY_TASK_ID", "1"))
        assert main(words[1:]) == 0
        outputs.append(capsys.readouterr().out)
    assert outputs[0] == "6 points\n"
    assert outputs[1] == "6 points: 6 ok; phases\n"
    assert json.loads(outputs[2]) == {
        "output": "phases", "done": 6, "failed": [], "incomplete": 0, "missing": 0,
    }  # fmt: skip
    assert Path("phases.png").stat().st_size > 1000
    kept = re.findall(r"^\| `([a-z]\S+)` \|", PAGE.partition("| file |")[2], flags=re.MULTILINE)
    for name in kept[:3]:
        assert list(Path("phases").glob(name))
