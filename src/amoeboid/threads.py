"""One thread for linear algebra while the package computes, and as many as before after it.

The matrices are small: threads take longer to start than to compute, and many runs go in parallel.
Who sets one of `VARIABLES` in the environment decides instead. Without threadpoolctl, which the
extra `surface` brings, the threads stay as they are.
"""

from __future__ import annotations

import os
import sys
from contextlib import ContextDecorator
from functools import cache
from importlib.util import find_spec
from threading import Lock
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@cache
def controllable() -> bool:
    """Whether threadpoolctl is installed."""
    return find_spec("threadpoolctl") is not None


class _OneThread(ContextDecorator):
    """Limits the libraries when the first call in the program begins, until the last one ends.

    SciPy brings a library of its own, a quarter of a second to import: it is not loaded for this,
    and limited from the first call on that finds it.
    """

    def __init__(self) -> None:
        self._lock, self._count = Lock(), 0
        self._libraries: dict[bool, Any] = {}  # by whether that of SciPy is among them
        self._limits: list[Any] = []

    def __enter__(self) -> None:
        with self._lock:
            with_scipy = "scipy.linalg" in sys.modules
            if self._ours() and (self._count == 0 or with_scipy not in self._libraries):
                self._limits.append(self._found(with_scipy).limit(limits=1, user_api="blas"))
            self._count += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._count -= 1
            while self._count == 0 and self._limits:
                self._limits.pop().restore_original_limits()

    def _ours(self) -> bool:
        """Whether the number of threads is ours to choose, and can be."""
        return not any(name in os.environ for name in VARIABLES) and controllable()

    def _found(self, with_scipy: bool) -> Any:
        """The libraries that are loaded; they are looked for once, which takes milliseconds."""
        if with_scipy not in self._libraries:
            from threadpoolctl import ThreadpoolController

            self._libraries[with_scipy] = ThreadpoolController()
        return self._libraries[with_scipy]


one_thread = _OneThread()
"""As `with one_thread:`, or above a function as `@one_thread`."""
