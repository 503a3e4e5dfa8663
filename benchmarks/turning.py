"""Branches of straight, circling and helical cells in v_p0, and the bifurcations between them.

    python -m benchmarks.turning 20 --window 7.84 8.6 --subdivisions 3
    python -m benchmarks.turning 11 --window 6.7 7.2 --straight 6.85
    python -m benchmarks.turning 30 --window 9 10
    python -m benchmarks.turning 20 --window 7.84 7.95 --onset 2 3 4 5

D = 0.4; 642 nodes; the number is delta_P. Straight cells are followed from the lower end of the
window to `--straight` (a tenth of the window), what leaves them and their circles in all of it.
`--onset`: only where circles leave the straight cell of the window, on meshes of so many
subdivisions and without a mesh, and the orders of the errors from one mesh to the next.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

import numpy as np

from amoeboid.figures.gallery.extra_turning import bending_onset
from amoeboid.model.parameters import Parameters
from amoeboid.runs.branches import branch
from amoeboid.runs.meshes import Icosphere
from amoeboid.studies.branch import HOPF, Branch
from amoeboid.validation import InvalidInput

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


def onsets(p: Parameters, window: tuple[float, float], subdivisions: Sequence[int]) -> None:
    """Print the first bifurcation to circles on every mesh, its error, and the orders."""
    exact, errors = bending_onset(p), []
    if exact is None:
        raise InvalidInput("no straight cell bends at this pressure; choose another")
    print(f"without a mesh {exact:9.5f}")
    for n in subdivisions:
        straight = branch(p, "v_p0", *window, mesh=Icosphere(n))
        found = [b.number for b in straight.bifurcations if b.m == 1]
        if not found:
            raise InvalidInput(f"no onset of circles from {window[0]} to {window[1]}; widen it")
        errors.append(found[0] - exact)
        print(f"{10 * 4**n + 2:8} nodes {found[0]:9.5f}  error {errors[-1]:+.5f}", flush=True)
    if len(errors) > 1:
        print("orders", *(f"{o:.2f}" for o in np.log2(np.divide(errors[:-1], errors[1:]))))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print them as they are found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("pressure", type=float)
    parser.add_argument("--window", type=float, nargs=2, required=True)
    parser.add_argument("--straight", type=float)
    parser.add_argument("--subdivisions", type=int, default=3)
    parser.add_argument("--onset", type=int, nargs="+", metavar="SUBDIVISIONS")
    args = parser.parse_args(arguments)
    low, high = args.window
    end = low + 0.1 * (high - low) if args.straight is None else args.straight
    p = Parameters(D=0.4, delta_P=args.pressure)
    if args.onset:
        onsets(p, (low, high), args.onset)
        return
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
