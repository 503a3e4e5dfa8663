"""Sweeps on processes, threads and clusters: the same bits as one point after the other."""

import functools
import multiprocessing
import os
import subprocess
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from sweeps import solvers

POINTS = am.grid(v_p0={"linspace": [1, 9, 30]})


def same(found, points=POINTS, solver=solvers.square):
    """Whether a sweep has the bits of a serial one."""
    return found.rows == am.sweep(points, solver).rows and found.complete


def test_processes_of_our_own_give_the_same_bits():
    assert same(am.sweep(POINTS, solvers.square, workers=2))


@pytest.mark.slow
def test_executors_of_the_user_are_used_and_left_open():
    with ThreadPoolExecutor(2) as threads:
        assert same(am.sweep(POINTS, solvers.square, executor=threads))
        assert threads.submit(int, 3).result() == 3
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("forkserver")) as processes:
        assert same(am.sweep(POINTS, solvers.square, executor=processes, points_per_task=7))
        assert processes.submit(int, 3).result() == 3


def test_warnings_of_threads_stay_with_their_points():
    points = am.grid(v_p0=[3, 4, 5, 6])
    with ThreadPoolExecutor(3) as threads:
        found = am.sweep(points, solvers.picky, executor=threads)
    assert found["warnings"].values.tolist() == ["", "", "a guess", ""]


def test_a_worker_that_dies_costs_its_point_a_retry_and_is_then_named():
    found = am.sweep(am.grid(v_p0=[3, 4, 5, 6, 7]), solvers.deadly, workers=2)
    assert found.counts == {"ok": 4, "failed": 1}
    assert found.failed[0].values == {"v_p0": 5.0}
    assert found.failed[0].why == "lost twice: the worker ended"
    assert found["value"].values[[0, 1, 3, 4]].tolist() == [9, 16, 36, 49]


@pytest.mark.slow
def test_a_point_that_is_lost_once_has_its_answer_in_the_end(tmp_path, monkeypatch):
    monkeypatch.setenv("AMOEBOID_TEST_MARK", str(tmp_path / "mark"))
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as processes:
        found = am.sweep(am.grid(v_p0=[4, 5, 6]), solvers.deadly_once, executor=processes)
    assert found.complete
    assert found["value"].values.tolist() == [16, 25, 36]


@pytest.mark.slow
def test_a_lost_point_is_tried_again_in_the_next_call(tmp_path, monkeypatch):
    points, folder = am.grid(v_p0=[4, 5, 6]), tmp_path / "a"
    monkeypatch.setenv("AMOEBOID_TEST_MARK", str(tmp_path / "nowhere" / "mark"))  # never made
    found = am.sweep(points, solvers.deadly_once, workers=1, folder=folder)
    assert found.counts == {"ok": 2, "failed": 1}
    (tmp_path / "nowhere").mkdir()
    (tmp_path / "nowhere" / "mark").touch()
    assert am.sweep(points, solvers.deadly_once, folder=folder).complete


def test_a_worker_has_one_thread_for_linear_algebra(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    found = am.sweep(am.grid(v_p0=[1, 2]), solvers.threads, workers=1)
    assert found["value"].values.tolist() == [1, 1]


def test_workers_that_cannot_have_the_solver_are_told_at_once():
    class Broken(ThreadPoolExecutor):
        def submit(self, *_):
            future = Future()
            future.set_exception(ModuleNotFoundError("No module named 'amoeboid'"))
            return future

    with pytest.raises(am.InvalidInput, match="workers must be able to evaluate points"):
        am.sweep(POINTS, solvers.square, executor=Broken(1))


class Jobs:
    """An executor as that of submitit: its futures are of a class of their own."""

    def submit(self, function, *arguments):
        """A job that is done a little later."""
        return Job(functools.partial(function, *arguments))


class Job:
    """What `submit` gives: `done` and `result`."""

    def __init__(self, call):
        self.call, self.at = call, time.monotonic() + 0.01

    def done(self):
        """Whether it is done."""
        return time.monotonic() > self.at

    def result(self):
        """What it gave."""
        return self.call()


def test_futures_of_other_kinds_serve_as_well():
    assert same(am.sweep(POINTS, solvers.square, executor=Jobs(), points_per_task=10))


@pytest.mark.slow
def test_submitit_runs_a_sweep(tmp_path, monkeypatch):
    submitit = pytest.importorskip("submitit", reason="submitit is not installed")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
    jobs = submitit.AutoExecutor(folder=tmp_path, cluster="local")
    points = am.grid(v_p0=[1, 2, 3])
    assert same(am.sweep(points, solvers.square, executor=jobs, points_per_task=2), points)


class ClientExecutor:
    """As that of Dask, with a client that computes at once."""

    def __init__(self):
        self._client, self._kwargs, self.sizes = self, {"pure": True}, []

    def nthreads(self):
        """Threads by worker."""
        return {"one": 1, "two": 1}

    def submit(self, function, solver, cells, *, pure):
        """A future that is done; tasks that are tried again must not have the key of the first."""
        assert pure is False
        self.sizes.append(len(cells))
        future = Future()
        future.set_result(function(solver, cells))
        return future


def test_dask_gets_single_points_until_their_time_is_known_and_then_tasks_that_become_smaller():
    executor, points = ClientExecutor(), am.grid(v_p0={"linspace": [1, 9, 200]})
    assert same(am.sweep(points, solvers.square, executor=executor), points)
    assert executor.sizes[:4] == [1] * 4  # two for each of two workers
    assert executor.sizes[4:] == sorted(executor.sizes[4:], reverse=True)
    assert executor.sizes[4] == (200 - 4) // 8
    assert len(executor.sizes) < 50


@pytest.mark.slow
def test_dask_gives_the_same_bits():
    distributed = pytest.importorskip("distributed", reason="distributed is not installed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )
    with cluster, distributed.Client(cluster) as client:
        assert same(am.sweep(POINTS, solvers.square, executor=client.get_executor()))
        points = am.grid(am.Parameters(D=0.4), v_p0=np.linspace(5, 6, 4))
        found = am.sweep(points, am.steady_states, executor=client.get_executor())
        assert same(found, points, am.steady_states)


KILLING = """
import dask
import amoeboid as am
from distributed import Client, LocalCluster
from sweeps import solvers

if __name__ == "__main__":
    dask.config.set({"distributed.scheduler.allowed-failures": 0})
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        points = am.grid(v_p0=[3, 4, 5, 6])
        print(am.sweep(points, solvers.deadly, executor=client.get_executor()))
"""


@pytest.mark.slow
def test_dask_names_a_point_that_ends_its_workers(tmp_path):
    pytest.importorskip("distributed", reason="distributed is not installed")
    script = tmp_path / "script.py"
    script.write_text(KILLING)
    env = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    found = subprocess.run(
        [sys.executable, str(script)], env=env, capture_output=True, text=True, check=True
    )
    heading, *failures = found.stdout.splitlines()
    assert heading.endswith(": 1 failed, 3 ok")
    assert failures[0].startswith("- v_p0 = 5: lost twice: KilledWorker: ")
