"""Sweeps: two processes and two workers of Dask against one; memory; many processes at once.

    python -m benchmarks.sweep speed [POINTS]       200 points: ratios of times, the same bits
    python -m benchmarks.sweep memory [RUNS]        1000 short 3D runs: resident memory
    python -m benchmarks.sweep start [PROCESSES]    20 processes on an empty folder of kernels

A ratio of times is that of one call; other programs on the machine change it. The ratio of
processor times is changed less: twice that of the serial sweep over that of all processes together.
So many times as fast two processors that nobody else uses are, up to the last task, of 0.5 s or one
point. Two processes include their start and imports; of Dask, the cluster is there before, and its
workers import the package in a first sweep ("new"), not in a second one ("used"). Dask also works
while nobody asks it to; the processor time of that, per second, is that of a cluster left alone. On
a machine that others use, a sweep takes more seconds and so more of it. Two loops without a sweep,
each with half of the points, show what two processors of the machine do; two that share a core do
less than twice as much as one.
"""

from __future__ import annotations

import functools
import json
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import amoeboid as am

P = am.Parameters(D=0.4)
SHORT = functools.partial(am.simulate, mesh=am.Icosphere(1), until=am.time(0.2), progress=False)
ALONE = 5.0  # seconds in which a cluster of Dask has nothing to do
SETTINGS = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "2s",
}
WARM = 50  # runs after which memory is looked at for the first time


@contextmanager
def dask_workers(count: int, settings: Mapping[str, Any]):
    """An executor on workers of Dask, each with one thread, and the numbers of their processes."""
    import dask
    from distributed import Client, LocalCluster

    with dask.config.set(settings):
        cluster = LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=50
        )
        with cluster, Client(cluster) as client:
            yield client.get_executor(), tuple(client.run(os.getpid).values())


def looped(speeds: Sequence[float]) -> None:
    """The points one after the other, without a sweep."""
    for v_p0 in speeds:
        am.theory(P.replace(v_p0=v_p0))


def side_by_side(speeds: Any) -> float:
    """Seconds that two processes take for half of the points each: what the machine can do."""
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(looped, [speeds[:1], speeds[-1:]]))  # starts and imports
        begun = time.monotonic()
        list(pool.map(looped, [speeds[::2], speeds[1::2]]))
        return time.monotonic() - begun


def processor_time(others: Iterable[int] = ()) -> float:
    """Seconds of processor time: of this process, of all it made that ended, and of others."""
    times = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    own = sum(t.ru_utime + t.ru_stime for t in times)
    return own + sum(_processor_time_of(pid) for pid in others)


def _processor_time_of(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def speed(count: int = 200) -> dict[str, object]:
    """Times of a serial sweep, of two processes and of two workers of Dask, and their ratios."""
    speeds = np.linspace(3, 8, count)
    points = am.grid(P, v_p0=speeds)
    am.theory(P)  # its imports are no part of the serial time
    seconds: dict[str, float] = {}
    busy: dict[str, float] = {}
    rows = []

    def timed(name: str, others: Iterable[int] = (), **how: Any) -> None:
        before, begun = processor_time(others), time.monotonic()
        rows.append(am.sweep(points, am.theory, progress=False, **how).rows)
        seconds[name] = time.monotonic() - begun
        busy[name] = processor_time(others) - before

    timed("serial")
    timed("two processes", workers=2)
    alone = {}
    for kind, settings in (("", {}), (", as docs/sweeps.md sets them", SETTINGS)):
        with dask_workers(2, settings) as (executor, pids):
            before = processor_time(pids)
            time.sleep(ALONE)
            alone[f"two Dask workers{kind}"] = (processor_time(pids) - before) / ALONE
            for name in ("two new Dask workers", "two used Dask workers"):
                timed(name + kind, pids, executor=executor)
    loops = side_by_side(speeds)
    assert all(found == rows[0] for found in rows)
    others = [name for name in seconds if name != "serial"]
    return {
        "points": count,
        "seconds": seconds,
        "processor_seconds": busy,
        "serial_over": {name: seconds["serial"] / seconds[name] for name in others},
        "by_processor_time": {name: 2 * busy["serial"] / busy[name] for name in others},
        "dask_alone": alone,
        "two_loops_without_a_sweep": seconds["serial"] / loops,
        "same_bits": True,
        "load": os.getloadavg()[0],
    }


def resident() -> float:
    """Resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory(runs: int = 1000) -> dict[str, object]:
    """Resident memory along short 3D runs of one process [MB], ten times on the way."""
    seen: list[float] = []

    def look(done: int, total: int) -> None:
        if done >= WARM and done % max(1, total // 10) == 0:
            seen.append(round(resident(), 1))
            print(f"{done} runs: {seen[-1]} MB", file=sys.stderr, flush=True)

    found = am.sweep(am.grid(P, v_p0=np.linspace(3, 8, runs)), SHORT, progress=look)
    assert found.counts == {"ok": runs}
    grown = (seen[-1] - seen[0]) / (runs - WARM) * 1e3
    return {"runs": runs, "resident_MB": seen, "growth_kB_per_run": grown}


def start(processes: int = 20) -> dict[str, object]:
    """Processes that start at once, and find no kernels compiled."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        begun = time.monotonic()
        points = am.grid(P, v_p0=np.linspace(3, 8, processes))
        found = am.sweep(points, SHORT, workers=processes, points_per_task=1)
        kernels = [p.name for p in Path(folder).rglob("*") if p.is_file()]
        return {
            "processes": processes,
            "counts": found.counts,
            "seconds": time.monotonic() - begun,
            "files_of_kernels": len(kernels),
        }


if __name__ == "__main__":
    task = {"speed": speed, "memory": memory, "start": start}[sys.argv[1]]
    print(json.dumps(task(*map(int, sys.argv[2:]))))
