"""A worker as the server sees it."""

from __future__ import annotations

import asyncio
import json
import os
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from amoeboid.threads import VARIABLES

Received = Callable[[str, bytes], None]
PATIENCE = 2.0
"""Seconds that a worker has to end by itself."""


def ended(kind: str) -> dict[str, str]:
    """What a page is told about a process that has ended, or was killed, without saying why."""
    message = {
        "answers": "The computation was ended from outside; change a parameter to start it again.",
        "live": "The process of the cell was ended from outside; restart the cell.",
    }[kind]
    return {"kind": "failed", "message": message}


class Worker:
    """A process of `explorer.worker`; `received` is called with the kind and each message of it."""

    def __init__(self, kind: str, received: Received) -> None:
        self._kind, self._received = kind, received
        self._process: asyncio.subprocess.Process | None = None
        self._reading: asyncio.Task[None] | None = None

    @property
    def pid(self) -> int | None:
        """The number of the process, if it runs."""
        runs = self._process is not None and self._process.returncode is None
        return self._process.pid if runs and self._process else None

    async def send(self, message: dict[str, Any]) -> None:
        """Send a message; starts the process if it does not run."""
        if self.pid is None:
            await self._start()
        assert self._process is not None and self._process.stdin is not None  # noqa: S101, PT018
        with suppress(ConnectionError):
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            await self._process.stdin.drain()

    async def _start(self) -> None:
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "amoeboid.explorer.worker", self._kind,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL, env=os.environ | dict.fromkeys(VARIABLES, "1"),
        )  # fmt: skip
        self._reading = asyncio.create_task(self._read(self._process))

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        stream, told = process.stdout, False
        assert stream is not None  # noqa: S101
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                length, kind = struct.unpack("<Ic", await stream.readexactly(5))
                data = await stream.readexactly(length)
                told = data.startswith(b'{"kind": "failed"')
                self._received(kind.decode(), data)
        await process.wait()  # what is sent from now on starts another one
        if self._process is process and not told:  # nobody here has ended it
            self._received("T", json.dumps(ended(self._kind)).encode())

    async def end(self) -> None:
        """End the process: it does so when its input ends, or is killed."""
        process, self._process = self._process, None
        if process is None:
            return
        with suppress(ConnectionError, ProcessLookupError):
            if process.stdin is not None:
                process.stdin.close()
            try:
                await asyncio.wait_for(process.wait(), PATIENCE)
            except TimeoutError:
                process.kill()
                await process.wait()
        if self._reading is not None:
            self._reading.cancel()
