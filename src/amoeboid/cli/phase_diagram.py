"""`amoeboid phase-diagram`: where the cell rests, polarizes, or may do both."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import PLOT_FAILS, add_plot, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import (
    add_parameters,
    number_or_quantity,
    only_parameters,
    print_json,
    say_parameters,
    whole,
)
from amoeboid.cli.tables import number, width

if TYPE_CHECKING:
    from amoeboid.studies.phase_diagram import PhaseDiagram

LABELS = {
    "name": "--vary",
    "low": "--from",
    "high": "--to",
    "lowest": "--speed-from",
    "highest": "--speed-to",
    "columns": "--columns",
    "rows": "--rows",
}
GAP = 2  # blanks between the speeds and the map


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `phase-diagram`."""
    add_parameters(parser)
    parser.add_argument("--vary", default="D", metavar="NAME", help="second parameter (default: D)")
    parser.add_argument(
        "--from",
        dest="low",
        type=number_or_quantity,
        metavar="VALUE",
        help="its lowest value (default for D: 0.03 beta R0^2)",
    )
    parser.add_argument(
        "--to",
        dest="high",
        type=number_or_quantity,
        metavar="VALUE",
        help="its highest value (default for D: 0.6 beta R0^2)",
    )
    parser.add_argument(
        "--speed-from",
        type=number_or_quantity,
        metavar="VALUE",
        help="lowest v_p0 (default: 3 for the paper's table, in proportion to the threshold for "
        "other cells)",
    )
    parser.add_argument(
        "--speed-to",
        type=number_or_quantity,
        metavar="VALUE",
        help="highest v_p0 (default: 8 for the paper's table, in proportion to the threshold for "
        "other cells)",
    )
    parser.add_argument(
        "--columns",
        type=whole,
        default=40,
        metavar="N",
        help="number of values of the second parameter (default: 40)",
    )
    parser.add_argument(
        "--rows", type=whole, default=40, metavar="N", help="number of values of v_p0 (default: 40)"
    )
    add_plot(parser, "the diagram")
    parser.epilog = (
        "Letters of the map: . rest, P polarized, b bistable, ! neither is stable, ? "
        "unresolved.\n"
        "example:\n"
        "  amoeboid phase-diagram --columns 10 --rows 10\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Compute column by column, print, draw."""
    from amoeboid.studies.phase_diagram import checked_counts, phase_diagram, windows

    p = only_parameters(args)
    windows(p, args.vary, args.low, args.high, args.speed_from, args.speed_to, LABELS)
    checked_counts(args.columns, args.rows, LABELS)
    check_picture(args.plot)
    with shown() as watch:
        diagram = phase_diagram(
            p,
            args.vary,
            args.low,
            args.high,
            speeds=(args.speed_from, args.speed_to),
            columns=args.columns,
            rows=args.rows,
            watch=watch,
        )
    for problem in diagram.problems:
        tell("phase-diagram", f"incomplete: {problem}")
    if diagram.problems:
        advice = "smoother states are easier to resolve: raise D or delta_P, or lower --speed-to"
        tell("phase-diagram", advice)
    if args.json:
        print_json(_document(diagram))
    else:
        say_parameters(p, ["v_p0", args.vary])
        _print_diagram(diagram)

    def draw(path: Path) -> None:
        from amoeboid.plotting.branches import write_phase_diagram

        write_phase_diagram(diagram, path)

    return drawn("phase-diagram", args.plot, draw)


def _document(diagram: PhaseDiagram) -> dict[str, Any]:
    from amoeboid.axisymmetric.phase_diagram import REGIONS

    name, found, plain = diagram.name, diagram.solution, diagram.plain

    def pairs(points: Any) -> list[dict[str, float]]:
        return [{name: plain(name, a), "v_p0": plain("v_p0", b)} for a, b in points]

    document = {
        "vary": name,
        name: [plain(name, v) for v in found.values],
        "v_p0": [plain("v_p0", v) for v in found.speeds],
        "regions": [[REGIONS[k] for k in row] for row in found.regions],
        "max_retrograde_speed": [[plain("v_p0", v) for v in row] for row in found.flow],
        "threshold": pairs(found.threshold_line),
        "fold": [
            {**pair, "line": k} for k, line in enumerate(found.fold_lines) for pair in pairs(line)
        ],
        "boundary": pairs(found.tips),
        "complete": diagram.complete,
        "problems": list(diagram.problems),
    }
    return document | ({"units": diagram.units} if diagram.units else {})


def _print_diagram(diagram: PhaseDiagram) -> None:
    name, regions = diagram.name, diagram.regions
    values = [diagram.plain(name, v) for v in diagram.solution.values]
    speeds = [diagram.plain("v_p0", v) for v in diagram.solution.speeds]
    units = {key: f" {unit}" for key, unit in diagram.units.items()}
    labels = [number(speed, 4) for speed in speeds]
    margin = max(map(len, labels))
    room = max(1, (width() or margin + GAP + len(values)) - margin - GAP)
    for first in range(0, len(values), room):  # maps side by side, where one is too wide
        part = slice(first, first + room)
        for label, row in zip(reversed(labels), regions[::-1], strict=True):
            say(f"{label:>{margin}}{' ' * GAP}{''.join('.Pb!?'[k] for k in row[part])}")
        ends = values[part]
        window = f"from {number(ends[0])} to {number(ends[-1])}{units.get(name, '')}"
        say(f"v_p0{units.get('v_p0', '')} up, {name} {window}")
    say(". rest   P polarized   b bistable", "! neither stable   ? unresolved")
    for value, speed in diagram.solution.tips:
        at = f"{number(diagram.plain(name, value))}{units.get(name, '')}"
        v_p0 = f"{number(diagram.plain('v_p0', speed))}{units.get('v_p0', '')}"
        say(f"super- and subcritical bifurcation meet at {name} = {at}, v_p0 = {v_p0}")
