"""What the commands write: results on standard output, messages on standard error.

Text is written as it is: nothing in it is read as markup, and lines are never cut or folded, so
that paths can be copied and programs can read what is piped to them.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from amoeboid.terminal import ERASE, is_terminal, write

CONTROL_CHARACTERS = re.compile(r"[\x00-\x1f\x7f-\x9f]")


def say(*lines: str) -> None:
    """Print lines of a result. A reader that has left (`| head`) is no error; a full disk is.

    Raises OSError.
    """
    write(sys.stdout, _as_they_are(lines))


def tell(command: str, message: object) -> None:
    """Print a message of a command on standard error, in one line."""
    line = _as_they_are([f"{f'amoeboid {command}'.strip()}: {message}"])
    with suppress(OSError):  # over a line of progress, if there is one
        write(sys.stderr, f"{ERASE}{line}" if is_terminal(sys.stderr) else line)


@contextmanager
def warnings_told(command: str) -> Iterator[None]:
    """Warnings of any package as messages of the command."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        tell(command, message)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def flushed() -> bool:
    """Write what is still in the buffers; whether that worked, or no reader is left."""
    try:
        for stream in (sys.stderr, sys.stdout):
            write(stream, "")
    except OSError:
        return False
    return True


def open_streams() -> None:
    """Put /dev/null where a standard stream is closed (`2>&-`).

    The next file that is opened would get its number otherwise, and what is printed.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            stream = open(number, "w", errors="backslashreplace", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


def _as_they_are(lines: Iterable[str]) -> str:
    return "".join(f"{CONTROL_CHARACTERS.sub(_escaped, line)}\n" for line in lines)


def _escaped(control: re.Match[str]) -> str:
    return control.group().encode("unicode_escape").decode()
