"""`amoeboid steady`: all axisymmetric steady states found at one parameter point."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from amoeboid.cli.progress import shown
from amoeboid.cli.settings import add_parameters, only_parameters, print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `steady`."""
    add_parameters(parser)
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the states (.png .pdf .svg)"
    )
    parser.epilog = (
        "Searched: the branches that bifurcate from the homogeneous sphere in l = 1, 2, 3.\n"
        "front and rear: the poles of low and of high concentration; c min and c max, shown where\n"
        "they lie elsewhere: over the whole surface.\n"
        "stable: every perturbation of shape and concentration with m = 0, 1, 2, 3 decays."
    )


def execute(args: argparse.Namespace) -> int:
    """Search, print, draw."""
    from amoeboid.axisymmetric.stability import unstable_modes
    from amoeboid.axisymmetric.states import steady_states

    p = only_parameters(args)
    if args.plot is not None:
        from amoeboid.plotting.branches import check_picture_path

        check_picture_path(args.plot)
    with shown() as watch:
        found = steady_states(p, watch=watch)
    unstable = [unstable_modes(s) for s in found.states]
    rows = [_row(s, u) for s, u in zip(found.states, unstable, strict=True)]
    for problem in found.problems:
        print(f"amoeboid steady: {problem}", file=sys.stderr)
    if not found.complete:
        advice = "smoother states are easier: a larger D or delta_P, v_p0 nearer the threshold"
        print(f"amoeboid steady: states may be missing; {advice}", file=sys.stderr)
    if args.plot is not None:
        from amoeboid.plotting.branches import draw_states

        stable = [not any(u.values()) for u in unstable]
        draw_states(list(zip(found.states, stable, strict=True)), args.plot)
    if args.json:
        print_json({"states": rows, "complete": found.complete, "problems": list(found.problems)})
    else:
        _print_table(rows)
    return 0


def _row(state: Any, unstable: dict[int, int]) -> dict[str, Any]:
    return {
        "max_retrograde_speed": state.max_retrograde_speed,
        "c_front": state.c_front,
        "c_rear": state.c_rear,
        "c_min": state.c_min,
        "c_max": state.c_max,
        "zeta0": state.zeta0,
        "stable": not any(unstable.values()),
        "unstable_modes": {str(m): count for m, count in unstable.items()},
        "deformation": state.deformation,
        "modes": state.n,
    }


def _print_table(rows: list[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    columns = {
        "v_0": "max_retrograde_speed",
        "c front": "c_front",
        "c rear": "c_rear",
        "c min": "c_min",
        "c max": "c_max",
        "zeta_0": "zeta0",
    }
    if not any(_off_the_poles(row) for row in rows):
        del columns["c min"], columns["c max"]
    table = Table()
    for title in (*columns, "deformation", "unstable m = 0 1 2 3"):
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            *(f"{row[key]:.6f}" for key in columns.values()),
            f"{row['deformation']:.2%}",
            "stable" if row["stable"] else " ".join(map(str, row["unstable_modes"].values())),
        )
    Console().print(table)


def _off_the_poles(row: dict[str, Any]) -> bool:
    """Whether c has its minimum or maximum elsewhere than at a pole, as states of l = 2 may."""
    tolerance = 1e-6 * row["c_max"]
    return row["c_max"] - row["c_rear"] > tolerance or row["c_front"] - row["c_min"] > tolerance
