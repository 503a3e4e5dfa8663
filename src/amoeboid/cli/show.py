"""`amoeboid show`: what a stored run is, and its picture drawn again."""

from __future__ import annotations

import argparse

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import NO_PICTURE
from amoeboid.cli.settings import add_json, path, print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `show`."""
    parser.add_argument("run", type=path, metavar="RUN", help="folder of a run")
    parser.add_argument(
        "--plot",
        type=path,
        metavar="FILE",
        help="file for the picture (.png; default: RUN/cell.png)",
    )
    add_json(parser)
    parser.epilog = (
        "Observables are those of the last cell. Numbers are in the units of the run: um, s, "
        "... if its parameters have physical units.\n"
        "Exit code 1: a part of the run could not be read, or the picture could not be drawn; the "
        "rest is shown."
    )


def execute(args: argparse.Namespace) -> int:
    """Read, print, draw."""
    from amoeboid.exports.summary import document, summary
    from amoeboid.runs.stored import load

    run = load(args.run)
    found = summary(run, args.plot)
    if args.json:
        print_json(document(run, found))
    else:
        say(*found.lines)
    for problem in found.problems:
        tell("show", problem)
    return NO_PICTURE if found.problems else 0
