"""Branches of straight, circling and helical cells in v_p0, and the bifurcations between them.

    python -m benchmarks.turning 20 --window 7.84 8.6 --subdivisions 3
    python -m benchmarks.turning 11 --window 6.7 7.2
    python -m benchmarks.turning 30 --window 9 10

D = 0.4; 642 nodes; the number is delta_P. Straight cells are followed from the lower end of the
window to `--straight` (a tenth of the window), what leaves them and their circles in all of it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from amoeboid.model.parameters import Parameters
from amoeboid.runs.branches import branch
from amoeboid.runs.meshes import Icosphere
from amoeboid.studies.branch import HOPF, Branch

# Each branch that leaves another one is followed this far from the straight one.
DEPTH = 3


def branches(
    p: Parameters, window: tuple[float, float], straight: float, subdivisions: int
) -> Iterator[Branch]:
    """The branch of straight cells, and those that leave it and each other where stable ones do."""
    first = branch(p, "v_p0", window[0], straight, mesh=Icosphere(subdivisions))
    yield first
    waiting = [(1, point) for point in first.bifurcations]
    while waiting:
        depth, point = waiting.pop(0)
        if point.kind == HOPF or depth == DEPTH:
            continue
        found = branch(p, "v_p0", *window, through=point)
        yield found
        waiting += [(depth + 1, other) for other in found.bifurcations[1:]]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print them as they are found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("pressure", type=float)
    parser.add_argument("--window", type=float, nargs=2, required=True)
    parser.add_argument("--straight", type=float)
    parser.add_argument("--subdivisions", type=int, default=3)
    args = parser.parse_args(arguments)
    low, high = args.window
    end = low + 0.1 * (high - low) if args.straight is None else args.straight
    p = Parameters(D=0.4, delta_P=args.pressure)
    for found in branches(p, (low, high), end, args.subdivisions):
        print(f"{found!r}")
        for point in (*found.folds, *found.bifurcations):
            print(f"  {point!r}")
        print("  v_p0     path      turning   torsion    speed  growth rate  frequency")
        for cell in found.states:
            names = ("turning", "torsion", "cortex_drag_speed", "growth_rate", "frequency")
            numbers = " ".join(f"{cell.number(name):9.5f}" for name in names)
            print(f"  {cell.parameters.v_p0:<8.5f} {cell.path:8} {numbers}", flush=True)


if __name__ == "__main__":
    main()
