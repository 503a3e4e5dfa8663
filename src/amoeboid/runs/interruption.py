"""Ctrl-C during a run: it ends after the present step, so that nothing of it is lost.

An exception in the middle of compiled code would be lost or leave half a step.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from amoeboid.runs.advance import INTERRUPTION
from amoeboid.simulation.step import Step

Interruption = Callable[[Step], "str | None"]


class Interrupted(KeyboardInterrupt):
    """Ctrl-C has ended a run; `solution` is the run up to there, and can be resumed."""

    def __init__(self, solution: Any) -> None:
        super().__init__(
            f"{solution!r}; it is the attribute `solution` of this exception (after the fact: "
            "sys.last_value.solution)"
        )
        self.solution = solution


@contextmanager
def interruptible(signals: Sequence[int]) -> Iterator[Interruption]:
    """An event: one of these signals ends the run after the present step.

    A second one raises KeyboardInterrupt at once.
    """
    received: list[int] = []

    def take(number: int, _: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)

    before = [signal.signal(number, take) for number in signals]
    try:
        yield lambda _: INTERRUPTION if received else None
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def interruptible_from_python() -> Iterator[Interruption]:
    """The same for Ctrl-C in a script or a notebook, where Python handles it as usual."""
    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    main = threading.current_thread() is threading.main_thread()
    with interruptible([signal.SIGINT] if usual and main else []) as interruption:
        yield interruption
