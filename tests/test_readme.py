"""The README's commands and Python lines do what they say, on a small mesh."""

import doctest
import re
import shlex
from pathlib import Path

import pytest

from amoeboid.cli.main import main
from amoeboid.config import Config, Mesh
from amoeboid.output.frames import write_frame
from amoeboid.simulation.loop import start
from surface.written import ellipsoid, write_surface

pytestmark = pytest.mark.usefixtures("without_pictures")

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, flags=re.DOTALL)
COMMANDS = [
    shlex.split(line, comments=True)[1:]
    for kind, block in BLOCKS
    for line in block.splitlines()
    if kind == "sh" and line.startswith("amoeboid ")
]
RUNS = [c for c in COMMANDS if c[0] == "run" and "--resume" not in c and "--help" not in c]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that the README's commands name."""
    monkeypatch.chdir(tmp_path)
    write_surface(tmp_path / "cell.stl", *ellipsoid())
    (tmp_path / "amoeboid-run/frames").mkdir(parents=True)
    write_frame(
        tmp_path / "amoeboid-run/frames/frame_00010.vtp", start(Config(mesh=Mesh(subdivisions=2)))
    )
    return tmp_path


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("arguments", RUNS, ids=" ".join)
def test_runs_of_the_readme_finish(arguments):
    assert main([*arguments, "--set", "mesh.subdivisions=1", "--json"]) == 0


def test_the_python_lines_of_the_readme_print_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    session, theory = [block for kind, block in BLOCKS if kind == "python"]
    lines = doctest.DocTestParser().get_doctest(session, {}, "README.md", "README.md", 0)
    result = doctest.DocTestRunner().run(lines)
    assert result.attempted == 15
    assert result.failed == 0, capsys.readouterr().out
    exec(compile(theory, "README.md", "exec"), {})  # noqa: S102  (our own file)
    assert f"# {capsys.readouterr().out}" in theory


def test_the_readme_installs_runs_and_tests_in_a_line_each():
    lines = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
    setups = [line for line in lines if line.startswith("python3 -m venv")]
    assert [line.split()[-1].rpartition("/")[2] for line in setups] == ["python", "run", "pytest"]


def test_every_command_of_the_readme_is_one_line():
    starts = {"amoeboid", "python3"}
    lines = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
    assert {line.split()[0] for line in lines} == starts
