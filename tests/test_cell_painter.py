"""The process that draws a cell: ready before there is one, and never there after the command."""

import io
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from amoeboid.cli.main import main
from amoeboid.config import Config, Mesh
from amoeboid.plotting import cell_painter, cell_process
from amoeboid.plotting.cell import scene
from amoeboid.plotting.cell_painter import CellPainter
from amoeboid.runs import advance
from amoeboid.simulation.loop import start
from command import SHORT

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def archive():
    file = io.BytesIO()
    np.savez(file, **scene(start(Config(mesh=Mesh(subdivisions=1))).cell))
    return file.getvalue()


@pytest.fixture
def started(monkeypatch):
    """The processes that were started, in their order."""
    found, begin = [], cell_painter._started
    monkeypatch.setattr(cell_painter, "_started", lambda: (found.append(begin()), found[-1])[1])
    return found


def test_the_process_is_started_before_the_run_and_gone_after_the_command(
    started, tmp_path, monkeypatch, capsys
):
    before, run = [], advance.advance_in_folder
    monkeypatch.setattr(
        advance, "advance_in_folder", lambda *given: (before.append(len(started)), run(*given))[1]
    )
    assert main(["run", *SHORT, "-o", str(tmp_path / "run")]) == 0
    assert before == [1]
    assert [process.returncode for process in started] == [0]
    assert (tmp_path / "run" / "cell.png").read_bytes().startswith(PNG)
    assert capsys.readouterr().err == ""


def test_a_run_that_fails_leaves_no_process(started, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(advance, "advance_in_folder", fail)
    assert main(["run", *SHORT, "-o", str(tmp_path / "run")]) == 1
    assert [process.poll() is not None for process in started] == [True]


def test_mistakes_start_no_process(started, tmp_path):
    assert main(["run", "--set", "D=-1", "-o", str(tmp_path / "run")]) == 2
    assert started == []


def test_a_picture_is_drawn_where_the_process_was_killed(archive, started):
    with CellPainter() as painter:
        started[0].kill()
        started[0].wait()
        assert painter.picture(archive).startswith(PNG)
    assert len(started) == 2


def test_the_process_of_a_long_run_leaves_and_another_draws(archive, started, monkeypatch):
    monkeypatch.setattr(cell_painter, "MAX_IDLE", 0.01)
    with CellPainter() as painter:
        assert started[0].wait(60) == cell_process.LEFT
        monkeypatch.setattr(cell_painter, "MAX_IDLE", 60.0)
        assert painter.picture(archive).startswith(PNG)
    assert len(started) == 2


def test_the_process_that_leaves_while_it_is_asked_is_replaced(archive, tmp_path, monkeypatch):
    program = tmp_path / "program.py"
    program.write_text(f"import sys; sys.stdin.buffer.read(); sys.exit({cell_process.LEFT})")
    with monkeypatch.context() as patched:
        patched.setattr(cell_process, "__file__", str(program))
        painter = CellPainter().__enter__()
    assert painter.picture(archive).startswith(PNG)


KILLED = """
import sys
from amoeboid.plotting.cell_painter import CellPainter
with CellPainter() as painter:
    print(painter._process.pid, flush=True)
    sys.stdin.readline()
"""


def ended(pid):
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return True
    return stat.rpartition(")")[2].split()[0] == "Z"  # nobody has asked how it ended


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_the_process_ends_when_the_program_is_killed():
    command = [sys.executable, "-c", KILLED]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program:
        pid = int(program.stdout.readline())
        assert not ended(pid)
        program.kill()
    end = time.monotonic() + 60.0
    while not ended(pid) and time.monotonic() < end:
        time.sleep(0.02)
    assert ended(pid)


def ignores_ctrl_c(pid):
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    mask = next(line.split()[1] for line in lines if line.startswith("SigIgn"))
    return bool(int(mask, 16) >> (signal.SIGINT - 1) & 1)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_ctrl_c_is_not_meant_for_a_process_that_waits(archive, started):
    """A terminal sends it to both; the run then ends with a picture of where it stands."""
    with CellPainter() as painter:
        end = time.monotonic() + 60.0
        while not ignores_ctrl_c(started[0].pid) and time.monotonic() < end:
            time.sleep(0.01)
        started[0].send_signal(signal.SIGINT)
        assert painter.picture(archive).startswith(PNG)
    assert len(started) == 1


def test_ctrl_c_while_the_process_starts_does_not_cost_the_picture(archive, started):
    with CellPainter() as painter:
        for _ in range(10):
            started[0].send_signal(signal.SIGINT)
            time.sleep(0.005)
        assert painter.picture(archive).startswith(PNG)
