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
from amoeboid.cli.help import HelpFormatter
from amoeboid.cli.output import tell, warnings_told
from amoeboid.terminal import write
from amoeboid.validation import InvalidInput, refuse_unknown

# A command is a module of this package with add_arguments(parser) and execute(args) -> exit code;
# its heavy imports belong into execute, so that --help stays quick.
COMMANDS = {
    "run": "simulate a cell in 3D; without arguments, figure 3D of the paper",
    "show": "summarize a stored run and draw its last cell again",
    "export": "convert a stored run for other programs (vtp, csv, netcdf, ...) or to a movie",
    "theory": "compute thresholds, growth rates, bifurcation and flow in closed form",
    "steady": "find the axisymmetric steady states at one parameter point, with their stability",
    "branch": "follow the polarized state along a parameter: folds, branch points, stability",
    "phase-diagram": "map resting, polarized and bistable cells in v_p0 and a second parameter",
    "sweep": "evaluate a solver at many parameter points in parallel, into one table",
    "fit": "fit cell parameters to measured profiles of flow and concentration, with errors",
    "motility": "compute the migration velocity in a fluid, a matrix, on substrates, in channels",
    "explore": "open a live page in the browser: sliders, the branch, and a moving 3D cell",
    "figure": "make the figures and tables of the paper, with the numbers that they show",
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
    words = sys.argv[1:] if argv is None else argv
    try:
        parser = _parser(words)
        _refuse_unknown_command(parser, words)
        args = parser.parse_args(words)
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


def _refuse_unknown_command(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Exit with a message that names the nearest command."""
    try:
        refuse_unknown([word for word in words[:1] if word[:1] != "-"], COMMANDS, "command")
    except InvalidInput as error:
        parser.error(str(error))


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Knows the command that comes first, with its options; or else all commands."""
    parser = _Parser(
        prog="amoeboid",
        description="Cells that polarize and migrate by actin polymerization, without myosin.",
    )
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    first = words[0] if words else ""
    for name in [first] if first in COMMANDS else COMMANDS:  # the others would take milliseconds
        summary = COMMANDS[name]
        command = commands.add_parser(
            name,
            help=summary,
            description=f"{summary[0].upper()}{summary[1:]}.",
            formatter_class=HelpFormatter,
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
