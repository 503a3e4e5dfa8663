"""`amoeboid`: finds the command, turns user mistakes into one message and exit code 2."""

from __future__ import annotations

import argparse
import errno
import io
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

from amoeboid.cli import output
from amoeboid.cli.exit_codes import FAILURE, INTERRUPTED, USER_MISTAKE
from amoeboid.cli.output import tell, warnings_told
from amoeboid.terminal import write
from amoeboid.validation import InvalidInput

# A command is a module of this package with add_arguments(parser) and execute(args) -> exit code;
# its heavy imports belong into execute, so that --help stays quick.
COMMANDS = {
    "run": "a 3D simulation; with no argument, figure 3D of the paper",
    "show": "what a stored run is, how it ended, and its picture again",
    "export": "a stored run for other programs (vtp, csv, netcdf, ...) and as a movie",
    "theory": "thresholds, growth rates, type of bifurcation and predicted flow, in closed form",
    "steady": "all axisymmetric steady states found at one parameter point, with stability",
    "branch": "continuation of the polarized state: points, folds, branch points, stability",
    "phase-diagram": "super/subcritical boundary and the bistable region",
    "sweep": "a solver at many points of parameters, in parallel, with all answers in one table",
    "fit": "parameters of a cell from measured profiles of flow and concentration, with errors",
    "motility": "migration velocity in a fluid, a matrix, on substrates and in channels",
    "explore": "a live page in the browser: sliders, the branch, and a 3D cell that moves",
    "figure": "the figures and tables of the paper, with the numbers that they show",
}

# What the system says of a path that leads nowhere; a full disk, for one, is nobody's mistake.
MISTAKEN_PATH = {
    errno.ENOENT,
    errno.EACCES,
    errno.EPERM,
    errno.EISDIR,
    errno.ENOTDIR,
    errno.ENAMETOOLONG,
    errno.ELOOP,
    errno.EROFS,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    try:
        words = sys.argv[1:] if argv is None else argv
        args = _parser(words).parse_args(words)
    except OSError as error:  # no room for what --help prints
        tell("", error)
        return FAILURE
    if isinstance(sys.stdout, io.TextIOWrapper):
        # a terminal that lacks a letter of a folder's name gets its number
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with warnings_told(args.command):
            return int(args.execute(args))
    except InvalidInput as error:
        tell(args.command, error)
        return USER_MISTAKE
    except OSError as error:
        tell(args.command, error)
        return USER_MISTAKE if error.errno in MISTAKEN_PATH else FAILURE
    except KeyboardInterrupt:
        tell(args.command, "interrupted")
        return INTERRUPTED


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Knows all commands, and the options of those that are named."""
    parser = _Parser(
        prog="amoeboid",
        description="Cells that polarize and migrate by actin polymerization, without myosin.",
    )
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, summary in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=summary,
            description=f"{summary[0].upper()}{summary[1:]}.",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name in words:  # to import the others would take as long as a short command
            module = import_module(f"amoeboid.cli.{name.replace('-', '_')}")
            module.add_arguments(command)
            command.set_defaults(execute=module.execute)
    return parser


class _Parser(argparse.ArgumentParser):
    def _print_message(self, message: str, file: Any = None) -> None:
        if file is sys.stdout:
            write(file, message)
        else:
            with suppress(OSError):
                write(sys.stderr, message)


class _Version(argparse.Action):
    def __init__(self, option_strings: list[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="print the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        output.say(f"amoeboid {version('amoeboid')}")
        parser.exit()
