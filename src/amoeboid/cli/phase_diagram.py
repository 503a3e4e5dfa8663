"""`amoeboid phase-diagram`: where the cell rests, polarizes, or may do both."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import NO_PICTURE, PLOT_FAILS, check_picture, drawn
from amoeboid.cli.progress import shown, shown_line
from amoeboid.cli.settings import add_parameters, only_parameters, print_json, real, whole
from amoeboid.cli.tables import number, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.axisymmetric.phase_diagram import PhaseDiagram
    from amoeboid.model.parameters import Parameters

LARGEST_GRID = 500
D_WINDOW, V_WINDOW = (0.03, 0.6), (3.0, 8.0)  # for the paper's table
GAP = 2  # blanks between the speeds and the map


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `phase-diagram`."""
    add_parameters(parser)
    parser.add_argument("--vary", default="D", metavar="NAME", help="parameter beside v_p0 (D)")
    parser.add_argument(
        "--from", dest="low", type=real, metavar="VALUE", help="its lowest (D: 0.03 beta R0^2)"
    )
    parser.add_argument(
        "--to", dest="high", type=real, metavar="VALUE", help="its highest (D: 0.6 beta R0^2)"
    )
    parser.add_argument(
        "--speed-from",
        type=real,
        metavar="VALUE",
        help="lowest v_p0 (3 in the units of the paper's table, elsewhere as far below threshold)",
    )
    parser.add_argument(
        "--speed-to",
        type=real,
        metavar="VALUE",
        help="highest v_p0 (8 in the units of the paper's table, elsewhere as far above threshold)",
    )
    parser.add_argument("--columns", type=whole, default=40, metavar="N", help="values of it (40)")
    parser.add_argument("--rows", type=whole, default=40, metavar="N", help="values of v_p0 (40)")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw it (.png .pdf .svg)")
    parser.epilog = PLOT_FAILS


def execute(args: argparse.Namespace) -> int:
    """Compute column by column, print, draw."""
    import numpy as np

    from amoeboid.axisymmetric.phase_diagram import phase_columns, phase_diagram

    p = only_parameters(args)
    others = [name for name in p.names if name != "v_p0"]
    if args.vary not in others:
        raise InvalidInput(f"--vary must be one of {', '.join(others)}, got {args.vary!r}")
    (args.low, args.high), (args.speed_from, args.speed_to) = windows(args, p)
    _check(args, p)
    check_picture(args.plot)
    values = np.linspace(args.low, args.high, args.columns)
    speeds = np.linspace(args.speed_from, args.speed_to, args.rows)
    columns = []
    with shown_line() as show:
        for column in phase_columns(p, args.vary, values, speeds):
            columns.append(column)
            if show is not None:
                show([f"column {len(columns)} of {args.columns} in {args.vary}"])
    with shown() as watch:
        diagram = phase_diagram(p, args.vary, values, speeds, tuple(columns), watch)
    for problem in diagram.problems:
        tell("phase-diagram", f"incomplete: {problem}")
    if diagram.problems:
        advice = "smoother states are easier: a larger D or delta_P, a smaller --speed-to"
        tell("phase-diagram", advice)
    if args.json:
        print_json(_document(diagram))
    else:
        _print_diagram(diagram)
    if args.plot is None:
        return 0
    from amoeboid.plotting.branches import draw_phase_diagram

    succeeded = drawn("phase-diagram", args.plot, lambda path: draw_phase_diagram(diagram, path))
    return 0 if succeeded else NO_PICTURE


def windows(args: argparse.Namespace, p: Parameters) -> tuple[list[float], list[float]]:
    """Lowest and highest value of the other parameter, and of v_p0.

    What is not given is that of the paper's table in units of this cell: D in beta R0^2, v_p0 in
    proportion to its threshold. Raises InvalidInput where there is no such unit.
    """
    from amoeboid.closed_forms.linear import critical_speed
    from amoeboid.model.parameters import Parameters

    wanted = [args.low, args.high]
    if None in wanted:
        unit = p.beta * p.R0**2
        if args.vary != "D" or unit == 0:
            raise InvalidInput(
                f"--from and --to must be given for {args.vary} (beta = {p.beta:g}): there is no "
                "window to start from"
            )
        wanted = [k * unit if v is None else v for k, v in zip(D_WINDOW, wanted, strict=True)]
    speeds = [args.speed_from, args.speed_to]
    if None in speeds:
        try:
            here = float(critical_speed(p.replace(**{args.vary: wanted[0]})))
        except InvalidInput as problem:
            raise InvalidInput(f"--speed-from and --speed-to must be given: {problem}") from None
        table = Parameters(D=D_WINDOW[0])
        unit = here / float(critical_speed(table))
        speeds = [k * unit if v is None else v for k, v in zip(V_WINDOW, speeds, strict=True)]
    return wanted, speeds


def _check(args: argparse.Namespace, p: Parameters) -> None:
    ends = (
        ("--from", args.vary, args.low),
        ("--to", args.vary, args.high),
        ("--speed-from", "v_p0", args.speed_from),
        ("--speed-to", "v_p0", args.speed_to),
    )
    for option, name, value in ends:
        if not math.isfinite(value):
            raise InvalidInput(f"{option} must be a finite number, got {value!r}")
        p.replace(**{name: value})
    for low, high, text in (
        (args.low, args.high, "--from must be < --to"),
        (args.speed_from, args.speed_to, "--speed-from must be < --speed-to"),
    ):
        if not low < high:
            raise InvalidInput(f"{text}, got {low:g} and {high:g}")
    for option, count in (("--columns", args.columns), ("--rows", args.rows)):
        if not 2 <= count <= LARGEST_GRID:
            raise InvalidInput(f"{option} must be >= 2 and <= {LARGEST_GRID}, got {count}")


def _document(diagram: PhaseDiagram) -> dict[str, Any]:
    from amoeboid.axisymmetric.phase_diagram import REGIONS

    name = diagram.name

    def pairs(points: Any) -> list[dict[str, float]]:
        return [{name: float(a), "v_p0": float(b)} for a, b in points]

    thresholds = [(c.value, c.threshold) for c in diagram.columns if c.threshold is not None]
    return {
        "vary": name,
        name: [float(v) for v in diagram.values],
        "v_p0": [float(v) for v in diagram.speeds],
        "regions": [[REGIONS[k] for k in row] for row in diagram.regions],
        "max_retrograde_speed": [[float(v) for v in row] for row in diagram.flow],
        "threshold": pairs(thresholds),
        "fold": [
            {**pair, "line": k} for k, line in enumerate(diagram.fold_lines) for pair in pairs(line)
        ],
        "boundary": pairs(diagram.tips),
        "complete": diagram.complete,
        "problems": list(diagram.problems),
    }


def _print_diagram(diagram: PhaseDiagram) -> None:
    name, values = diagram.name, diagram.values
    labels = [number(speed, 4) for speed in diagram.speeds]
    margin = max(map(len, labels))
    room = max(1, (width() or margin + GAP + values.size) - margin - GAP)
    for first in range(0, values.size, room):  # maps side by side, where one is too wide
        part = slice(first, first + room)
        for label, row in zip(reversed(labels), diagram.regions[::-1], strict=True):
            say(f"{label:>{margin}}{' ' * GAP}{''.join('.Pb!?'[k] for k in row[part])}")
        ends = values[part]
        say(f"v_p0 up, {name} from {number(ends[0])} to {number(ends[-1])}")
    say(". rest   P polarized   b bistable", "! neither stable   ? unresolved")
    for value, speed in diagram.tips:
        say(
            f"super- and subcritical bifurcation meet at {name} = {number(value)}, "
            f"v_p0 = {number(speed)}"
        )
