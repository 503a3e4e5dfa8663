"""The README's commands and Python lines do what they say, on a small mesh."""

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


def test_the_python_lines_of_the_readme_run(capsys):
    simulation, theory = [block for kind, block in BLOCKS if kind == "python"]
    exec(compile(simulation, "README.md", "exec"), {})  # noqa: S102  (our own file)
    said = capsys.readouterr().out
    assert said.startswith("Solution(steady at t = 10.94, 48 steps, 642 nodes)\n1.830")
    assert said.splitlines()[0] in simulation
    exec(compile(theory, "README.md", "exec"), {})  # noqa: S102
    assert "1.83417" in capsys.readouterr().out


def test_the_readme_has_its_two_lines():
    lines = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
    setups = [line for line in lines if line.startswith("python3 -m venv")]
    assert len(setups) == 2
    assert setups[0].endswith("amoeboid run")
    assert setups[1].endswith("pytest")
