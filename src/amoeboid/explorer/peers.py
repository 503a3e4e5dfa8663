"""Whose program is at the other end of a connection on this computer."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

TABLE = Path("/proc/net/tcp")


def is_of_another_user(client: tuple[str, int], server: tuple[str, int]) -> bool:
    """Whether the program at the other end belongs to another user.

    Linux tells; elsewhere, and where its table is not to be read, the answer is no.
    """
    if not sys.platform.startswith("linux"):
        return False
    ends = _written(client), _written(server)
    try:
        rows = [line.split() for line in TABLE.read_text().splitlines()[1:]]
    except OSError:
        return False
    return any((row[1], row[2]) == ends and int(row[7]) != os.getuid() for row in rows)


def _written(end: tuple[str, int]) -> str:
    """An address as the table has it."""
    host = int.from_bytes(socket.inet_aton(end[0]), sys.byteorder)
    return f"{host:08X}:{end[1]:04X}"
