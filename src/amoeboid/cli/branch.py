"""`amoeboid branch`: follow the polarized state in one parameter."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import NO_PICTURE, PLOT_FAILS, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import (
    add_settings,
    parameters_of,
    print_json,
    real,
    warn_without_pressure,
    whole,
)
from amoeboid.cli.tables import number, table, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.axisymmetric.branches import Branch, BranchPoint
    from amoeboid.axisymmetric.progress import Watch
    from amoeboid.parameters import Parameters

INCOMPLETE = 1
VARIABLE = ("R0", "delta_P", "eta_s", "eta_b", "c0", "c_r", "beta", "D", "v_p0", "alpha")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `branch`."""
    add_settings(parser)
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
        "other parameter at the fastest polarized state at --from or, if there is none, where the\n"
        "sphere loses stability within the window. It ends where it leaves the window or meets\n"
        "the sphere. Exit code 1: it could not be followed that far.\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Follow, print, draw."""
    p = parameters_of(args)
    start = _checked_start(args, p)
    check_picture(args.plot)
    with shown() as watch:
        branch = _branch(args, p, start, watch)
    if branch.message:
        advice = (
            "one can also end the window earlier, or smooth the states by a larger D or delta_P"
        )
        tell("branch", f"incomplete: {branch.message}; {advice}")
    pressures = [b.state.parameters.delta_P for b in branch.points]
    warn_without_pressure("branch", min(pressures, default=p.delta_P))
    if args.json:
        print_json(_document(branch))
    else:
        _print_branch(branch)
    code = INCOMPLETE if branch.message else 0
    if args.plot is None:
        return code
    from amoeboid.plotting.branches import draw_branch

    return (
        code if drawn("branch", args.plot, lambda path: draw_branch(branch, path)) else NO_PICTURE
    )


def _checked_start(args: argparse.Namespace, p: Parameters) -> float:
    name = args.vary
    if name not in VARIABLE:
        raise InvalidInput(f"--vary must be one of {', '.join(VARIABLE)}, got {name!r}")
    if not (math.isfinite(args.max_step) and args.max_step > 0):
        raise InvalidInput(f"--max-step must be > 0 and finite, got {args.max_step:g}")
    if args.max_points < 1:
        raise InvalidInput(f"--max-points must be >= 1, got {args.max_points}")
    start = args.start
    if start is None:
        start = 0.0 if name == "v_p0" else float(getattr(p, name))
    for option, value in (("--from", start), ("--to", args.end)):
        if not math.isfinite(value):
            raise InvalidInput(f"{option} must be a finite number, got {value!r}")
        p.replace(**{name: value})
    if start == args.end:
        raise InvalidInput(f"--from and --to must differ, both are {start:g}")
    return float(start)


def _branch(args: argparse.Namespace, p: Parameters, start: float, watch: Watch) -> Branch:
    from amoeboid.axisymmetric.branches import (
        Window,
        branch_from_sphere,
        branch_from_state,
        search,
    )
    from amoeboid.axisymmetric.onset import onset_speed
    from amoeboid.numerics.continuation import Options

    name, end = args.vary, args.end
    window = Window(min(start, end), max(start, end))
    scale = (onset_speed(p) if name == "v_p0" else None) or max(abs(start), abs(end))
    options = Options(
        parameter_scale=scale,
        max_step=args.max_step,
        first_step=min(0.05, args.max_step),
        max_points=args.max_points,
    )
    branch = None
    if name != "v_p0":
        state = search(p.replace(**{name: start}), (1,), watch).states[-1]
        if state.max_retrograde_speed > 0:
            branch = branch_from_state(state, name, window, end - start, options, watch)
    if branch is None:
        branch = branch_from_sphere(p, name, window, options=options, watch=watch)
    if branch is None:
        raise InvalidInput(
            f"no polarized state found for {name} between {window.low:g} and {window.high:g}; "
            "set v_p0 above its threshold (see amoeboid steady)"
        )
    if not branch.points and not branch.message:
        raise InvalidInput(
            f"the polarized branch does not enter {window.low:g} <= {name} <= {window.high:g}; "
            f"it starts at {name} = {branch.origin:.6g}: choose --to beyond that"
        )
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
    origin = [] if branch.origin is None else [{name: branch.origin, "m": 0}]
    crossings = [(c.oscillating, {**_row(name, c.at, c.m), "m": c.m}) for c in branch.crossings]
    return {
        "vary": name,
        "points": [_row(name, b) for b in branch.points],
        "folds": [_row(name, b, 0) for b in branch.folds],
        "branch_points": origin + [row for oscillating, row in crossings if not oscillating],
        "hopf_points": [row for oscillating, row in crossings if oscillating],
        "message": branch.message,
    }


def _print_branch(branch: Branch) -> None:
    titles = (branch.name, "v_0", "c front", "c rear", "zeta_0", "unstable m = 0 1 2 3")
    rows = []
    for b in branch.points:
        s = b.state
        numbers = (b.value, s.max_retrograde_speed, s.c_front, s.c_rear, s.zeta0)
        rows.append((*map(number, numbers), " ".join(map(str, b.unstable.values()))))
    say(*table(titles, rows, limit=width()))
    if branch.origin is not None:
        say(f"leaves the homogeneous sphere at {branch.name} = {number(branch.origin, 9)}")
    for fold in branch.folds:
        speed = number(fold.state.max_retrograde_speed)
        say(f"fold at {branch.name} = {number(fold.value, 9)}, v_0 = {speed}")
    for c in branch.crossings:
        kind = "Hopf point" if c.oscillating else "branch point"
        say(f"{kind} of m = {c.m} at {branch.name} = {number(c.at.value, 9)}")
