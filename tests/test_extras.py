"""What needs an optional package names it, and the extra that installs it."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from amoeboid.extras import EXTRAS, check, needed, remedy
from amoeboid.meshes.files import surface_file
from amoeboid.meshes.vtp import frame_bytes
from surface.written import ellipsoid, write_surface

ROOT = Path(__file__).parents[1]
# Names of projects where they are not those of their modules.
PROJECTS = {"PIL": "pillow", "vtkmodules": "vtk", "imageio_ffmpeg": "imageio-ffmpeg"}
# What is typed where all optional packages are missing, and the extra that is named.
COMMANDS = {
    "run": "surface",
    "run --resume nowhere": "surface",
    "branch --set D=0.4 --to 8 --mesh 1": "surface",
    "steady --set D=0.4 --plot steady.png": "plot",
    "branch --set D=0.4 --to 8 --plot branch.pdf": "plot",
    "phase-diagram --plot phases.svg": "plot",
    "fit data.csv --free D --plot fit.png": "plot",
    "figure fig3b": "plot",
    "explore --export page.html": "plot",
    "explore --no-browser": "explore",
    "theory --physical --set R0=10um": "units",
    "sweep sweep.toml -o sweep": "data",
    "sweep sweep.toml -o sweep --scheduler 127.0.0.1:1": "dask",
    "motility cell.vtp": "vtk",
}
PROGRAM = f"""
import sys
sys.modules |= dict.fromkeys({[m for modules in EXTRAS.values() for m in modules]!r})
from amoeboid.cli.main import main
for command in {list(COMMANDS)!r}:
    print(main(command.split()), flush=True)
    print(file=sys.stderr, flush=True)
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """The exit code and the message of each command, and the files that they left."""
    folder = tmp_path_factory.mktemp("commands")
    (folder / "sweep.toml").write_text("[vary]\nD = [0.3, 0.4]\n[solver]\nname = 'steady'\n")
    (folder / "data.csv").write_bytes((ROOT / "docs/data/cell.csv").read_bytes())
    write_surface(folder / "cell.vtp", *ellipsoid(2))
    before = set(folder.rglob("*"))
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=folder, capture_output=True, text=True, check=False
    )
    codes, messages = done.stdout.split(), done.stderr.split("\n\n")
    return dict(zip(COMMANDS, zip(codes, messages, strict=False), strict=True)), (
        set(folder.rglob("*")) - before
    )


@pytest.mark.parametrize(("command", "extra"), COMMANDS.items())
def test_command_without_its_extra_names_it(answers, command, extra):
    code, message = answers[0][command]
    assert code == "2"
    assert message.strip().count("\n") == 0
    assert message.strip().startswith(f"amoeboid {command.split()[0]}: ")
    assert message.strip().endswith(f", which is not installed; pip install 'amoeboid[{extra}]'")


def test_commands_without_their_extras_leave_nothing(answers):
    assert not answers[1]


def test_extras_are_those_of_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = project["optional-dependencies"]
    for extra, modules in EXTRAS.items():
        named = {text.partition(">=")[0] for text in declared[extra]}
        assert {PROJECTS.get(module, module) for module in modules} <= named, extra
        assert extra == "gpu" or extra in declared["all"][0]
    assert [text.partition(">=")[0] for text in project["dependencies"]] == ["numpy", "scipy"]


def test_broken_package_is_told_apart_from_a_missing_one(tmp_path, monkeypatch):
    (tmp_path / "emcee.py").write_text("raise ImportError('no such library')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "emcee", raising=False)
    check("the posterior needs", "emcee")
    told = r"^x needs emcee, which cannot be imported \(no such library\); pip install "
    with pytest.raises(am.InvalidInput, match=told):
        needed("emcee", "x needs")


def test_every_extra_has_its_line():
    assert {remedy(extra) for extra in EXTRAS} == {
        f"pip install 'amoeboid[{extra}]'" for extra in EXTRAS
    }


def test_own_surfaces_are_read_without_vtk_as_with_it(tmp_path, monkeypatch):
    r, faces = ellipsoid(2)
    c, flow = np.linspace(1.0, 2.0, len(r)), r[:, ::-1].copy()
    fields = {"c": c, "v": flow}
    numbers = {"t": np.ones(1), "zeta0": np.full(1, 3.0), "other": np.zeros(3)}
    own, other = tmp_path / "own.vtp", tmp_path / "other.vtp"
    own.write_bytes(frame_bytes(r, faces, fields, numbers))
    # the same file in VTK's own words
    write_surface(other, r, faces, fields, {"t": [1.0], "zeta0": [3.0]})
    by_vtk = surface_file(str(other), "a surface")
    monkeypatch.setitem(sys.modules, "vtkmodules", None)
    found = surface_file(str(own), "a surface")
    assert np.array_equal(found.r, by_vtk.r)
    assert np.array_equal(found.faces, by_vtk.faces)
    assert np.array_equal(found.c, by_vtk.c)
    assert found.fields == by_vtk.fields == {"t": 1.0, "zeta0": 3.0}
    assert set(found.vectors) == set(by_vtk.vectors) == {"v"}
    assert np.array_equal(found.vectors["v"], by_vtk.vectors["v"])
    with pytest.raises(am.InvalidInput, match=r"needs VTK, which .*'amoeboid\[vtk\]'"):
        surface_file(str(other), "a surface")
