"""Throughput of steady states computed side by side, over one at a time on one core.

Run as `python benchmarks/many_states.py [--cells 1000] [--one-by-one 20]`; JAX uses the accelerator
that it finds, or the processor. The same random cells (D, v_p0, delta_P, beta) are computed twice
side by side: the first time with compilation. Some of them are then searched for one by one, along
the branch from its threshold, as a user would without JAX.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402

import numpy as np  # noqa: E402

import amoeboid as am  # noqa: E402
from amoeboid.axisymmetric.search import steady_solutions  # noqa: E402


def random_cells(count: int) -> am.points:
    """Cells of the paper's law, polarized or not."""
    rng = np.random.default_rng(5)
    return am.points(
        am.Parameters(),
        D=rng.uniform(0.05, 0.6, count),
        v_p0=rng.uniform(4.0, 8.0, count),
        delta_P=10 ** rng.uniform(1.5, 3.0, count),
        beta=rng.uniform(0.7, 1.5, count),
    )


def timed(task: Callable[[], object]) -> tuple[object, float, float]:
    """What it returns, processor time of all threads and wall-clock time in seconds."""
    cpu, wall = time.process_time(), time.perf_counter()
    found = task()
    return found, time.process_time() - cpu, time.perf_counter() - wall


def main() -> None:
    """Measure and print."""
    import jax

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=1000)
    parser.add_argument("--one-by-one", type=int, default=20)
    parser.add_argument("--chunk", type=int, default=None, help="cells computed at the same time")
    args = parser.parse_args()
    cells = random_cells(args.cells)
    print(f"device: {jax.devices()[0].device_kind}, {args.cells} cells")
    rates = {}
    for name in ("side by side, with compilation", "side by side"):
        found, cpu, wall = timed(lambda: am.many_steady_states(cells, chunk=args.chunk))
        rates[name] = cpu / args.cells, wall / args.cells
    some = range(min(args.one_by_one, args.cells))
    points = [cells.parameters(k) for k in some]
    _, cpu, wall = timed(lambda: [steady_solutions(p, degrees=(1,)) for p in points])
    rates["one at a time"] = cpu / len(points), wall / len(points)
    print(found)
    print(f"{'':34}{'cpu ms a cell':>16}{'wall ms a cell':>16}{'cells a second':>16}")
    for name, (cpu, wall) in rates.items():
        print(f"{name:34}{1e3 * cpu:16.3f}{1e3 * wall:16.3f}{1 / wall:16.1f}")
    one, many = rates["one at a time"], rates["side by side"]
    print(f"ratio, processor time {one[0] / many[0]:.2f}, wall clock {one[1] / many[1]:.2f}")


if __name__ == "__main__":
    main()
