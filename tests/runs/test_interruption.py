"""Ctrl-C in a script or a notebook: nothing of the run is lost."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import amoeboid as am

P = am.Parameters(D=0.4, v_p0=6.0)
SMALL = am.Icosphere(1)


@pytest.fixture(autouse=True)
def ctrl_c():
    """Ctrl-C as in a script: a job in the background of a shell ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class CtrlC:
    """A writer that presses Ctrl-C at a step, once or more often."""

    def __init__(self, number, times=1):
        self.number, self.times = number, times

    def due(self, step):
        return step.number == self.number

    def write(self, step):
        for _ in range(self.times):
            os.kill(os.getpid(), signal.SIGINT)


def test_the_run_up_to_there_is_in_the_exception_and_goes_on_with_the_same_bits():
    whole = am.simulate(P, mesh=SMALL, until=am.time(1.0))
    with pytest.raises(KeyboardInterrupt, match=r"Solution\(interrupted at t = ") as stop:
        am.simulate(P, mesh=SMALL, until=am.time(1.0), writers=[CtrlC(5)])
    found = stop.value.solution
    assert (found.status, found.last.number) == ("interrupted", 6)
    assert found.rows == whole.rows[:7]
    assert np.array_equal(found.resume(until=am.time(1.0)).final.c, whole.final.c)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_run_in_a_folder_is_complete_up_to_there(tmp_path):
    with pytest.raises(KeyboardInterrupt) as stop:
        am.simulate(P, mesh=SMALL, until=am.time(1.0), folder=tmp_path / "a", writers=[CtrlC(5)])
    run = am.load(tmp_path / "a")
    assert (run.status, run.last.number) == ("interrupted", 6)
    assert stop.value.solution.rows == run.rows
    with pytest.raises(KeyboardInterrupt) as stop:
        run.resume(until=am.time(1.0), writers=[CtrlC(10)])
    assert stop.value.solution.last.number == 11
    whole = am.simulate(P, mesh=SMALL, until=am.time(1.0))
    done = am.load(tmp_path / "a").resume(until=am.time(1.0))
    assert np.array_equal(done.final.c, whole.final.c)


def test_a_second_ctrl_c_ends_it_at_once():
    with pytest.raises(KeyboardInterrupt) as stop:
        am.simulate(P, mesh=SMALL, until=am.time(1.0), writers=[CtrlC(5, times=2)])
    assert not hasattr(stop.value, "solution")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_handlers_of_the_user_and_other_threads_are_left_alone():
    seen, found = [], []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(1))
    try:
        assert am.simulate(P, mesh=SMALL, until=am.time(0.2), writers=[CtrlC(3)]).t[-1] == 0.2
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [1]
    thread = threading.Thread(
        target=lambda: found.append(am.simulate(P, mesh=SMALL, until=am.time(0.1)))
    )
    thread.start()
    thread.join()
    assert found[0].status == "finished"


@pytest.mark.slow
def test_a_script_that_is_interrupted_says_what_there_is():
    code = (
        "import os, signal, sys, amoeboid as am\n"
        "def stop(step):\n"
        "    if step.number == 5: os.kill(os.getpid(), signal.SIGINT)\n"
        "try:\n"
        "    am.simulate(mesh=am.Icosphere(1), until=[stop, am.time(1)])\n"
        "except KeyboardInterrupt as error:\n"
        "    print(error.solution, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("Solution(interrupted at t = ")
    assert "sys.last_value.solution" in done.stdout
