"""Files by which one process keeps others away from a folder.

The lock is that of the system on an open file. It ends with the process, also if that is killed.
Where a system or a file system has none, nobody notices two processes at the same work.
"""

from __future__ import annotations

import os
import platform
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

MAX_WORDS = 200


class TakenError(Exception):
    """Another one holds the lock; the message says which process, as far as that is known."""


class FileLock:
    """The lock on a file, held from `take` to `release`, alone or together with others who share.

    It also ends with this object. `why_not` says why there is none, where the file system has none.
    """

    def __init__(self, path: Path, shared: bool = False) -> None:
        self.path, self.shared = path, shared
        self.why_not = ""
        self._file: int | None = None

    def take(self) -> bool:
        """Take the lock, if it is not held already; False where there are no locks.

        Raises TakenError if another one has it, and OSError if the file cannot be made.
        """
        while self._file is None and fcntl is not None:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
            try:
                self._lock(file)
                # who had it may have removed the file meanwhile
                kept = self.path.exists() and os.path.samestat(os.fstat(file), self.path.stat())
            except BaseException:
                os.close(file)
                raise
            if not kept:
                os.close(file)
                continue
            self._file = file
            with suppress(OSError):  # a full disk: the words are for people
                os.ftruncate(file, 0)
                os.pwrite(file, f"process {os.getpid()} on {platform.node()}".encode(), 0)
        return self._file is not None and not self.why_not

    def _lock(self, file: int) -> None:
        try:
            fcntl.flock(file, (fcntl.LOCK_SH if self.shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):
            words = os.pread(file, MAX_WORDS, 0).decode(errors="replace")
            raise TakenError(words.strip() or "another process") from None
        except OSError as error:
            self.why_not = str(error)

    def release(self) -> None:
        """Give the lock back, if it is held; who held it alone removes the file."""
        file, self._file = self._file, None
        if file is not None:
            if not self.shared:
                self.path.unlink(missing_ok=True)
            os.close(file)

    def __del__(self) -> None:
        if self._file is not None:
            os.close(self._file)
