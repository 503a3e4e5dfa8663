"""`amoeboid branch`: follow the polarized state in one parameter."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import PLOT_FAILS, add_plot, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import (
    add_observables,
    add_parameters,
    number_or_quantity,
    observables_shown,
    only_parameters,
    print_json,
    real,
    say_parameters,
    whole,
)
from amoeboid.cli.tables import table, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.studies.branch import Branch, SpecialPoint

INCOMPLETE = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `branch`."""
    add_parameters(parser)
    add_observables(parser)
    parser.add_argument(
        "--vary", default="v_p0", metavar="NAME", help="parameter that varies (default: v_p0)"
    )
    parser.add_argument(
        "--from",
        dest="start",
        type=number_or_quantity,
        metavar="VALUE",
        help="one end of the window (default: 0 for v_p0, else the value of the parameter)",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=number_or_quantity,
        required=True,
        metavar="VALUE",
        help="other end of the window; with --physical a value with its unit ('2 um/s')",
    )
    parser.add_argument(
        "--mesh",
        type=whole,
        metavar="N",
        help="follow 3D cells on a mesh of 10 * 4**N + 2 nodes, N from 1 to 6 (3: 642 nodes); "
        "default: axisymmetric states, without a mesh",
    )
    parser.add_argument(
        "--max-step",
        type=real,
        default=0.1,
        metavar="LENGTH",
        help="longest step along the branch; a smaller one gives more points (default: 0.1)",
    )
    parser.add_argument(
        "--max-points",
        type=whole,
        default=400,
        metavar="N",
        help="stop after N points (default: 400)",
    )
    add_plot(parser, "the branch")
    parser.epilog = (
        "A branch in v_p0 starts where the homogeneous sphere loses stability to l = 1. A "
        "branch in any other parameter starts at the polarized states at --from, and where "
        "the sphere loses stability in the window. With --mesh it starts at the fastest "
        "axisymmetric state at --to, or else at --from, and ends at an edge of the window or "
        "at the sphere.\n"
        "Branches are followed through folds outside the window; only states inside are "
        "listed.\n"
        "example:\n"
        "  amoeboid branch --to 7\n"
        "Exit code 1: the branch could not be followed to its end.\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Follow, print, draw."""
    from amoeboid.runs.branches import branch
    from amoeboid.studies.branch import checked_window

    p = only_parameters(args)
    names = observables_shown(args, p)
    checked_window(p, args.vary, args.start, args.end, ("--vary", "--from", "--to"))
    if not (math.isfinite(args.max_step) and args.max_step > 0):
        raise InvalidInput(f"--max-step must be > 0 and finite, got {args.max_step:g}")
    if args.max_points < 1:
        raise InvalidInput(f"--max-points must be >= 1, got {args.max_points}")
    check_picture(args.plot)
    mesh = None if args.mesh is None else _mesh(args.mesh)
    with shown() as watch:
        found = branch(
            p,
            args.vary,
            args.start,
            args.end,
            mesh=mesh,
            max_step=args.max_step,
            max_points=args.max_points,
            watch=watch,
        )
    for problem in found.problems:
        tell("branch", problem)
    if not found.complete:
        advice = "shorten the window, or smooth the states with a larger D or delta_P"
        tell("branch", f"incomplete; remedy: {advice}")
    if args.json:
        print_json(_document(found, names))
    else:
        say_parameters(p, [args.vary])
        _print_branch(found, names)
    code = 0 if found.complete else INCOMPLETE

    def draw(path: Path) -> None:
        from amoeboid.plotting.branches import write_branch

        write_branch(found, path)

    return drawn("branch", args.plot, draw, code)


def _mesh(subdivisions: int) -> Any:
    """The mesh of `--mesh`. Raises InvalidInput."""
    from amoeboid.runs.meshes import Icosphere

    if not 1 <= subdivisions <= 6:
        raise InvalidInput(f"--mesh must be 1 to 6, got {subdivisions}")
    return Icosphere(subdivisions)


def _row(
    found: Branch, state: Any, names: Sequence[str], neutral: int | None = -1
) -> dict[str, Any]:
    """The entry of a state; where a mode m = `neutral` >= 0 or None has the rate 0, stability is
    no question."""
    return {
        found.name: found.plain(state.parameters.value(found.name)),
        **state.plain(names),
        **found.stability_of(state, neutral),
    }


def _document(found: Branch, names: Sequence[str]) -> dict[str, Any]:
    from amoeboid.studies.branch import HOPF
    from amoeboid.studies.states import physical_units

    def special(points: list[SpecialPoint]) -> list[dict[str, Any]]:
        return [{**_row(found, point.state, names, point.m), "m": point.m} for point in points]

    origins = [{found.name: found.plain(value), "m": 0} for value in found.origins]
    hopf = [point for point in found.bifurcations if point.kind == HOPF]
    others = [point for point in found.bifurcations if point.kind != HOPF]
    document = {
        "vary": found.name,
        "points": [
            {**_row(found, state, names), "piece": int(k)}
            for k, state in zip(found.piece, found.states, strict=True)
        ],
        "folds": [_row(found, fold.state, names, 0) for fold in found.folds],
        "branch_points": origins + special(others),
        "hopf_points": special(hopf),
        "complete": found.complete,
        "problems": list(found.problems),
        "message": "; ".join(found.problems),
    }
    units = physical_units(found.parameters, names, found.name)
    return document | ({"units": units} if units else {})


def _print_branch(found: Branch, names: Sequence[str]) -> None:
    from amoeboid.studies.columns import text, titled, unit

    p, name = found.parameters, found.name
    dimension = p.dimension(name)
    first = titled(name, "" if p.units is None else unit(p, dimension))
    for piece in found.pieces:
        titles, rows = found.rows(piece, names)
        values = [f"{found.plain(s.parameters.value(name)):.6g}" for s in piece]
        rows = [[value, *row] for value, row in zip(values, rows, strict=True)]
        say(*table([first, *titles], rows, limit=width()), "")
    if len(found.pieces) > 1:
        say(f"the branch enters the window {len(found.pieces)} times; one table for each")
    for value in found.origins:
        say(
            f"bifurcates from the homogeneous sphere at {name} = {text(p, value, dimension, '.9g')}"
        )
    for fold in found.folds:
        at = text(p, fold.number, dimension, ".9g")
        speed = fold.state.text("max_retrograde_speed")
        say(f"fold at {name} = {at}, max_retrograde_speed = {speed}")
    for point in found.bifurcations:
        at = text(p, point.number, dimension, ".9g")
        say(f"{point.what} at {name} = {at}")
