"""Which of two modules runs recorded programs: compiled loops, or NumPy where Numba is missing.

The installation alone decides: the same input gives the same bits each time.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from amoeboid.numerics.compiled import has_numba


@cache
def loops() -> Any:
    """The module with `run_steps` and `jacobian`."""
    if not has_numba():
        from amoeboid.numerics import array_machine

        return array_machine
    from amoeboid.numerics import compiled_machine

    return compiled_machine
