"""One thread for linear algebra within a call, and the user's own number outside it."""

import os
import subprocess
import sys
from threading import Thread

import pytest

PROGRAM = """
from threadpoolctl import threadpool_info, threadpool_limits
import numpy, scipy.linalg
import amoeboid as am
from amoeboid.simulation.loop import evolve, start

def counts():
    return {found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}

class Seen:
    counts = []

threadpool_limits(limits=2, user_api="blas")
found = [counts()]
def watched(step):
    inside = steady(step)
    Seen.counts.append(counts())
    return inside
steady = am.time(0.05)
am.simulate(mesh=am.Icosphere(1), until=watched)
am.steady_states(am.Parameters(D=0.4), (1,), watch=lambda step: Seen.counts.append(counts()))
found.append(counts())
steps = evolve(start(am.Config(mesh=am.Mesh(subdivisions=1))), am.Time(end=0.1))
next(steps)
found.append(counts())
print(found, set(map(frozenset, Seen.counts)))
"""


def threads(**environment):
    kept = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=kept | environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="the libraries have one thread anyway")
def test_a_call_takes_one_thread_and_leaves_the_number_of_the_user():
    assert threads() == "[{2}, {2}, {2}] {frozenset({1})}"


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="the libraries have one thread anyway")
def test_a_number_of_threads_in_the_environment_is_kept():
    assert threads(OMP_NUM_THREADS="2") == "[{2}, {2}, {2}] {frozenset({2})}"


def test_calls_in_several_threads_of_python_end_with_what_was_before(monkeypatch):
    """The last to end restores it, not each what it found."""
    from amoeboid.threads import VARIABLES, _OneThread

    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    log = []

    class Limit:
        def restore_original_limits(self):
            log.append("restored")

    class Libraries:
        def limit(self, **limits):
            log.append(limits["limits"])
            return Limit()

    one = _OneThread()
    one._libraries = dict.fromkeys((False, True), Libraries())
    with one:
        thread = Thread(target=one.__enter__)
        thread.start()
        thread.join()
    assert log == [1]
    one.__exit__()
    assert log == [1, "restored"]


LATER = """
import sys
from threadpoolctl import threadpool_info
from amoeboid.threads import one_thread

def counts():
    return [found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"]

import numpy
before = set(counts())
with one_thread:
    assert "scipy.linalg" not in sys.modules
    print(set(counts()))
    import scipy.linalg
    with one_thread:
        print(set(counts()))
print(set(counts()) == before)
"""


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="the libraries have one thread anyway")
def test_the_library_of_scipy_is_not_loaded_and_limited_once_it_is():
    kept = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", LATER], env=kept, capture_output=True, text=True)
    assert done.stdout.split() == ["{1}", "{1}", "True"], done.stderr
