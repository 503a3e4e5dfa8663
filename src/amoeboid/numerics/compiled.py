"""Numerical kernels: functions that are compiled by Numba at their first use, never at import.

The package is thus imported, and its theory and axisymmetric solver work, where Numba is missing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from amoeboid.extras import check, installed

# Kernels that Python calls, in the order of their definition.
ENTRIES: list[Kernel] = []


def compiled(kernel: Callable[..., Any]) -> Any:
    """`kernel` compiled at its first call, unless it was kept by the build or an earlier program.

    A division by zero gives inf or nan, as in NumPy, for the callers' checks to find.
    Where a kept kernel cannot be read (a damaged file) or written (a full disk, no folder that can
    be written to) it is compiled anew, with a RuntimeWarning that names the folder.
    NUMBA_DISABLE_JIT has no effect: some kernels exist as compiled code only.
    A call raises InvalidInput where Numba is not installed.
    """
    entry = Kernel(kernel)
    ENTRIES.append(entry)
    return entry


def nested(kernel: Callable[..., Any]) -> Any:
    """As `compiled`, for a kernel that only other kernels call: compiles in less time."""
    return Kernel(kernel, no_cpython_wrapper=True)


@functools.cache
def has_numba() -> bool:
    """Whether Numba is installed."""
    return installed("numba")


class Kernel:
    """A function whose dispatcher of Numba is made when it is called, or a caller compiled."""

    def __init__(self, kernel: Callable[..., Any], **options: bool) -> None:
        functools.update_wrapper(self, kernel)
        self.py_func, self._options = kernel, options

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function; see `compiled`."""
        return self.dispatcher(*arguments)

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What Numba calls. Raises InvalidInput where it is not installed."""
        check("cells on meshes and their surroundings need", "numba")
        from amoeboid.numerics.dispatchers import dispatcher

        return dispatcher(self.py_func, self._options)

    @property
    def stats(self) -> Any:
        """What was loaded and what compiled, as Numba counts it."""
        return self.dispatcher.stats

    @property
    def _numba_type_(self) -> Any:
        """Its type, which Numba asks for where another kernel calls this one."""
        return self.dispatcher._numba_type_
