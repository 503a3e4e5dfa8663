import errno
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from amoeboid.cli.main import COMMANDS, main
from amoeboid.closed_forms.linear import growth_rate
from amoeboid.config import Config, Mesh
from amoeboid.model.parameters import Parameters
from amoeboid.output import frames
from amoeboid.runs.words import stability
from amoeboid.simulation import writers
from amoeboid.simulation.loop import start
from amoeboid.surface.stability import Growth
from amoeboid.surface.steadiness import Rest
from command import SHORT

pytestmark = pytest.mark.usefixtures("without_pictures")

QUICK = ["--set", "mesh.subdivisions=1", "--set", "initial.perturbation=1", "--set", "time.end=1"]
RUN_KEYS = {
    "max_retrograde_speed",
    "c_front",
    "c_rear",
    "zeta0",
    "area_error",
    "steps",
    "wall_s",
    "steady",
    "stability",
    "stability_problem",
    "growth_rate",
    "growth_rate_error",
    "rate_of_change",
    "speed_growth",
    "output",
}
PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
MODULE, FUNCTION = PROJECT["scripts"]["amoeboid"].split(":")
PROGRAM = f"import sys; from {MODULE} import {FUNCTION}; sys.exit({FUNCTION}())"
COMMAND = [sys.executable, "-c", PROGRAM]


def test_json_is_one_object_and_nothing_else(tmp_path, capsys):
    folder = tmp_path / "run"
    assert main(["run", *QUICK, "--json", "-o", str(folder)]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert result.keys() >= RUN_KEYS
    assert result["output"] == str(folder)
    assert result["area_error"] < 1e-12
    assert not result["steady"]
    assert err == ""
    names = {"manifest.json", "config.toml", "timeseries.csv", "frames.pvd", "frames", "cell.png"}
    assert names <= {p.name for p in folder.iterdir()}
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "finished"
    assert manifest["summary"]["steps"] == result["steps"]


def test_a_run_says_first_which_parameters_count(tmp_path, capsys):
    assert main(["run", *QUICK, "--set", "D=0.3", "-o", str(tmp_path / "run")]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first == "D = 0.3, v_p0 = 6, all else as in the paper's table"


def test_summary_names_the_numbers_and_the_folder(tmp_path, capsys):
    assert main(["run", *QUICK, "-o", str(tmp_path / "run")]) == 0
    out = capsys.readouterr().out
    assert "max_retrograde_speed" in out
    assert "end of time at t = 1" in out
    assert "frames.pvd" in out


def test_the_stored_configuration_repeats_the_run(tmp_path, capsys):
    assert main(["run", *QUICK, "--json", "-o", str(tmp_path / "a")]) == 0
    first = json.loads(capsys.readouterr().out)
    assert main(["run", str(tmp_path / "a/config.toml"), "--json", "-o", str(tmp_path / "b")]) == 0
    second = json.loads(capsys.readouterr().out)
    for key in RUN_KEYS - {"wall_s", "output"}:
        assert first[key] == second[key]


def test_resume_goes_on_to_a_later_time(tmp_path, capsys):
    folder = str(tmp_path / "run")
    assert main(["run", *QUICK, "--json", "-o", folder]) == 0
    before = json.loads(capsys.readouterr().out)
    for name in ("cell.png", "trajectory.png"):
        (tmp_path / "run" / name).touch()
    files = {p: p.read_bytes() for p in (tmp_path / "run").rglob("*") if p.is_file()}
    for refused in ([], ["--set", "time.end=0.5"], ["--set", "D=1", "--set", "time.end=2"]):
        assert main(["run", "--resume", folder, *refused]) == 2
    assert "time.end" in capsys.readouterr().err
    # a refusal leaves the finished run as it was
    assert files == {p: p.read_bytes() for p in (tmp_path / "run").rglob("*") if p.is_file()}
    assert main(["run", "--resume", folder, "--set", "time.end=2", "--json"]) == 0
    after = json.loads(capsys.readouterr().out)
    assert after["steps"] > before["steps"]


@pytest.mark.parametrize(
    ("schemes", "end", "longest"),
    [
        (["semi-implicit", "explicit"], ["0.1", "0.101"], 1e-5),
        (["explicit", "semi-implicit"], ["0.001", "2"], 0.5),
    ],
)
def test_the_automatic_step_follows_the_scheme_that_a_run_goes_on_with(
    schemes, end, longest, tmp_path, capsys
):
    folder = tmp_path / "run"
    how = [
        ["--set", f"time.scheme={s}", "--set", f"time.end={t}", "--json"]
        for s, t in zip(schemes, end, strict=True)
    ]
    assert main(["run", *QUICK, *how[0], "-o", str(folder)]) == 0
    before = json.loads(capsys.readouterr().out)["steps"]
    assert main(["run", "--resume", str(folder), *how[1]]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"] - before
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["time"]["max_step"] == longest
    assert steps == 100 if schemes[1] == "explicit" else steps < 60
    # the stored configuration used again, with another scheme
    assert main(["run", str(folder / "config.toml"), *how[0], "-o", str(tmp_path / "new")]) == 0


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("D=1", "[parameters] unchanged, D = 0.4, got 1.0"),
        ("law=inverse", "[parameters] unchanged, law = exponential, got inverse"),
        ("mesh.subdivisions=2", "[mesh] unchanged, subdivisions = 1, got 2"),
        ("initial.seed=4", "[initial] unchanged, seed = 0, got 4"),
    ],
)
def test_what_a_run_was_made_with_is_kept(setting, says, tmp_path, capsys):
    folder = str(tmp_path / "run")
    assert main(["run", *QUICK, "--set", "time.end=0.01", "-o", folder]) == 0
    capsys.readouterr()
    # a value that was automatic and is now given is the same
    same = ["--set", "initial.perturbation=1", "--set", "mesh.subdivisions=1"]
    assert main(["run", "--resume", folder, *same, "--set", setting]) == 2
    err = capsys.readouterr().err
    assert f"--resume keeps {says}; only time.* and output.* may change" in err


def test_letters_that_standard_output_lacks_are_escaped(tmp_path, monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), "ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    folder = tmp_path / "Zellkörper"
    assert main(["run", *QUICK, "--set", "time.end=0.01", "-o", str(folder)]) == 0
    assert "Zellkörper".encode("ascii", "backslashreplace") in stream.buffer.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_terminal_may_lack_letters_of_the_folder(encoding, tmp_path):
    run = [*COMMAND, "run", *QUICK, "--set", "time.end=0.01", "-o", "Zellkörper"]
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    done = subprocess.run(run, capture_output=True, cwd=tmp_path, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert "Zellkörper".encode(encoding, "backslashreplace") in done.stdout


def test_a_run_cannot_go_on_for_less_than_the_shortest_step(tmp_path, capsys):
    folder = str(tmp_path / "run")
    assert main(["run", *QUICK, "-o", folder]) == 0
    capsys.readouterr()
    for end in ("1", "1.00000000001"):
        assert main(["run", "--resume", folder, "--set", f"time.end={end}"]) == 2
        assert "time.end must be > 1.0000001, got 1" in capsys.readouterr().err


@pytest.mark.parametrize("frame", [0, 1, 2])
def test_a_full_disk_is_a_failed_run(frame, tmp_path, monkeypatch, capsys):
    """The first frame, one on the way, and the last."""
    written = []

    def write(path, step):
        written.append(path)
        if len(written) > frame:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_frame(path, step)

    write_frame = frames.write_frame
    monkeypatch.setattr(frames, "write_frame", write)
    folder = tmp_path / "run"
    assert main(["run", *QUICK, "--set", "output.interval=0.6", "--json", "-o", str(folder)]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "No space left" in err
    assert len(written) == frame + 1
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "failed"
    assert "No space left" in manifest["ended"]
    assert len(manifest["frames"]) == frame
    if frame == 0:
        return
    # it goes on from its last frame once there is room
    monkeypatch.setattr(frames, "write_frame", write_frame)
    assert main(["run", "--resume", str(folder), "--json"]) == 0
    assert json.loads((folder / "manifest.json").read_text())["status"] == "finished"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--set", "beta=-1"], "beta must be a finite number >= 0, got -1"),
        (["--set", "D=abc"], "D must be a finite number >= 0, got 'abc'"),
        (["--set", "delta_p=3"], "did you mean delta_P"),
        (["--set", "law=__import__('os')"], "is not allowed"),
        (["--set", "law=inverse", "--set", "c0=0"], "inverse law needs c > 0"),
        (["--set", "initial.perturbation=4"], "initial.perturbation = 4"),
        (["--set", "mesh.subdivisions=0"], "mesh.subdivisions"),
        (["--set", "beta=0", "--set", "D=0", "--set", "v_p0=0"], "nothing would ever change"),
        (["--set", "delta_P=1e308"], "cell at rest"),
        (["--set", "law=-c"], "v_p(c0) >= 0"),
        (["--set", "law=v_p0/\uff43"], "ASCII"),
        (["--set", "law=c#x"], "ASCII"),
        (["--set", "initial.direction=[1e-320,0,0]"], "initial.direction"),
        (["--set", "initial.direction=[1e300,1e300,0]"], "initial.direction"),
        (["--set", f"initial.direction=[1{'0' * 400},0,0]"], "initial.direction"),
        (["--set", f"D=1{'0' * 5000}"], "D must be"),
        (["--set", f"D={'[' * 3000}"], "D must be"),
        (["--set", f"initial.seed=1{'0' * 400}"], "initial.seed"),
        (["--set", ".x=3"], "name=value"),
        (["--set", "time.max_step=1e-8"], "time.max_step must be > 1e-07"),
        (["--set", "time.end=1e-300"], "time.end must be > 1e-07"),
        (["--set", "beta=1e300"], "must be 1e-60 to 1e+60, got 1e+300; choose other units"),
        (["--set", "initial.surface=\udcff.stl"], "initial.surface must be the path of a file"),
        (["missing.toml"], "missing.toml"),
        (["missing.toml/c.toml"], "missing.toml"),
        (["long" * 100], "File name too long"),
        (["-o", "long" * 100], "File name too long"),
        (["--resume", "long" * 100], "File name too long"),
        (["--resume", "missing"], "config.toml"),
        (["--resume", "missing", "-o", "x"], "--resume continues in its own folder"),
    ],
)
def test_user_mistakes_get_one_message_and_exit_code_2(
    arguments, says, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert main(["run", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert err.startswith("amoeboid run: ")
    assert err.count("\n") == 1
    assert len(err) < 6000
    assert list(tmp_path.iterdir()) == []


def test_wrong_files_are_named(tmp_path, capsys):
    path = tmp_path / "c.toml"
    path.write_text("[mesh\n")
    assert main(["run", str(path)]) == 2
    assert f"{str(path)!r} must be valid TOML" in capsys.readouterr().err
    assert main(["run", str(path / "c.toml")]) == 2
    assert "run needs the path of a TOML file" in capsys.readouterr().err
    path.write_text("[parameters]\nD = 'many'\n")
    assert main(["run", str(path)]) == 2
    assert "D must be" in capsys.readouterr().err
    path.write_text("D = " + "[" * 5000)
    assert main(["run", str(path)]) == 2
    assert "valid TOML" in capsys.readouterr().err
    path.write_text(f"[parameters]\nD = 1{'0' * 5000}\n")
    assert main(["run", str(path)]) == 2
    path.write_bytes("[parameters]\nD = -1".encode("utf-8-sig"))
    assert main(["run", str(path)]) == 2
    assert "D must be" in capsys.readouterr().err
    path.write_bytes(b"\xff\xfe\x00")
    assert main(["run", str(path)]) == 2
    assert "UTF-8" in capsys.readouterr().err
    assert main(["run", str(tmp_path)]) == 2


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["walk"],
        ["run", "--speed"],
        ["run", "a", "b"],
        ["run", "-o", ""],
        ["run", "-o", "\udcff"],
    ],
)
def test_unknown_commands_and_options_exit_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(arguments)
    assert leaving.value.code == 2
    assert "usage" in capsys.readouterr().err


def test_help_is_quick_because_it_imports_little():
    """That of all commands, one after another in one process."""
    commands = [[], *([name] for name in COMMANDS)]
    code = (
        "import sys\nfrom amoeboid.cli.main import main\n"
        "heavy = 'numba scipy vtkmodules pyvista matplotlib sympy pint dask'.split()\n"
        f"for command in {commands!r}:\n"
        "    try:\n        main([*command, '--help'])\n"
        "    except SystemExit as e:\n        assert e.code == 0, command\n"
        "    loaded = [name for name in heavy if name in sys.modules]\n"
        "    assert not loaded, (command, loaded)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("usage: amoeboid") == len(commands)


def test_a_run_imports_neither_scipy_nor_other_commands(tmp_path):
    """They take longer to import than a quarter of the default run."""
    code = (
        "import sys\nfrom amoeboid.cli.main import main\n"
        f"assert main({['run', *SHORT, '-o', str(tmp_path / 'run')]!r}) == 0\n"
        "heavy = 'scipy.sparse scipy.linalg scipy.special asyncio amoeboid.cli.fit'.split()\n"
        "loaded = [name for name in heavy if name in sys.modules]\n"
        "assert not loaded, loaded\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_diverging_run_says_so_and_keeps_its_last_good_frame(tmp_path, capsys):
    folder = tmp_path / "run"
    bad = ["time.scheme=explicit", "time.max_step=0.01", "time.end=5", "mesh.subdivisions=1"]
    settings = [word for setting in bad for word in ("--set", setting)]
    assert main(["run", *settings, "--json", "-o", str(folder)]) == 1
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert result["status"] == "diverged"
    assert not result["steady"]
    assert "diverged: at t = " in err
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "diverged"
    assert (folder / manifest["frames"][-1]["file"]).is_file()


@pytest.mark.parametrize(
    "how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_an_interrupted_run_ends_cleanly_and_can_go_on(how, tmp_path):
    folder = tmp_path / "run"
    long = ["--set", "mesh.subdivisions=1", "--set", "time.end=1e6", "--json", "-o", str(folder)]
    run = [*COMMAND, "run", *long, "--set", "time.stop_when_steady=false"]
    with subprocess.Popen(
        run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        deadline = time.monotonic() + 120
        while not (folder / "frames" / "frame_00002.vtp").exists():
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(how)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert json.loads(out)["status"] == "interrupted"
    assert "Traceback" not in err
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "interrupted"
    assert not [name for _, _, files in os.walk(folder) for name in files if "partial" in name]
    end = str(manifest["t"] + 0.5)
    assert main(["run", "--resume", str(folder), "--set", f"time.end={end}", "--json"]) == 0


def test_an_interrupted_run_says_once_when_it_stopped(tmp_path, monkeypatch, capsys):
    @contextmanager
    def stopping(*_):
        presses = iter([signal.SIGINT])  # a second one would end it at once
        yield lambda row: [os.kill(os.getpid(), press) for press in presses]

    monkeypatch.setattr("amoeboid.runs.progress.reported", stopping)
    words = ["--set", "mesh.subdivisions=1", "-o", str(tmp_path / "run")]
    assert main(["run", *words]) == 130
    out, err = capsys.readouterr()
    assert f"amoeboid run: to continue: amoeboid run --resume {tmp_path / 'run'}\n" in err
    last = [line for line in out.splitlines() if " steps, " in line]
    assert len(last) == 1
    assert re.fullmatch(r"interrupted at t = \S+, \d+ steps, \S+ s", last[0])


# Ctrl-C when a module is looked for, in a callback whose exceptions Python ignores.
CTRL_C_AT = """
import os, signal, sys
from {module} import {function}

class Dying:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(10):
            pass

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            Dying()

sys.meta_path.insert(0, Finder())
signal.signal(signal.SIGINT, {handler})
sys.exit({function}())
"""


def with_ctrl_c_at(name, *words, handler="signal.default_int_handler"):
    code = CTRL_C_AT.format(module=MODULE, function=FUNCTION, name=name, handler=handler)
    return subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "name",
    [
        "amoeboid.cli.main",
        "amoeboid.cli.run",
        "numpy",
        pytest.param("numba", marks=pytest.mark.slow),
        "amoeboid.output.folder",
    ],
)
def test_ctrl_c_during_imports_ends_the_program_quietly(name, tmp_path):
    """An exception would be lost in such a place, and the program would go on."""
    run = ["run", *QUICK, "--set", "time.end=0.01", "-o", str(tmp_path / "run")]
    done = with_ctrl_c_at(name, *run)
    assert (done.returncode, done.stdout) == (130, ""), done.stderr
    assert done.stderr == "amoeboid: interrupted\n"
    assert not (tmp_path / "run").exists()


def test_where_ctrl_c_is_ignored_it_stays_so():
    """As in the background of a shell."""
    done = with_ctrl_c_at("amoeboid.cli.main", "theory", handler="signal.SIG_IGN")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        (
            Rest(0.0, Growth(-0.51234, 0.013)),
            "steady and stable: its slowest perturbation decays at 0.512 +- 0.01 per unit time",
        ),
        (
            Rest(0.0, Growth(0.004, 0.001)),
            "steady but unstable: a perturbation grows slowly, at 0.004 +- 0.001 per",
        ),
        (
            Rest(0.0, Growth(0.2, 0.01)),
            "unstable: its fastest perturbation grows at 0.2 +- 0.01 per unit time",
        ),
        (
            Rest(0.0, Growth(None, problem="no step converges")),
            "steady, but its stability is unknown: no step converges",
        ),
        (
            Rest(0.0, Growth(-0.2, 0.5)),
            "steady, but its stability is unknown: the growth rate of the fastest perturbation, "
            "-0.2 per unit time, is known only to +- 0.5",
        ),
        (
            Rest(-200.0, Growth(0.2, 0.01)),
            "steady, but its stability is unknown: a growth rate of 0.2 per unit time is predicted",
        ),
        (None, "not steady: it still changes"),
    ],
)
def test_a_run_reports_the_stability_of_its_last_state(rest, words):
    step = replace(start(Config(mesh=Mesh(subdivisions=1))), rest=rest)
    assert words in stability(step)


def test_the_growth_rate_is_told_and_kept(tmp_path, capsys):
    folder = tmp_path / "run"
    run = ["run", "--set", "mesh.subdivisions=1", "--set", "v_p0=5", "-o", str(folder)]
    assert main(run) == 0
    assert "slowest perturbation decays at 0." in " ".join(capsys.readouterr().out.split())
    summary = json.loads((folder / "manifest.json").read_text())["summary"]
    assert summary["steady"]
    # lambda_1 of the homogeneous cell at the default D, on a mesh of 42 nodes
    assert summary["growth_rate"] == pytest.approx(
        growth_rate(Parameters(D=0.4, v_p0=5.0), 1), rel=0.05
    )


def test_a_run_that_is_not_steady_says_how_fast_it_changes_and_how_to_go_on(tmp_path, capsys):
    """A small polarization grows at lambda_1 of the linear theory, on 42 nodes within 10 %."""
    p, folder = Parameters(D=0.03, v_p0=6.0), tmp_path / "run"
    settings = ["D=0.03", "v_p0=6", "initial.perturbation=1e-3", "mesh.subdivisions=1"]
    run = ["run", *(w for s in settings for w in ("--set", s)), "--set", "time.end=2"]
    assert main([*run, "-o", str(folder)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    summary = json.loads((folder / "manifest.json").read_text())["summary"]
    assert not summary["steady"]
    assert summary["speed_growth"] == pytest.approx(growth_rate(p, 1), rel=0.1)
    # the change of c in units of c0 at the poles, where it is the largest
    polarity = 0.5 * (summary["c_rear"] - summary["c_front"]) / summary["c_rear"]
    assert summary["rate_of_change"] == pytest.approx(polarity * growth_rate(p, 1), rel=0.15)
    assert f"changes at a relative rate of {summary['rate_of_change']:.3g}" in text
    assert f"grows at {summary['speed_growth']:.3g} per unit time" in text
    hint = re.search(r"to continue: amoeboid (run --resume \S+ --set time\.end=4)", text)
    assert hint is not None
    assert main([*hint[1].split(), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["speed_growth"] > 0


def test_a_decaying_cell_is_said_to_decay(tmp_path, capsys):
    run = ["run", "--set", "v_p0=4", *QUICK, "-o", str(tmp_path / "run")]
    assert main(run) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "the state is not steady" in text
    assert "max_retrograde_speed falls at" in text


UNITS = {
    # lengths in um, times in s, masses such that pressures are in Pa: the cell of the paper
    "um": "R0=10 delta_P=300 eta_s=2700 eta_b=2700 c0=1370 c_r=972.55 beta=0.1 D=0.03 v_p0=1.7",
    # the same in R0, 1/beta, eta_s/beta and c_r R0^2
    "R0": "R0=1 delta_P=11.11111111111111 eta_s=1 eta_b=1 c0=1.408667934810549 c_r=1 beta=1 "
    "D=0.003 v_p0=1.7",
}


def test_a_run_of_defaults_is_the_same_in_all_units(tmp_path, capsys):
    """The start, steps, and times of frames; the cell of the paper keeps its polarization."""
    found = {}
    for name, settings in UNITS.items():
        end = f"time.end={40 if name == 'um' else 4}"
        words = [w for s in (*settings.split(), end) for w in ("--set", s)]
        run = ["run", *words, "--set", "mesh.subdivisions=1", "--json", "-o", str(tmp_path / name)]
        assert main(run) == 0
        summary = json.loads(capsys.readouterr().out)
        manifest = json.loads((tmp_path / name / "manifest.json").read_text())
        p = manifest["parameters"]
        assert manifest["initial"]["perturbation"] == p["c0"]
        found[name] = [
            summary["max_retrograde_speed"] / (p["R0"] * p["beta"]),
            summary["c_front"] / p["c_r"],
            summary["c_rear"] / p["c_r"],
            summary["zeta0"] / (p["eta_s"] * p["beta"]),
            summary["steps"],
            summary["rate_of_change"] / p["beta"],
            manifest["t"] * p["beta"],
            manifest["frames"][-2]["t"] * p["beta"],
        ]
    print(found)
    assert found["um"][2] > 1.2 * found["um"][1]
    np.testing.assert_allclose(found["um"], found["R0"], rtol=1e-5)


@pytest.mark.parametrize("settings", ["c0=2", "c0=0.5 v_p0=3", "law=inverse D=0.03 v_p0=1.7"])
def test_the_default_start_suits_the_concentration_and_the_law(settings, tmp_path, capsys):
    words = [w for s in settings.split() for w in ("--set", s)]
    run = ["run", *words, "--set", "mesh.subdivisions=1", "--set", "time.end=0.2", "--json"]
    assert main([*run, "-o", str(tmp_path / "run")]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["c_rear"] > 1.2 * summary["c_front"]


def test_whatever_ends_a_run_is_in_its_manifest(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    for error, status in ((MemoryError("no room"), "failed"), (KeyboardInterrupt(), "interrupted")):

        def fail(*_, error=error):
            raise error

        monkeypatch.setattr(writers, "between", fail)
        run = ["run", *QUICK, "--set", "output.interval=0.01", "-o", str(folder)]
        if status == "failed":
            with pytest.raises(MemoryError):
                main(run)
        else:
            assert main(run) == 130
        assert json.loads((folder / "manifest.json").read_text())["status"] == status
        shutil.rmtree(folder)


def test_python_m_amoeboid_is_the_command():
    run = [sys.executable, "-m", "amoeboid", "--version"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("amoeboid ")
