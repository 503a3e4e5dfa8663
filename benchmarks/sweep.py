"""Sweeps: two processes and two workers of Dask against one; memory; many processes at once.

    python -m benchmarks.sweep speed [POINTS]       200 points: ratios of times, the same bits
    python -m benchmarks.sweep memory [RUNS]        1000 short 3D runs: resident memory
    python -m benchmarks.sweep start [PROCESSES]    20 processes on an empty folder of kernels

A ratio of times is that of one call; other programs on the machine change it. The ratio of
processor times is not changed by them: twice that of the serial sweep over that of all processes
together, their start and imports with it. So many times as fast two processors that nobody else
uses are, up to the last task, of 0.5 s or one point.
"""

from __future__ import annotations

import functools
import json
import os
import resource
import sys
import tempfile
import time
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np

import amoeboid as am

P = am.Parameters(D=0.4)
SHORT = functools.partial(am.simulate, mesh=am.Icosphere(1), until=am.time(0.2), progress=False)
WARM = 50  # runs after which memory is looked at for the first time


@contextmanager
def dask_workers(count: int):
    """An executor on workers of Dask, each with one thread."""
    from distributed import Client, LocalCluster

    cluster = LocalCluster(
        n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )
    with cluster, Client(cluster) as client:
        yield client.get_executor()


def processor_time() -> float:
    """Seconds of processor time of this process and of all that it has made and that ended."""
    times = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(t.ru_utime + t.ru_stime for t in times)


def speed(count: int = 200) -> dict[str, object]:
    """Times of a serial sweep, of two processes and of two workers of Dask, and their ratios.

    The start of the processes is included, that of the cluster of Dask is not.
    """
    before = processor_time()
    with dask_workers(2):
        pass
    cluster = processor_time() - before
    points = am.grid(P, v_p0=np.linspace(3, 8, count))
    am.theory(P)  # its imports are no part of the serial time
    seconds: dict[str, float] = {}
    busy: dict[str, float] = {}
    rows = {}
    for name in ("serial", "two processes", "two Dask workers"):
        before = processor_time()
        with dask_workers(2) if "Dask" in name else nullcontext() as executor:
            begun = time.monotonic()
            workers = 2 if name == "two processes" else None
            rows[name] = am.sweep(points, am.theory, executor=executor, workers=workers).rows
            seconds[name] = time.monotonic() - begun
        busy[name] = processor_time() - before - (cluster if "Dask" in name else 0.0)
    assert rows["serial"] == rows["two processes"] == rows["two Dask workers"]
    others = [name for name in seconds if name != "serial"]
    return {
        "points": count,
        "seconds": seconds,
        "processor_seconds": busy,
        "serial_over": {name: seconds["serial"] / seconds[name] for name in others},
        "by_processor_time": {name: 2 * busy["serial"] / busy[name] for name in others},
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
