"""Commands and Python lines of README and first session do what they say, on a small mesh."""

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

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
FIRST_SESSION = (ROOT / "docs/first-session.md").read_text(encoding="utf-8")
BLOCKS, SESSION = (
    re.findall(r"```(\w+)\n(.*?)```", page, flags=re.DOTALL) for page in (README, FIRST_SESSION)
)
COMMANDS = [
    shlex.split(line, comments=True)[1:]
    for kind, block in BLOCKS + SESSION
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
def test_runs_of_the_readme_are_possible(arguments):
    """To the time that they state, or to the first hundredth of a turnover."""
    end = "time.end=0.1 s" if "--physical" in arguments else "time.end=0.01"
    words = ["run", "--set", end, *arguments[1:], "--set", "mesh.subdivisions=1", "--json"]
    assert main(words) == 0


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("arguments", RUNS, ids=" ".join)
def test_runs_of_the_readme_finish(arguments):
    assert main([*arguments, "--set", "mesh.subdivisions=1", "--json"]) == 0


def test_the_python_lines_of_the_readme_print_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (five,) = [block for kind, block in BLOCKS if kind == "python"]
    assert checked(five, capsys) == 5


def test_the_python_lines_of_the_first_session_print_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    session, theory = [block for kind, block in SESSION if kind == "python"]
    assert checked(session, capsys) == 15
    exec(compile(theory, "first-session.md", "exec"), {})  # noqa: S102  (our own file)
    assert f"# {capsys.readouterr().out}" in theory


def checked(session, capsys):
    """How many lines a session has; all of them print what it says."""
    lines = doctest.DocTestParser().get_doctest(session, {}, "session", "session", 0)
    result = doctest.DocTestRunner().run(lines)
    assert result.failed == 0, capsys.readouterr().out
    return result.attempted


def test_the_readme_is_one_screen():
    assert len(README.splitlines()) <= 70


def test_the_readme_installs_runs_and_tests_in_a_line_each():
    lines = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines()]
    setups = [line for line in lines if line.startswith("python3 -m venv")]
    assert [line.split()[-1].rpartition("/")[2] for line in setups] == ["run", "pytest"]


def test_every_command_of_readme_and_first_session_is_one_line():
    starts = {"amoeboid", "python3"}
    lines = [
        line for kind, block in BLOCKS + SESSION if kind == "sh" for line in block.splitlines()
    ]
    assert {line.split()[0] for line in lines} == starts
