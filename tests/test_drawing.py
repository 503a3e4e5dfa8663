"""Pictures are drawn after the results, and do not depend on what else a machine is set up for."""

import json
import os
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from amoeboid.cli.main import main
from amoeboid.config import Config, Mesh
from amoeboid.meshes.connectivity import icosphere
from amoeboid.model.parameters import Parameters
from amoeboid.plotting import canvas, cell, cell_painter, cell_process
from amoeboid.plotting.branches import write_states
from amoeboid.plotting.palette import COLOR_MAP
from amoeboid.plotting.trajectory import save_trajectory_picture
from amoeboid.simulation.loop import start
from amoeboid.studies.states import steady_states
from command import COMMAND, SHORT

DYING = "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n"


def drawn_by(code, tmp_path, monkeypatch):
    program = tmp_path / "program.py"
    program.write_text(code)
    monkeypatch.setattr(cell_process, "__file__", str(program))


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (DYING, "SIGSEGV"),
        ("raise SystemExit('no screen [here]')", "code 1: no screen [here]"),
        ("import time; time.sleep(60)", "took more than 0.5 s"),
        ("", "code 0"),
    ],
)
def test_a_cell_that_cannot_be_drawn_costs_the_picture_alone(
    code, says, tmp_path, monkeypatch, capsys
):
    drawn_by(code, tmp_path, monkeypatch)
    if "sleep" in code:
        monkeypatch.setattr(cell_painter, "MAX_DRAWING", 0.5)
    folder = tmp_path / "run"
    assert main(["run", *SHORT, "--json", "-o", str(folder)]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["status"] == "finished"
    assert err.startswith(f"amoeboid run: the picture {str(folder / 'cell.png')!r} could not be")
    assert says in err
    assert "ParaView opens the frames" in err
    assert err.count("\n") == 1
    assert not [p for p in folder.rglob("*") if "png" in p.name]


def test_pictures_need_neither_a_screen_nor_a_graphics_library(tmp_path):
    """What draws the cell imports numpy and Pillow alone, which is also why it is quick."""
    code = """
import sys
import numpy as np
import amoeboid.plotting.cell_picture
from amoeboid.plotting.canvas import Canvas
Canvas(8, 8, np.eye(3), np.zeros(3), 1.0).image()
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    packages = {name.partition(".")[0] for name in done.stdout.split()}
    assert {"numpy", "PIL"} <= packages
    assert not packages & {"matplotlib", "pyvista", "vtkmodules", "vtk", "scipy", "numba"}


def test_a_cell_is_drawn(tmp_path):
    path = tmp_path / "cell.png"
    cell.save_cell_picture(path, start(Config(mesh=Mesh(subdivisions=1))))
    assert path.stat().st_size > 20000
    assert list(tmp_path.iterdir()) == [path]


def test_colors_of_cells_are_those_of_other_pictures():
    values = np.linspace(0.0, 1.0, 256)
    theirs = 255 * matplotlib.colormaps[COLOR_MAP](values)[:, :3]
    np.testing.assert_allclose(canvas.colors(values), theirs, atol=0.6)


def test_what_lies_in_front_covers_what_lies_behind(tmp_path):
    """A sphere of one color, with an arrow in front of it and another behind it."""
    r, faces = icosphere(2)
    axes = tuple(np.eye(3))
    seen = []
    for height in (1.2, -1.2):
        picture = canvas.Canvas(200, 200, axes, np.zeros(3), 2.0)
        picture.surface(r, r, faces, np.zeros(len(r)))
        picture.arrows(np.array([[-0.5, 0.0, height]]), np.array([[1.0, 0.0, 0.0]]), "#000000")
        picture.save(tmp_path / "a.png")
        seen.append(imread(tmp_path / "a.png")[100, 100, :3].max())
    assert seen[0] < 0.1
    assert seen[1] > 0.9
    area = np.mean(imread(tmp_path / "a.png")[..., 2] < 0.99)
    assert area == pytest.approx(np.pi / 16, rel=0.03)  # of a disc of radius 1 in a square of 4


def user_settings():
    return matplotlib.rc_context(
        {"text.usetex": True, "font.size": 30, "savefig.dpi": 20, "lines.linewidth": 9}
    )


@pytest.mark.parametrize(
    "suffix", [".svg", *(pytest.param(x, marks=pytest.mark.slow) for x in (".png", ".pdf"))]
)
def test_figures_do_not_depend_on_the_settings_of_the_user(suffix, tmp_path):
    states = steady_states(Parameters(), (1,))
    way = [[0.1 * k, 0.2 * k, 0.001 * k * k] for k in range(40)]
    files = [tmp_path / f"{k}{suffix}" for k in range(4)]
    write_states(states, files[0])
    save_trajectory_picture(files[1], range(40), way, 1.0)
    with user_settings():
        write_states(states, files[2])
        save_trajectory_picture(files[3], range(40), way, 1.0)
        assert matplotlib.rcParams["text.usetex"]
    assert files[0].read_bytes() == files[2].read_bytes()
    assert files[1].read_bytes() == files[3].read_bytes()


@pytest.mark.parametrize(
    "backend",
    [
        pytest.param("module://matplotlib_inline.backend_inline", marks=pytest.mark.slow),
        "nowhere",
    ],
)
def test_the_environment_of_a_notebook_does_not_matter(backend, tmp_path):
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nbackend: nowhere\nnonsense: 3\n")
    done = subprocess.run(
        [*COMMAND, "steady", "--json", "--plot", "a.png"],
        cwd=tmp_path, env=os.environ | {"MPLBACKEND": backend},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert len(json.loads(done.stdout)["states"]) == 2
    assert (tmp_path / "a.png").stat().st_size > 5000


@pytest.mark.parametrize("arguments", [[], ["--json"]])
def test_results_are_printed_where_a_picture_fails(arguments, tmp_path, monkeypatch, capsys):
    def fail(*_):
        raise ValueError("no font [/bold]\nfor this")

    monkeypatch.setattr("amoeboid.plotting.branches.write_states", fail)
    path = tmp_path / "a.png"
    path.write_bytes(b"an older picture")
    assert main(["steady", *arguments, "--plot", str(path)]) == 1
    out, err = capsys.readouterr()
    assert "0.3417" in out
    message = f"the picture {str(path)!r} could not be drawn: no font [/bold] for this"
    assert err == f"amoeboid steady: {message}\n"
    assert path.read_bytes() == b"an older picture"


def test_places_that_take_no_picture_are_refused_at_once(tmp_path, monkeypatch, capsys):
    (tmp_path / "folder.png").mkdir()
    for name, says in [
        ("folder.png", "is a folder"),
        ("", "--plot must end in .png, .pdf, .svg"),
        ("a.jpg", "--plot must end in .png, .pdf, .svg"),
        ("no/a.png", "existing folder"),
    ]:
        path = tmp_path / name if name else tmp_path
        assert main(["steady", "--plot", str(path)]) == 2
        assert says in capsys.readouterr().err
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert main(["branch", "--to", "8", "--plot", str(tmp_path / "a.png")]) == 2
    assert "writable folder" in capsys.readouterr().err
