"""`amoeboid branch`: follow the polarized state in one parameter."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import NO_PICTURE, PLOT_FAILS, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import add_parameters, only_parameters, print_json, real, whole
from amoeboid.cli.tables import number, table, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.axisymmetric.branches import Branch, BranchPoint
    from amoeboid.axisymmetric.progress import Watch
    from amoeboid.model.parameters import Parameters

INCOMPLETE = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `branch`."""
    add_parameters(parser)
    parser.add_argument("--vary", default="v_p0", metavar="NAME", help="the parameter (v_p0)")
    parser.add_argument(
        "--from",
        dest="start",
        type=real,
        metavar="VALUE",
        help="one end of the window (0 for v_p0, else the parameter's own value)",
    )
    parser.add_argument(
        "--to", dest="end", type=real, required=True, metavar="VALUE", help="the other end"
    )
    parser.add_argument(
        "--max-step",
        type=real,
        default=0.1,
        metavar="LENGTH",
        help="longest step along the branch; smaller gives more points (0.1)",
    )
    parser.add_argument(
        "--max-points", type=whole, default=400, metavar="N", help="stop after N points (400)"
    )
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw it (.png .pdf .svg)")
    parser.epilog = (
        "In v_p0 the branch starts where the homogeneous sphere loses stability to l = 1; in any\n"
        "other parameter at the polarized states at --from and where the sphere loses stability\n"
        "within the window. It is followed through its folds outside the window as well; what\n"
        "lies inside is listed. Exit code 1: it could not be followed to its end.\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Follow, print, draw."""
    p = only_parameters(args)
    start = _checked_start(args, p)
    check_picture(args.plot)
    with shown() as watch:
        branch = _branch(args, p, start, watch)
    for problem in branch.problems:
        tell("branch", problem)
    if not branch.complete:
        advice = "end the window earlier, or smooth the states by a larger D or delta_P"
        tell("branch", f"incomplete; one can {advice}")
    if args.json:
        print_json(_document(branch))
    else:
        _print_branch(branch)
    code = 0 if branch.complete else INCOMPLETE
    if args.plot is None:
        return code
    from amoeboid.plotting.branches import draw_branch

    return (
        code if drawn("branch", args.plot, lambda path: draw_branch(branch, path)) else NO_PICTURE
    )


def _checked_start(args: argparse.Namespace, p: Parameters) -> float:
    name = args.vary
    if name not in p.names:
        raise InvalidInput(f"--vary must be one of {', '.join(p.names)}, got {name!r}")
    if not (math.isfinite(args.max_step) and args.max_step > 0):
        raise InvalidInput(f"--max-step must be > 0 and finite, got {args.max_step:g}")
    if args.max_points < 1:
        raise InvalidInput(f"--max-points must be >= 1, got {args.max_points}")
    start = args.start
    if start is None:
        start = 0.0 if name == "v_p0" else p.value(name)
    for option, value in (("--from", start), ("--to", args.end)):
        if not math.isfinite(value):
            raise InvalidInput(f"{option} must be a finite number, got {value!r}")
        p.replace(**{name: value})
    if start == args.end:
        raise InvalidInput(f"--from and --to must differ, both are {start:g}")
    return float(start)


def _branch(args: argparse.Namespace, p: Parameters, start: float, watch: Watch) -> Branch:
    from amoeboid.axisymmetric.branches import polarized_branch
    from amoeboid.axisymmetric.onset import onset_speed
    from amoeboid.numerics.continuation import Options

    name, end = args.vary, args.end
    low, high = min(start, end), max(start, end)
    scale = (onset_speed(p) if name == "v_p0" else None) or max(abs(start), abs(end))
    options = Options(
        parameter_scale=scale,
        max_step=args.max_step,
        first_step=min(0.05, args.max_step),
        max_points=args.max_points,
    )
    branch = polarized_branch(p, name, start, end, options, watch)
    if branch is None:
        raise InvalidInput(
            f"no polarized state found for {name} between {low:g} and {high:g}; "
            "set v_p0 above its threshold (see amoeboid steady)"
        )
    if not branch.points and branch.complete:
        raise InvalidInput(f"{branch.message}: choose a window that it passes")
    return branch


def _row(name: str, b: BranchPoint, neutral: int | None = None) -> dict[str, Any]:
    """The entry of a point; where a mode m = `neutral` has the rate 0, stability is no question."""
    s = b.state
    counts = {str(m): None if m == neutral else count for m, count in b.unstable.items()}
    return {
        name: b.value,
        "max_retrograde_speed": s.max_retrograde_speed,
        "c_front": s.c_front,
        "c_rear": s.c_rear,
        "zeta0": s.zeta0,
        "stable": b.stable if neutral is None else None,
        "unstable_modes": counts,
    }


def _document(branch: Branch) -> dict[str, Any]:
    name = branch.name
    origins = [{name: value, "m": 0} for value in branch.origins]
    numbers = range(len(branch.pieces))
    crossings = [(c.oscillating, {**_row(name, c.at, c.m), "m": c.m}) for c in branch.crossings]
    return {
        "vary": name,
        "points": [
            {**_row(name, b), "piece": k}
            for k, piece in zip(numbers, branch.pieces, strict=True)
            for b in piece
            if not b.point.fold
        ],
        "folds": [_row(name, b, 0) for b in branch.folds],
        "branch_points": origins + [row for oscillating, row in crossings if not oscillating],
        "hopf_points": [row for oscillating, row in crossings if oscillating],
        "complete": branch.complete,
        "problems": list(branch.problems),
        "message": branch.message,
    }


def _print_branch(branch: Branch) -> None:
    titles = (branch.name, "v_0", "c front", "c rear", "zeta_0", "unstable m = 0 1 2 3")
    for piece in branch.pieces:
        rows = []
        for b in piece:
            if b.point.fold:
                continue
            s = b.state
            numbers = (b.value, s.max_retrograde_speed, s.c_front, s.c_rear, s.zeta0)
            rows.append((*map(number, numbers), " ".join(map(str, b.unstable.values()))))
        say(*table(titles, rows, limit=width()), "")
    if len(branch.pieces) > 1:
        say(f"the branch is in the window {len(branch.pieces)} times, one table each")
    for value in branch.origins:
        say(f"leaves the homogeneous sphere at {branch.name} = {number(value, 9)}")
    for fold in branch.folds:
        speed = number(fold.state.max_retrograde_speed)
        say(f"fold at {branch.name} = {number(fold.value, 9)}, v_0 = {speed}")
    for c in branch.crossings:
        kind = "Hopf point" if c.oscillating else "branch point"
        say(f"{kind} of m = {c.m} at {branch.name} = {number(c.at.value, 9)}")
