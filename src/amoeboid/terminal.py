"""Lines of progress on standard error: on a terminal, or in a notebook, and nowhere else."""

from __future__ import annotations

import html
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any, Protocol, TextIO

Show = Callable[[Sequence[str]], None]

ERASE = "\r\x1b[K"  # to the beginning of the line of a terminal, and clear what follows
BETWEEN = 0.1  # seconds between two lines, so that writing them takes no time
NOTEBOOK_WIDTH = 100  # characters


def is_terminal(stream: TextIO | None) -> bool:
    """Whether lines that are written to a stream can be erased again."""
    plain = os.environ.get("TERM") in ("dumb", "unknown")
    return stream is not None and stream.isatty() and not plain


def write(stream: TextIO | None, text: str) -> None:
    """Write text to a standard stream at once. What no reader is left for, is dropped.

    Raises OSError, once, if there is no room for it.
    """
    if stream is None:
        return
    try:
        stream.write(text)
        stream.flush()
    except OSError as error:
        # what is left in its buffer would be tried again when Python ends
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        if not isinstance(error, BrokenPipeError):
            raise


class Line(Protocol):
    """A line that shows parts, each time in place of what it showed before."""

    def show(self, parts: Sequence[str]) -> None:
        """Show parts, as many as fit."""

    def erase(self) -> None:
        """Show nothing."""


_silent: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silenced() -> Iterator[None]:
    """No lines of progress: of the parts of a computation that shows one line for all of them."""
    before = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(before)


def progress_line() -> Line | None:
    """A line to show progress in; None where there is no place for it."""
    if _silent.get():
        return None
    if is_terminal(sys.stderr):
        return _TerminalLine(sys.stderr)
    display = _notebook()
    return None if display is None else _NotebookLine(display)


@contextmanager
def shown_line(after: float = 0.0) -> Iterator[Show | None]:
    """A function that shows a line made of parts; None where there is no place for it.

    Nothing is shown in the first `after` seconds. Parts that do not fit are left out from the last;
    none is cut. The line is erased at the end.
    """
    line = progress_line()
    if line is None:
        yield None
        return
    latest = time.monotonic() + after - BETWEEN

    def show(parts: Sequence[str]) -> None:
        nonlocal latest
        if time.monotonic() - latest < BETWEEN:
            return
        latest = time.monotonic()
        line.show(parts)

    try:
        yield show
    finally:
        line.erase()


class _TerminalLine:
    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def show(self, parts: Sequence[str]) -> None:
        with suppress(OSError):
            columns = shutil.get_terminal_size().columns - 1
            write(self._stream, ERASE + fitting(parts, columns))

    def erase(self) -> None:
        with suppress(OSError):
            write(self._stream, ERASE)


class _NotebookLine:
    """A line below the cell of a notebook, which is replaced by the next one.

    It is HTML first, because an empty plain text would stay behind as an empty box.
    """

    def __init__(self, display: Any) -> None:
        self._display, self._handle = display, None

    def show(self, parts: Sequence[str]) -> None:
        text = fitting(parts, NOTEBOOK_WIDTH)
        data = {"text/html": f"<pre>{html.escape(text)}</pre>", "text/plain": text}
        if self._handle is None:
            self._handle = self._display(data, raw=True, display_id=True)
        else:
            self._handle.update(data, raw=True)

    def erase(self) -> None:
        if self._handle is not None:
            self._handle.update({"text/html": "", "text/plain": ""}, raw=True)


def in_notebook() -> bool:
    """Whether this is the kernel of a notebook."""
    return _notebook() is not None


def _notebook() -> Any:
    """IPython's function `display` in the kernel of a notebook, None elsewhere."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython.display import display

    return display


def fitting(parts: Sequence[str], limit: int) -> str:
    """The first parts, two blanks apart, that fit into `limit` columns; none is cut."""
    line = ""
    for part in parts:
        longer = f"{line}  {part}" if line else part
        if len(longer) > limit:
            break
        line = longer
    return line
