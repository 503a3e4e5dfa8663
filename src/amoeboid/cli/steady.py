"""`amoeboid steady`: all axisymmetric steady states found at one parameter point."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import PLOT_FAILS, add_plot, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import (
    add_observables,
    add_parameters,
    observables_shown,
    only_parameters,
    print_json,
    say_parameters,
)
from amoeboid.cli.tables import table, width

if TYPE_CHECKING:
    from amoeboid.studies.states import SteadyState, SteadyStates


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `steady`."""
    add_parameters(parser)
    add_observables(parser)
    add_plot(parser, "the states")
    parser.epilog = (
        "The search follows the branches that bifurcate from the homogeneous sphere in l = "
        "1, 2, 3.\n"
        "columns:\n"
        "  c_front, c_rear  lowest and highest concentration on the surface\n"
        "  friction_speed   with friction: speed of the cell towards its front\n"
        "  stable           whether every perturbation of shape and concentration with m = "
        "0, 1, 2, 3 decays\n"
        "example:\n"
        "  amoeboid steady --set D=0.4 --set v_p0=6\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Search, print, draw."""
    from amoeboid.studies.states import states_rows, steady_states

    p = only_parameters(args)
    names = observables_shown(args, p)
    check_picture(args.plot)
    with shown() as watch:
        found = steady_states(p, watch=watch)
    for problem in found.problems:
        tell("steady", problem)
    if not found.complete:
        advice = "smoother states are easier: a larger D or delta_P, v_p0 nearer the threshold"
        tell("steady", f"states may be missing; {advice}")
    if args.json:
        print_json(_document(found, names))
    else:
        say_parameters(p)
        titles, rows = states_rows(found.states, names)
        say(*table(titles, rows, limit=width()))

    def draw(path: Path) -> None:
        from amoeboid.plotting.branches import write_states

        write_states(found, path)

    return drawn("steady", args.plot, draw)


def _document(found: SteadyStates, names: Sequence[str]) -> dict[str, Any]:
    from amoeboid.studies.states import physical_units

    document: dict[str, Any] = {
        "states": [_row(state, names) for state in found],
        "complete": found.complete,
        "problems": list(found.problems),
    }
    units = physical_units(found.parameters, names)
    return document | ({"units": units} if units else {})


def _row(state: SteadyState, names: Sequence[str]) -> dict[str, Any]:
    return {
        **state.plain(names),
        "stable": state.stable,
        "unstable_modes": {str(m): count for m, count in state.unstable_modes.items()},
        "modes": state.solution.n,
    }
