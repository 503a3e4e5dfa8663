"""`amoeboid steady`: all axisymmetric steady states found at one parameter point."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from amoeboid.cli.progress import shown
from amoeboid.cli.settings import add_settings, parameters_of, print_json, warn_without_pressure


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `steady`."""
    add_settings(parser)
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the states (.png .pdf .svg)"
    )
    parser.epilog = (
        "Searched: the branches that the modes l = 1, 2, 3 of the homogeneous sphere send out.\n"
        "stable: every perturbation of shape and concentration with m = 0, 1, 2, 3 decays."
    )


def execute(args: argparse.Namespace) -> int:
    """Search, print, draw."""
    from amoeboid.axisymmetric.branches import search
    from amoeboid.axisymmetric.stability import unstable_modes

    p = parameters_of(args)
    if args.plot is not None:
        from amoeboid.plotting.branches import check_picture_path

        check_picture_path(args.plot)
    with shown() as watch:
        found = search(p, watch=watch)
    unstable = [unstable_modes(s) for s in found.states]
    rows = [_row(s, u) for s, u in zip(found.states, unstable, strict=True)]
    for problem in found.problems:
        print(f"amoeboid steady: states may be missing: {problem}", file=sys.stderr)
    if found.problems:
        advice = "smoother states are easier: a larger D or delta_P, v_p0 nearer the threshold"
        print(f"amoeboid steady: {advice}", file=sys.stderr)
    warn_without_pressure("steady", p.delta_P)
    if args.plot is not None:
        from amoeboid.plotting.branches import draw_states

        stable = [not any(u.values()) for u in unstable]
        draw_states(list(zip(found.states, stable, strict=True)), args.plot)
    if args.json:
        print_json({"states": rows, "problems": list(found.problems)})
    else:
        _print_table(rows)
    return 0


def _row(state: Any, unstable: dict[int, int]) -> dict[str, Any]:
    return {
        "max_retrograde_speed": state.max_retrograde_speed,
        "c_front": state.c_front,
        "c_rear": state.c_rear,
        "zeta0": state.zeta0,
        "stable": not any(unstable.values()),
        "unstable_modes": {str(m): count for m, count in unstable.items()},
        "deformation": state.deformation,
        "modes": state.n,
    }


def _print_table(rows: list[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table()
    for title in ("v_0", "c front", "c rear", "zeta_0", "deformation", "unstable m = 0 1 2 3"):
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            *(f"{row[k]:.6f}" for k in ("max_retrograde_speed", "c_front", "c_rear", "zeta0")),
            f"{row['deformation']:.2%}",
            "stable" if row["stable"] else " ".join(map(str, row["unstable_modes"].values())),
        )
    Console().print(table)
