"""One process at a time writes to the folder of a run; see `amoeboid.locks`."""

from __future__ import annotations

from pathlib import Path

from amoeboid.locks import FileLock, TakenError
from amoeboid.validation import InvalidInput

NAME = ".lock"


class FolderLock(FileLock):
    """The right to write to a folder, held from `take` to `release`."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / NAME)

    def take(self) -> bool:
        """See `FileLock.take`; raises InvalidInput if another process has the folder."""
        try:
            return super().take()
        except TakenError as by:
            raise InvalidInput(
                f"only one process may write to a run, {str(self.path.parent)!r} is being written "
                f"by {by}; wait until it has ended, or stop it"
            ) from None
