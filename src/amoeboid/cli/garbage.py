"""What imports make stays until the program ends: nothing to look through for garbage.

Python would do so while it imports, again and again, and once more at its end.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

_own_process = False


def command_begins() -> None:
    """This process is the command and nothing else; `command_ends` is called at its end."""
    global _own_process
    _own_process = True
    gc.disable()


def command_ends() -> None:
    """Let all that is left end with the process."""
    gc.freeze()


@contextmanager
def imports() -> Iterator[None]:
    """No garbage is looked for in here, and later not among what is there at the end.

    In the process of a user, who calls `main`, everything stays as it is.
    """
    if not _own_process:
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
