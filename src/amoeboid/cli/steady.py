"""`amoeboid steady`: all axisymmetric steady states found at one parameter point."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import NO_PICTURE, PLOT_FAILS, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import add_parameters, only_parameters, print_json
from amoeboid.cli.tables import number, percent, table, width


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `steady`."""
    add_parameters(parser)
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the states (.png .pdf .svg)"
    )
    parser.epilog = (
        "Searched: the branches that bifurcate from the homogeneous sphere in l = 1, 2, 3.\n"
        "c front and c rear: the lowest and the highest concentration on the surface.\n"
        "stable: every perturbation of shape and concentration with m = 0, 1, 2, 3 decays.\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Search, print, draw."""
    from amoeboid.axisymmetric.stability import unstable_modes
    from amoeboid.axisymmetric.states import steady_states

    p = only_parameters(args)
    check_picture(args.plot)
    with shown() as watch:
        found = steady_states(p, watch=watch)
    unstable = [unstable_modes(s) for s in found.states]
    rows = [_row(s, u) for s, u in zip(found.states, unstable, strict=True)]
    for problem in found.problems:
        tell("steady", problem)
    if not found.complete:
        advice = "smoother states are easier: a larger D or delta_P, v_p0 nearer the threshold"
        tell("steady", f"states may be missing; {advice}")
    if args.json:
        print_json({"states": rows, "complete": found.complete, "problems": list(found.problems)})
    else:
        _print_table(rows)
    if args.plot is None:
        return 0
    from amoeboid.plotting.branches import draw_states

    stable = [not any(u.values()) for u in unstable]
    states = list(zip(found.states, stable, strict=True))
    return 0 if drawn("steady", args.plot, lambda path: draw_states(states, path)) else NO_PICTURE


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
    titles = ("v_0", "c front", "c rear", "zeta_0", "deformation", "unstable m = 0 1 2 3")
    cells = [
        (
            *(number(row[k]) for k in ("max_retrograde_speed", "c_front", "c_rear", "zeta0")),
            percent(row["deformation"]),
            "stable" if row["stable"] else " ".join(map(str, row["unstable_modes"].values())),
        )
        for row in rows
    ]
    say(*table(titles, cells, limit=width()))
