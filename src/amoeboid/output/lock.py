"""One process at a time writes to a folder.

The lock is that of the system on a file in the folder. It ends with the process, also if that is
killed. Where a file system has none, nobody notices two processes on one folder.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from amoeboid.validation import InvalidInput

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

NAME = ".lock"
MAX_WORDS = 200


class FolderLock:
    """The right to write to a folder, held from `take` to `release`."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self._file: int | None = None

    def take(self) -> None:
        """Take the lock, if it is not held already. Raises InvalidInput if another process has it.

        OSError if the file cannot be made.
        """
        if fcntl is None:
            return
        while self._file is None:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
            try:
                self._lock(file)
                # the process that had it may have removed the file meanwhile
                kept = self.path.exists() and os.path.samestat(os.fstat(file), self.path.stat())
            except BaseException:
                os.close(file)
                raise
            if kept:
                self._file = file
                os.ftruncate(file, 0)
                with suppress(OSError):  # a full disk: the words are for people
                    os.pwrite(file, f"process {os.getpid()} on {os.uname().nodename}".encode(), 0)
            else:
                os.close(file)

    def _lock(self, file: int) -> None:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):
            words = os.pread(file, MAX_WORDS, 0).decode(errors="replace")
            raise InvalidInput(
                f"only one process may write to a run, {str(self.path.parent)!r} is being written "
                f"by {words.strip() or 'another'}; wait until it has ended, or stop it"
            ) from None
        except OSError:  # this file system has no locks
            return

    def release(self) -> None:
        """Remove the file and give the lock back, if it is held."""
        file, self._file = self._file, None
        if file is not None:
            self.path.unlink(missing_ok=True)
            os.close(file)
