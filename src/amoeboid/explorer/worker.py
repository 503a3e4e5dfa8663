"""What computes for the page: processes of their own, that end when the server does.

`python -m amoeboid.explorer.worker answers` or `live`. Standard input has a JSON object a line,
standard output messages: 4 bytes of length, one of kind (T: JSON, B: a frame), and the message.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Condition, Lock, Thread
from typing import Any

from numpy.linalg import LinAlgError

from amoeboid.validation import InvalidInput

FRAMES = 25.0
"""Frames a second at most."""

SUBDIVISIONS, MAX_SUBDIVISIONS = 3, 4
"""Of the icosahedron that a cell starts from: 642 nodes."""

TEXT, FRAME = b"T", b"B"
TOO_EXTREME = (ArithmeticError, LinAlgError)
Message = dict[str, Any]


class Superseded(Exception):
    """The page has asked for something newer, or has left."""


class Output:
    """Messages to the server, from any thread."""

    def __init__(self) -> None:
        self._lock, self._stream = Lock(), sys.stdout.buffer

    def text(self, message: Message) -> None:
        """Send a JSON object."""
        self._send(TEXT, json.dumps(message, allow_nan=False).encode())

    def frame(self, data: bytes) -> None:
        """Send a frame."""
        self._send(FRAME, data)

    def _send(self, kind: bytes, data: bytes) -> None:
        with self._lock:
            self._stream.write(struct.pack("<I", len(data)) + kind + data)
            self._stream.flush()


class Inbox:
    """Messages from the server, read by a thread; when the server is gone the process ends."""

    def __init__(self) -> None:
        self._messages: list[Message] = []
        self._changed = Condition()
        Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in sys.stdin.buffer:
            with self._changed:
                self._messages.append(json.loads(line))
                self._changed.notify()
        os._exit(0)

    def wait(self, seconds: float | None) -> list[Message]:
        """All messages that have come, after waiting for the first one for so many seconds."""
        with self._changed:
            if not self._messages:
                self._changed.wait(seconds)
            found, self._messages = self._messages, []
        return found

    def newest(self) -> Message:
        """The newest question of the page that has waited longest; older ones are dropped."""
        with self._changed:
            while not self._messages:
                self._changed.wait()
            page = self._messages[0]["page"]
            found = [m for m in self._messages if m["page"] == page][-1]
            self._messages = [m for m in self._messages if m["page"] != page]
        return found

    def refuse_if_newer(self, page: Any) -> None:
        """Raise Superseded where the same page has asked again."""
        with self._changed:
            if any(m["page"] == page for m in self._messages):
                raise Superseded


def answers(inbox: Inbox, output: Output) -> None:
    """Answer what a parameter point looks like, the newest question of each page alone."""
    from amoeboid.explorer.answers import Answers
    from amoeboid.explorer.point import parameters_of
    from amoeboid.explorer.presets import PRESETS

    known = Answers()
    first = PRESETS[0]
    for _ in known.of(parameters_of(first.units, first.values), "v_p0", lambda _: None):
        pass  # what every page asks for first is known by then, or nearly so
    while True:
        asked = inbox.newest()
        if asked.get("gone"):
            continue
        head = {"page": asked["page"], "number": asked.get("number")}

        def watch(_: Any, page: Any = asked["page"]) -> None:
            inbox.refuse_if_newer(page)

        try:
            p = parameters_of(asked.get("units"), asked.get("values"))
            name = asked.get("vary", "v_p0")
            if name not in p.names:
                raise InvalidInput(f"vary must be one of {', '.join(p.names)}, got {name!r:.80}")
            for answer in known.of(p, name, watch):
                output.text(head | answer)
                watch(None)
        except Superseded:
            continue
        except InvalidInput as error:
            output.text(head | refusal(error))
        except TOO_EXTREME as error:
            output.text(head | refusal(too_extreme(error)))


def refusal(error: InvalidInput) -> Message:
    """What the page shows beside the field."""
    return {"kind": "refused", "field": getattr(error, "name", ""), "message": str(error)}


def too_extreme(error: Exception) -> InvalidInput:
    """The refusal of what is beyond what numbers can hold."""
    return InvalidInput(f"the values are too extreme: {error}")


def live(inbox: Inbox, output: Output) -> None:
    """Let a cell live, as the page wants it."""
    player = Player(output)
    last = sent = time.monotonic()
    while True:
        going = player.cell is not None and player.cell.going
        wait = max(0.0, sent + 1.0 / FRAMES - time.monotonic()) if going else None
        messages = inbox.wait(wait) if wait is None or wait > 0.0 else inbox.wait(1e-4)
        for message in messages:
            try:
                player.act(message)
            except InvalidInput as error:
                output.text(refusal(error) | {"number": message.get("number")})
            except TOO_EXTREME as error:
                output.text(refusal(too_extreme(error)) | {"number": message.get("number")})
        now = time.monotonic()
        if player.cell is not None and (messages or now - sent >= 1.0 / FRAMES):
            player.cell.pass_time(min(now - last, 0.2))
            last = sent = now
            output.frame(player.cell.frame())
        elif not going:
            last = now


class Player:
    """A live cell, and what can be done to it."""

    def __init__(self, output: Output) -> None:
        self.output = output
        self.cell: Any = None
        self._saving: Thread | None = None
        self._acts: dict[str, Callable[[Message], None]] = {
            "begin": self._begin,
            "change": self._change,
            "poke": lambda m: self.cell.poke(m.get("direction"), m.get("strength")),
            "pause": self._pause,
            "pace": self._pace,
            "all": lambda m: self.cell.show_all(),
            "lines": self._lines,
            "save": self._save,
        }

    def act(self, message: Message) -> None:
        """Do what a message says. Raises InvalidInput."""
        do = message.get("do")
        if not isinstance(do, str) or do not in self._acts:
            raise InvalidInput(f"do must be one of {', '.join(self._acts)}, got {do!r:.80}")
        if self.cell is None and do != "begin":
            raise InvalidInput("a cell must live for this: restart it")
        self._acts[do](message)

    def _begin(self, message: Message) -> None:
        from amoeboid.explorer.live import LiveCell
        from amoeboid.explorer.point import parameters_of
        from amoeboid.explorer.recipe import Recipe

        seed = message.get("seed", 0)
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**32:
            raise InvalidInput(f"seed must be a whole number from 0 to 2^32 - 1, got {seed!r:.80}")
        subdivisions = message.get("subdivisions", SUBDIVISIONS)
        if type(subdivisions) is not int or not 1 <= subdivisions <= MAX_SUBDIVISIONS:
            raise InvalidInput(
                f"subdivisions must be a whole number from 1 to {MAX_SUBDIVISIONS}, "
                f"got {subdivisions!r:.80}"
            )
        before = self.cell
        recipe = Recipe(
            parameters_of(message.get("units"), message.get("values")),
            subdivisions=subdivisions,
            start=message.get("start", "noise"),
            seed=seed,
            surface=message.get("surface"),
        )
        self.cell = LiveCell(recipe)
        if before is not None:
            self.cell.pace = before.pace
        self.output.text({"kind": "begun", "start": recipe.start})

    def _change(self, message: Message) -> None:
        from amoeboid.explorer.point import parameters_of

        self.cell.change_to(parameters_of(message.get("units"), message.get("values")))

    def _pause(self, message: Message) -> None:
        self.cell.paused = bool(message.get("value"))

    def _pace(self, message: Message) -> None:
        from amoeboid.explorer.live import MAX_PACE

        value = message.get("value")
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not 0 < value <= MAX_PACE
        ):
            raise InvalidInput(
                f"the pace must be a number > 0 and <= {MAX_PACE:g}, got {value!r:.80}"
            )
        self.cell.pace = float(value)

    def _lines(self, message: Message) -> None:
        from amoeboid.explorer.lines import python_lines

        text = python_lines(self.cell.recipe, self.cell.step.state.t)
        self.output.text({"kind": "lines", "text": text})

    def _save(self, message: Message) -> None:
        """Make the run again into a folder, beside the cell that continues. Raises InvalidInput."""
        from amoeboid.explorer.lines import new_folder

        if self._saving is not None and self._saving.is_alive():
            raise InvalidInput("one run is saved at a time: wait until it is, and save again")
        recipe, end = self.cell.recipe, self.cell.step.state.t
        folder = new_folder(Path(message["folder"]))
        arguments = (recipe, end, folder, message.get("movie") is True)
        self._saving = Thread(target=self._write, args=arguments, daemon=True)
        self._saving.start()

    def _write(self, recipe: Any, end: float, folder: Path, movie: bool) -> None:
        from amoeboid.explorer.lines import made_again, movie_of

        shown = time.monotonic()

        def progress(row: Any) -> None:
            nonlocal shown
            if time.monotonic() - shown > 0.5:
                shown = time.monotonic()
                share = min(1.0, row["t"] / end) if end > 0 else 1.0
                self.output.text({"kind": "saving", "share": share})

        try:
            run = made_again(recipe, end, folder, progress)
            if movie:
                self.output.text({"kind": "saving", "share": 1.0})
                folder = movie_of(folder)
        except (InvalidInput, OSError) as error:
            _remove(folder)
            self.output.text({"kind": "refused", "field": "save", "message": str(error)})
        else:
            self.output.text({"kind": "saved", "folder": str(folder), "text": repr(run)})


def _remove(folder: Path) -> None:
    """Remove a folder that nothing was written to."""
    with suppress(OSError):
        folder.rmdir()


def main(kind: str) -> None:
    """Work until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's, which ends this
    output = Output()
    sys.stdout = sys.stderr  # what a library prints is no message
    work = {"answers": answers, "live": live}[kind]
    try:
        work(Inbox(), output)
    except BrokenPipeError:
        os._exit(0)
    except Exception as error:
        output.text({"kind": "failed", "message": f"{type(error).__name__}: {error}"})
        raise


if __name__ == "__main__":
    main(sys.argv[1])
