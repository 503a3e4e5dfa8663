"""Throughput of steady states computed side by side, over one at a time on one core.

Run as `python benchmarks/many_states.py [--cells 1000 10000] [--one-by-one 20] [--agree 200]`; JAX
uses the accelerator that it finds, or the processor. Random cells (D, v_p0, delta_P, beta) are
computed side by side, each number of them twice: the first time with compilation. They are of three
kinds: near the threshold of each (1.05 to 1.1 times; D > 0.2), beyond it (1.05 to 1.4 times), and
at any v_p0, polarized or not. Some of the last kind are then searched for one by one, along the
branch from the threshold, as a user would without JAX. `--agree` compares as many states with those
that the solver for one cell finds from them.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

import amoeboid as am  # noqa: E402
from amoeboid.axisymmetric.search import steady_solutions  # noqa: E402
from amoeboid.axisymmetric.steady import steady_state  # noqa: E402
from amoeboid.closed_forms.linear import critical_speed  # noqa: E402


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


def polarized_cells(count: int, most: float = 1.4) -> am.points:
    """Cells of the paper's law at 1.05 to `most` times their thresholds."""
    rng = np.random.default_rng(6)
    cells = am.points(
        am.Parameters(),
        D=rng.uniform(0.2, 0.6, count),
        delta_P=10 ** rng.uniform(1.5, 3.0, count),
        beta=rng.uniform(0.7, 1.5, count),
    )
    return cells.at_speed(critical_speed(cells) * rng.uniform(1.05, most, count))


def timed(task: Callable[[], Any]) -> tuple[Any, float, float]:
    """What it returns, processor time of all threads and wall-clock time in seconds."""
    cpu, wall = time.process_time(), time.perf_counter()
    found = task()
    return found, time.process_time() - cpu, time.perf_counter() - wall


def side_by_side(cells: Any, name: str, chunk: int | None) -> float:
    """Print throughput; processor time a cell of the second time [s]."""
    count = int(np.prod(cells.shape))
    for again in (False, True):
        found, cpu, wall = timed(lambda: am.many_steady_states(cells, chunk=chunk, progress=False))
        polarized, steps = int(np.sum(found.converged)), float(np.mean(found.found.steps))
        print(
            f"{name:10}{count:9d}{'again' if again else 'first':>7}{wall:10.2f} s"
            f"{count / wall:11.0f}{polarized / wall:11.0f}{steps:8.2f}{1e3 * cpu / count:10.3f} ms"
            f"   {found!r}",
            flush=True,
        )
    return cpu / count


def differences(cells: Any, count: int, chunk: int | None) -> None:
    """Print how far states are from those that Newton's method for one cell finds from them."""
    found = am.many_steady_states(cells, chunk=chunk, progress=False)
    which = np.flatnonzero(found.converged)[:count]
    worst = 0.0
    for k in which:
        state = found.state(k)
        other = steady_state(state.parameters, state)
        scales = np.abs(state.x[:-2]).max(), np.abs(state.x[:-2] - other.x[:-2]).max()
        worst = max(worst, scales[1] / scales[0] if other.n == state.n else np.inf)
        for name in ("c_rear", "c_front", "max_retrograde_speed", "zeta0"):
            one, two = (float(getattr(s, name)) for s in (state, other))
            worst = max(worst, abs(one / two - 1))
    print(f"{which.size} states: largest relative difference to one at a time {worst:.1e}")


def main() -> None:
    """Measure and print."""
    import jax

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs="+", default=[1000])
    parser.add_argument("--one-by-one", type=int, default=20)
    parser.add_argument("--agree", type=int, default=0)
    parser.add_argument("--chunk", type=int, default=None, help="cells computed at the same time")
    args = parser.parse_args()
    print(f"JAX {jax.__version__}, {jax.devices()[0].device_kind}")
    print(f"{'cells':10}{'number':>9}{'':7}{'wall clock':>12}{'cells/s':>11}{'states/s':>11}"
          f"{'steps':>8}{'processor':>13}")  # fmt: skip
    many = 0.0
    for count in args.cells:
        side_by_side(polarized_cells(count, 1.1), "near", args.chunk)
        side_by_side(polarized_cells(count), "polarized", args.chunk)
        many = side_by_side(random_cells(count), "random", args.chunk)
    if args.agree:
        differences(random_cells(max(args.cells[0], 2 * args.agree)), args.agree, args.chunk)
    if args.one_by_one:
        points = [random_cells(args.cells[-1]).parameters(k) for k in range(args.one_by_one)]
        _, cpu, wall = timed(lambda: [steady_solutions(p, degrees=(1,)) for p in points])
        print(f"one at a time: {1e3 * cpu / len(points):.1f} ms of processor time a cell, "
              f"{cpu / len(points) / many:.1f} times that side by side; {len(points) / wall:.1f} "
              "cells/s")  # fmt: skip


if __name__ == "__main__":
    main()
