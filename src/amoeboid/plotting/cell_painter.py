"""The process that draws a cell, beside which the program computes or draws something else."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress

from amoeboid.plotting import cell_process
from amoeboid.threads import VARIABLES

MAX_DRAWING = 120.0  # seconds; the largest mesh takes a few
MAX_IDLE = 10.0  # seconds; a longer run can wait for a process, and should not keep one
REMEDY = "ParaView opens the frames"


class NoPicture(RuntimeError):
    """The drawing process failed; the message says how."""


class CellPainter:
    """A process that draws one cell, started before there is one: `with CellPainter() as painter`.

    It is gone after that, after MAX_IDLE seconds, or when the program ends, however it does. If it
    is gone when there is a cell to draw, another one is started.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> CellPainter:
        with suppress(OSError):  # what the system says of it is told when there is a cell
            self._process = _started()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            _end(self._process)

    def picture(self, archive: bytes) -> bytes:
        """The PNG file of the scene in an .npz archive. Raises NoPicture, OSError."""
        early, self._process = self._process, None
        if early is not None:
            if early.poll() is None:
                code, png, errors = _asked(early, archive)
                if code != cell_process.LEFT:
                    return _sound(code, png, errors)
            _end(early)
        return _sound(*_asked(_started(), archive))


def _started() -> subprocess.Popen[bytes]:
    return subprocess.Popen(  # noqa: S603  (our own program)
        [sys.executable, "-P", cell_process.__file__, str(MAX_IDLE)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env=os.environ | dict.fromkeys(VARIABLES, "1"),
    )  # fmt: skip


def _asked(process: subprocess.Popen[bytes], archive: bytes) -> tuple[int, bytes, bytes]:
    """Exit code, picture and messages. Raises NoPicture if it takes too long."""
    with process:
        try:
            png, errors = process.communicate(archive, timeout=MAX_DRAWING)
        except subprocess.TimeoutExpired:
            process.kill()
            raise NoPicture(
                f"the drawing process took more than {MAX_DRAWING:g} s; {REMEDY}"
            ) from None
        except BaseException:
            process.kill()
            raise
        return process.returncode, png, errors


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process that has nothing to draw."""
    process.kill()
    with process:
        process.communicate()


def _sound(code: int, png: bytes, errors: bytes) -> bytes:
    """The picture. Raises NoPicture if the process failed."""
    if code == 0 and png:
        return png
    lines = errors.decode(errors="replace").split("\n")
    said = [line.strip() for line in lines if line.strip()]
    ending = ": ".join([f"the drawing process ended with {_ending(code)}", *said[-1:]])
    raise NoPicture(f"{ending}; {REMEDY}")


def _ending(code: int) -> str:
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"code {code}"
