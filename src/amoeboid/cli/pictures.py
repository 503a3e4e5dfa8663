"""Pictures that a command draws once its results are printed."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from amoeboid.cli.output import tell
from amoeboid.validation import InvalidInput

NO_PICTURE = 1  # exit code: the results are printed, the picture that was asked for is missing
PLOT_FAILS = "Exit code 1 if the picture of --plot cannot be drawn; results are printed before."
SUFFIXES = (".png", ".pdf", ".svg")


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
            f"--plot must lie in a folder that can be written to, got {str(path)!r}; choose another"
        )


def drawn(command: str, path: Path, draw: Callable[[Path], object]) -> bool:
    """Let `draw` write a picture to `path`; if it fails, that is one message, and False."""
    # of fonts and caches that a file of settings or a folder lacks
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        with _no_backend():
            draw(path)
    except Exception as error:  # drawing packages raise whatever they meet, at their import too
        what = " ".join(str(error).split()) or type(error).__name__
        tell(command, f"the picture {str(path)!r} could not be drawn: {what}")
        return False
    return True


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
