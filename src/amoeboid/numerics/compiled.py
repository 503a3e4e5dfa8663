"""Compilation of numerical kernels, and the copies of them that numba keeps on disk."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import config


def compiled(kernel: Callable[..., Any]) -> Any:
    """`kernel` compiled at its first call, and kept on disk for later programs.

    A division by zero gives inf or nan, as in NumPy, for the callers' checks to find.
    Where a kept kernel cannot be read (a damaged file) or written (a full disk, a read-only
    installation without a home folder) it is compiled anew, with a RuntimeWarning that names the
    folder. NUMBA_DISABLE_JIT has no effect: some kernels exist as compiled code only.
    """
    return _compiled(kernel)


def nested(kernel: Callable[..., Any]) -> Any:
    """As `compiled`, for a kernel that only other kernels call: compiles in less time."""
    return _compiled(kernel, no_cpython_wrapper=True)


def _compiled(kernel: Callable[..., Any], **options: bool) -> Any:
    # without the entry for C, which nothing uses and every kernel would be compiled again for
    options |= {"no_cfunc_wrapper": True}
    with _compilation():
        dispatcher = njit(error_model="numpy", **options)(kernel)
    try:
        dispatcher.enable_caching()
    except (RuntimeError, OSError):  # numba finds no folder for its cache
        dispatcher._cache = _Unkept(kernel.__code__.co_filename)
    else:
        dispatcher._cache = _Kept(dispatcher._cache)
    return dispatcher


@contextmanager
def _compilation() -> Iterator[None]:
    disabled, config.DISABLE_JIT = config.DISABLE_JIT, 0
    try:
        yield
    finally:
        config.DISABLE_JIT = disabled


class _Kept:
    """numba's cache of one kernel, whose failures cost time only."""

    def __init__(self, files: Any) -> None:
        self._files = files
        for name in ("enable", "disable", "flush"):
            setattr(self, name, getattr(files, name))

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(self._files.cache_path)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The kernel for a signature as it is kept, None if it has to be compiled."""
        try:
            return self._files.load_overload(signature, target)
        except Exception as error:  # unpickling raises whatever a damaged file leads it to
            _say_damaged(self.cache_path, error)
            # as if nothing had been kept, so that the next program finds what this one compiles
            with suppress(OSError):
                self._files.flush()
            return None

    def save_overload(self, signature: Any, kernel: Any) -> None:
        """Keep the kernel for a signature, if that is possible."""
        try:
            self._files.save_overload(signature, kernel)
        except Exception as error:
            _say_unkept(self.cache_path, _words(error))


class _Unkept:
    """The same where there is no folder for it."""

    cache_path = None

    def __init__(self, source: str) -> None:
        self._folder = str(Path(source).parent / "__pycache__")

    def load_overload(self, signature: Any, target: Any) -> None:
        """Nothing is kept."""

    def save_overload(self, signature: Any, kernel: Any) -> None:
        """Say that nothing is kept."""
        _say_unkept(self._folder, "neither it nor a folder of the user can be written to")

    enable = disable = flush = lambda self: None


def _say_damaged(folder: str, error: Exception) -> None:
    _say_once(
        folder,
        f"kernels kept in {folder!r} cannot be read ({_words(error)}); they are compiled anew, and "
        "kept if that is possible",
    )


def _say_unkept(folder: str, why: str) -> None:
    _say_once(
        folder,
        f"compiled kernels cannot be kept in {folder!r} ({why}); they are compiled in every "
        "program: set NUMBA_CACHE_DIR to a folder with room for them",
    )


def _words(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


_said: set[str] = set()  # folders, of which one message each is enough


def _say_once(folder: str, message: str) -> None:
    if folder not in _said:
        _said.add(folder)
        warnings.warn(message, RuntimeWarning, stacklevel=2)
