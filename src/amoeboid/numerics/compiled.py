"""Compilation of numerical kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(kernel: Callable[..., Any]) -> Any:
    """`kernel` compiled at its first call, and kept on disk for later programs.

    A division by zero gives inf or nan, as in NumPy, for the callers' checks to find.
    Where nothing can be written (a read-only installation without a home folder) it is compiled
    anew in every program.
    """
    return _compiled(kernel)


def nested(kernel: Callable[..., Any]) -> Any:
    """As `compiled`, for a kernel that only other kernels call: compiles in less time."""
    return _compiled(kernel, no_cpython_wrapper=True)


def _compiled(kernel: Callable[..., Any], **options: bool) -> Any:
    # without the entry for C, which nothing uses and every kernel would be compiled again for
    options |= {"no_cfunc_wrapper": True}
    try:
        return njit(cache=True, error_model="numpy", **options)(kernel)
    except RuntimeError:  # numba finds no folder for its cache
        return njit(error_model="numpy", **options)(kernel)
