"""The installed command: `main`, with Ctrl-C and readers that leave ending it quietly."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from types import FrameType

from amoeboid.cli import garbage
from amoeboid.cli.exit_codes import FAILURE, INTERRUPTED

# KeyboardInterrupt in the middle of their work is lost (in a callback), or crashes the compiler.
NOT_TO_BE_INTERRUPTED = {"importlib", "numba", "llvmlite"}


def program() -> int:
    """Run the command that the arguments ask for; returns the exit code."""
    garbage.command_begins()
    # otherwise Ctrl-C is ignored, as in the background of a shell, and stays so
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        from amoeboid.cli.output import flushed, open_streams

        open_streams()
        try:
            with garbage.imports():
                from amoeboid.cli.main import main

            code = main()
        except SystemExit as leaving:  # --help, --version, wrong arguments
            code = int(leaving.code or 0)
        return code if flushed() else code or FAILURE
    except KeyboardInterrupt:
        _say()
        return INTERRUPTED
    finally:
        garbage.command_ends()


def _interrupt(_: int, frame: FrameType | None) -> None:
    """KeyboardInterrupt, or where that is not safe the end of the program."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] in NOT_TO_BE_INTERRUPTED:
            _say()
            os._exit(INTERRUPTED)
        frame = frame.f_back
    raise KeyboardInterrupt


def _say() -> None:
    # a handler may find the stream of Python busy
    with suppress(OSError):
        os.write(2, b"amoeboid: interrupted\n")
