"""docs/figures.md: its Python lines run, and its commands are taken as they stand."""

import re
import shlex
from pathlib import Path

import pytest

from amoeboid import figures
from amoeboid.cli.main import main

PAGE = (Path(__file__).parents[2] / "docs" / "figures.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", PAGE, flags=re.DOTALL)
COMMANDS = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]


@pytest.mark.parametrize("number", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_python_lines_of_the_page_run_and_leave_their_files(number, tmp_path, monkeypatch):
    from matplotlib import pyplot

    monkeypatch.chdir(tmp_path)
    block = [code for kind, code in BLOCKS if kind == "python"][number]
    exec(compile(block, "docs/figures.md", "exec"), {"__name__": "page"})  # noqa: S102  (our own)
    pyplot.close("all")
    name = ["fig2b", "own"][number]
    made = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {f"{name}.png"} < made
    assert any(file.endswith(".csv") for file in made)


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_of_the_page_ask_for_figures_that_exist(command, tmp_path, monkeypatch, capsys):
    """With the figures themselves left out: they are made where the gallery is tested."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("amoeboid.cli.figure._made", lambda *_: ({}, 0))
    assert main(shlex.split(command)[1:]) == 0
    asked = set(shlex.split(command)[2:]) & set(figures.names())
    assert asked or "all" in command or command == "amoeboid figure"
    capsys.readouterr()
