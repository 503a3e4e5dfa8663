"""`amoeboid figure`: the figures and tables of the paper as files."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.exit_codes import FAILURE
from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import NO_PICTURE, drawn_together
from amoeboid.cli.settings import add_parameters, parameters_from, print_json
from amoeboid.cli.tables import table, width
from amoeboid.extras import check
from amoeboid.terminal import shown_line
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.figures.figure import Figure
    from amoeboid.figures.results import Tell
    from amoeboid.figures.tables import FigureData
    from amoeboid.model.parameters import Parameters

ALL = "all"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `figure`."""
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="figures to make, or `all`; without a name, list the figures",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("figures"),
        metavar="DIR",
        help="folder for pictures and tables (default: figures)",
    )
    parser.add_argument(
        "--format",
        dest="formats",
        action="append",
        metavar="FORMAT",
        help="format of the pictures: png (default), pdf, svg; repeatable",
    )
    parser.add_argument(
        "--again", action="store_true", help="recompute, even if an earlier call has stored results"
    )
    add_parameters(parser)
    parser.epilog = (
        "Each figure is a picture, with its numbers and their units in CSV files.\nResults are "
        "stored in DIR/.computed and used again for the same parameters and version, so an "
        "interrupted command continues when it is repeated.\n--set changes the parameters of the "
        "figures; the defaults are those of the paper.\nexample:\n  amoeboid figure fig3a\nExit "
        "code 1: a figure could not be made; the others are made."
    )


def execute(args: argparse.Namespace) -> int:
    """List the figures, or make some."""
    from amoeboid import figures
    from amoeboid.figures.figure import checked_formats

    formats = checked_formats(args.formats or ["png"])
    check("the figures need", "matplotlib", "pint")
    if not args.names:
        found = [figures.named(name) for name in figures.names()]
        if args.json:
            print_json({f.name: {"title": f.title, "source": f.source} for f in found})
        else:
            rows = [(f.name, f.source, f.title) for f in found]
            say(*table(("name", "in the paper", "shows"), rows, "<<<", width()))
        return 0
    every = ALL in args.names
    chosen = [
        figures.named(name) for name in dict.fromkeys(figures.names() if every else args.names)
    ]
    given = {figure: _given(figure, args, every) for figure in chosen}
    if all(isinstance(p, InvalidInput) for p in given.values()):
        raise next(p for p in given.values() if isinstance(p, InvalidInput))
    _make_folder(args.output)
    code, document = 0, {}
    for number, (figure, p) in enumerate(given.items(), 1):
        place = f"{figure.name} ({number} of {len(given)})"
        try:
            document[figure.name], failed = _made(figure, _valid(p), args, formats, place)
        except InvalidInput as error:
            if len(given) == 1:
                raise
            tell("figure", f"{figure.name} could not be made: {error}")
            document[figure.name] = {"files": [], "notes": [], "problems": [str(error)]}
            failed = FAILURE
        code = max(code, failed)
    if args.json:
        print_json(document)
    return code


def _given(figure: Figure, args: argparse.Namespace, every: bool) -> Parameters | InvalidInput:
    """The parameters of a figure; of all figures, or why one cannot have those of --set."""
    try:
        return _parameters(figure, args, every)
    except InvalidInput as error:
        if not every:
            raise
        return error


def _valid(p: Parameters | InvalidInput) -> Parameters:
    if isinstance(p, InvalidInput):
        raise p
    return p


def _make_folder(path: Path) -> None:
    """Make the folder for the files. Raises InvalidInput before anything is computed, OSError."""
    if path.exists() and not path.is_dir():
        raise InvalidInput(f"-o must be a folder, {str(path)!r} is a file; choose another")
    path.mkdir(parents=True, exist_ok=True)
    if not os.access(path, os.W_OK | os.X_OK):
        raise InvalidInput(
            f"-o must be a folder that can be written to, got {str(path)!r}; choose another"
        )


def _made(
    figure: Figure, p: Parameters, args: argparse.Namespace, formats: Sequence[str], place: str
) -> tuple[dict[str, Any], int]:
    """Make one figure, tables first; what was made of it, and the exit code."""
    from amoeboid.figures.results import Results

    begun = time.monotonic()
    with shown_line() as show:
        results = Results(args.output, _placed(show, place), args.again)
        data = figure.data(p, results)
    files = figure.write_tables(data, args.output)
    code = FAILURE if data.problems else 0
    for one in formats:
        picture = args.output / f"{figure.name}.{one}"
        succeeded = drawn_together("figure", {picture: partial(_draw, figure, data)})
        files += [picture] if succeeded else []
        code = code if succeeded else NO_PICTURE
    seconds = time.monotonic() - begun
    for problem in data.problems:
        tell("figure", f"{figure.name}: {problem}")
    if not args.json:
        say(f"{figure.name}: {figure.title} ({figure.source}), {seconds:.1f} s")
        say(*(f"  {note}" for note in data.notes), *(f"  {path}" for path in files))
    names = [str(path) for path in files]
    return {"files": names, "notes": list(data.notes), "problems": list(data.problems)}, code


def _draw(figure: Figure, data: FigureData, path: Path) -> None:
    figure.write_pictures(data, path.parent, [path.suffix[1:]])


def _placed(show: Tell | None, place: str) -> Tell:
    from amoeboid.figures.results import untold

    if show is None:
        return untold
    return lambda parts: show([place, *parts])


def _parameters(figure: Figure, args: argparse.Namespace, every: bool) -> Parameters:
    """The parameters of a figure with those of --set. Raises InvalidInput for one that it varies.

    Of all figures, those that vary it themselves go without it, and say so.
    """
    settings = list(args.settings)
    for setting in args.settings:
        name = setting.partition("=")[0].strip().removeprefix("parameters.")
        if name in figure.varies:
            if not every:
                raise InvalidInput(
                    f"--set must not set {name} for {figure.name}, which varies it, got "
                    f"{setting!r}; leave it out"
                )
            tell("figure", f"{figure.name} varies {name}; made without {setting!r}")
            settings.remove(setting)
    if not settings and not args.physical:
        return figure.parameters
    return parameters_from(settings, args.physical, figure.parameters)
