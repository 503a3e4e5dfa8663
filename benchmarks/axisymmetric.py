"""Timings of the axisymmetric solver on one core; prints what it measures beside the goal.

Run as `python benchmarks/axisymmetric.py [--grid 40] [--against SRC]`. Processor time, best of a
few repetitions where a task is short: other programs on the machine then count least. With
`--against` the package in the folder SRC, the `src` of another checkout, is timed in turns with
this one, in processes of their own, and the ratios of the best times are printed.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import json  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402

from amoeboid.axisymmetric.branches import branch_from_sphere  # noqa: E402
from amoeboid.axisymmetric.evolution import evolve_to_steady, perturbed_sphere  # noqa: E402
from amoeboid.axisymmetric.onset import onset_speed  # noqa: E402
from amoeboid.axisymmetric.phase_diagram import diagram_of_columns, phase_columns  # noqa: E402
from amoeboid.axisymmetric.search import steady_solutions  # noqa: E402
from amoeboid.axisymmetric.stability import unstable_modes  # noqa: E402
from amoeboid.axisymmetric.steady import steady_state  # noqa: E402
from amoeboid.axisymmetric.window import Window  # noqa: E402
from amoeboid.model.parameters import Parameters  # noqa: E402
from amoeboid.numerics.continuation import Options  # noqa: E402


def timed(task: Callable[[], object], repetitions: int) -> tuple[float, float]:
    """Best processor and wall-clock time of a task in seconds."""
    best = (np.inf, np.inf)
    for _ in range(repetitions):
        cpu, wall = time.process_time(), time.perf_counter()
        task()
        best = (
            min(best[0], time.process_time() - cpu),
            min(best[1], time.perf_counter() - wall),
        )
    return best


def figure_branches() -> tuple[int, int]:
    """The branches of figures 3A and 3B with folds and stability; their numbers of points."""
    a = branch_from_sphere(
        Parameters(D=0.03),
        "v_p0",
        Window(0.0, 4.2),
        options=Options(parameter_scale=3.55, max_step=0.018, first_step=0.018),
    )
    b = branch_from_sphere(
        Parameters(D=0.4),
        "v_p0",
        Window(0.0, 8.0),
        options=Options(parameter_scale=6.0, max_step=0.034),
    )
    assert a is not None
    assert b is not None
    assert all(isinstance(q.stable, bool) for branch in (a, b) for q in branch.points)
    assert len(b.folds) == 1
    return len(a.points), len(b.points)


def diagram(count: int) -> None:
    """A count x count phase diagram with its fold line."""
    values, speeds = np.linspace(0.03, 0.6, count), np.linspace(3.0, 8.0, count)
    columns = tuple(phase_columns(Parameters(), "D", values, speeds))
    assert diagram_of_columns(Parameters(), "D", values, speeds, columns).fold_line


Rows = list[tuple[str, tuple[float, float], str]]


def measured(grid: int) -> Rows:
    """Task, processor and wall-clock time, and goal."""
    p = Parameters(D=0.4, v_p0=6.0)
    near = steady_solutions(p, degrees=(1,))[-1]
    moved = p.replace(v_p0=6.05)
    points = figure_branches()
    return [
        ("threshold of l = 1", timed(lambda: onset_speed(p), 10), ""),
        ("steady state from a nearby one", timed(lambda: steady_state(moved, near), 40), "0.0015"),
        ("its spectra, m = 0, 1, 2, 3", timed(lambda: unstable_modes(near), 20), ""),
        (
            f"branches 3A and 3B, {points[0]} + {points[1]} points",
            timed(figure_branches, 3),
            "0.6",
        ),
        (
            "time evolution to the steady state",
            timed(lambda: evolve_to_steady(p, perturbed_sphere(p, {1: 3.0}), 500.0), 2),
            "",
        ),
        (f"phase diagram {grid} x {grid} with fold line", timed(lambda: diagram(grid), 1), "12"),
    ]


def compared(grid: int, other: Path, rounds: int) -> None:
    """Print the best times of the package in `other` and of this one, and their ratios."""
    here = Path(__file__).resolve().parents[1] / "src"
    best: dict[Path, dict[str, float]] = {other.resolve(): {}, here: {}}
    for _ in range(rounds):
        for source, times in best.items():
            done = subprocess.run(
                [sys.executable, __file__, "--grid", str(grid), "--json"],
                env=os.environ | {"PYTHONPATH": str(source)},
                check=True,
                capture_output=True,
                text=True,
            )
            for name, (cpu, _), _ in json.loads(done.stdout):
                times[name] = min(cpu, times.get(name, cpu))
    before, after = best.values()
    print(f"{'task':48}{'other, s':>10}{'this, s':>10}{'ratio':>10}")
    for name in after:
        ratio = before[name] / after[name]
        print(f"{name:48}{before[name]:10.4f}{after[name]:10.4f}{ratio:10.2f}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", type=int, default=40, help="side of the phase diagram (40)")
    parser.add_argument("--against", type=Path, metavar="SRC", help="time another checkout too")
    parser.add_argument("--rounds", type=int, default=3, help="turns of a comparison (3)")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    args = parser.parse_args()
    if args.against is not None:
        compared(args.grid, args.against, args.rounds)
        return
    rows = measured(args.grid)
    if args.json:
        print(json.dumps(rows))
        return
    print(f"{'task':48}{'cpu s':>10}{'wall s':>10}{'goal s':>10}")
    for name, (cpu, wall), goal in rows:
        print(f"{name:48}{cpu:10.4f}{wall:10.4f}{goal:>10}")


if __name__ == "__main__":
    main()
