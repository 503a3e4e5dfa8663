"""Files that are never half-written: under a temporary name first, or only extended."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from amoeboid.validation import InvalidInput

PARTIAL = re.compile(r"\..+\.\d+\.partial(\.\w+)?")  # names of files before they are renamed


def remove_partial(folder: Path) -> None:
    """Remove what programs that were killed had begun to write in a folder, and below it."""
    for path in folder.rglob(".*"):
        if PARTIAL.fullmatch(path.name):
            path.unlink(missing_ok=True)


def write_atomically(path: Path, write: Callable[[Path], None]) -> None:
    """Let `write` make a file under a temporary name beside `path`, then rename it.

    Raises OSError, which names `path`: of a full disk the system does not say which file it was.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        with naming(path, temporary):
            write(temporary)
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def naming(path: Path, temporary: Path | None = None) -> Iterator[None]:
    """Let an OSError that names no file, or a temporary one, name this file."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically."""
    write_atomically(path, lambda p: _write(p, text))


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file of bytes atomically."""
    write_atomically(path, lambda p: _write_bytes(p, data))


def _write_bytes(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def text_of(path: Path) -> str:
    """A text file in UTF-8, with or without byte order mark. Raises InvalidInput, OSError."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidInput(f"{str(path)!r} must be a text file in UTF-8") from None


class GrowingFile:
    """A text file of which one end is always the same, written once and then only extended."""

    def __init__(self, path: Path, end: str = "") -> None:
        self.path, self.end = path, end
        self._place: int | None = None

    def write(self, text: str) -> None:
        """Write all of it, atomically; `text` ends with `end`."""
        self._place = None
        write_text(self.path, text)
        self._place = len(text.encode()) - len(self.end.encode())

    def extend(self, text: str, whole: Callable[[], str]) -> None:
        """Add `text` before the end in one piece; `whole` is what the file shall be after it.

        All of it is written the first time, and where the file is no longer what was written.
        """
        place, self._place = self._place, None
        if place is None or not _has_size(self.path, place + len(self.end.encode())):
            self.write(whole())
            return
        data = text.encode()
        with naming(self.path), self.path.open("r+b", buffering=0) as file:
            file.seek(place)
            rest = memoryview(data + self.end.encode())
            while rest:
                rest = rest[file.write(rest) or 0 :]
        self._place = place + len(data)


def _has_size(path: Path, size: int) -> bool:
    try:
        return path.stat().st_size == size
    except FileNotFoundError:
        return False
