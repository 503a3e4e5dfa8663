"""Pictures that a command draws once its results are printed."""

from __future__ import annotations

import argparse
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from amoeboid.cli.output import tell
from amoeboid.extras import check
from amoeboid.validation import InvalidInput

NO_PICTURE = 1  # exit code: the results are printed, the picture that was asked for is missing
PLOT_FAILS = "Exit code 1: the picture of --plot could not be drawn (results are printed before)."
Draw = Callable[[Path], object]
SUFFIXES = (".png", ".pdf", ".svg")


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare --plot."""
    parser.add_argument("--plot", type=Path, metavar="FILE", help=f"draw {what} (.png .pdf .svg)")


def check_picture(path: Path | None) -> None:
    """Refuse a file for a picture that cannot be written, before anything is computed."""
    if path is None:
        return
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidInput(f"--plot must end in {', '.join(SUFFIXES)}, got {str(path)!r}")
    if path.is_dir():
        raise InvalidInput(f"--plot must be a file, {str(path)!r} is a folder; add a name to it")
    if not path.parent.is_dir():
        raise InvalidInput(f"--plot must lie in an existing folder, got {str(path)!r}")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InvalidInput(
            f"--plot must lie in a writable folder, got {str(path)!r}; choose another"
        )
    check("--plot needs", "matplotlib")


def drawn(command: str, path: Path | None, draw: Draw, code: int = 0) -> int:
    """The exit code of a command: `code`, unless the picture of --plot cannot be drawn."""
    return code if path is None or drawn_together(command, {path: draw}) else NO_PICTURE


def drawn_together(command: str, pictures: Mapping[Path, Draw]) -> bool:
    """Let each function write a picture to its path; one that fails is one message, and False.

    All but the first are to be drawn by processes of theirs.
    """
    # of fonts and caches that a file of settings or a folder lacks
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    (path, draw), *others = pictures.items()
    with _no_backend(), ThreadPoolExecutor() as threads:
        waiting = [threads.submit(_problem, *picture) for picture in others]
        problems = [_problem(path, draw), *(picture.result() for picture in waiting)]
    for where, problem in zip(pictures, problems, strict=True):
        if problem:
            tell(command, f"the picture {str(where)!r} could not be drawn: {problem}")
    return not any(problems)


def _problem(path: Path, draw: Draw) -> str:
    """Draw; what went wrong, empty if nothing did."""
    try:
        draw(path)
    except Exception as error:  # drawing packages raise whatever they meet, at their import too
        return " ".join(str(error).split()) or type(error).__name__
    return ""


@contextmanager
def _no_backend() -> Iterator[None]:
    """Hide the backend of matplotlib that the environment names, of a notebook for one.

    Pictures are written to files and need none; where it is not installed, the import fails.
    """
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        yield
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
