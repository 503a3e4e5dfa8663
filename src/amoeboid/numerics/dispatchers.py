"""Compilation of kernels by Numba, which are then kept; `kept` says where."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba import njit
from numba.core import config
from numba.core.compiler_lock import global_compiler_lock

from amoeboid.numerics import kept
from amoeboid.numerics.kernel_identity import identity


def dispatcher(kernel: Callable[..., Any], options: dict[str, bool]) -> Any:
    """What Numba makes of a kernel, which is compiled or loaded when it is called; `compiled`."""
    # without the entry for C, which nothing uses and every kernel would be compiled again for
    options = options | {"no_cfunc_wrapper": True}
    with _compilation():
        made = njit(error_model="numpy", **options)(kernel)
    made._cache = _Kept(kernel, options)
    compile_one = made.compile

    def compile_or_load(signature: Any) -> Any:
        # numba imports its own functions when it first compiles, and those are compiled, too
        with global_compiler_lock, kept.turn, _compilation():
            return compile_one(signature)

    made.compile = compile_or_load
    return made


@contextmanager
def _compilation() -> Iterator[None]:
    disabled, config.DISABLE_JIT = config.DISABLE_JIT, 0
    try:
        yield
    finally:
        config.DISABLE_JIT = disabled


class _Kept:
    """What numba asks for a compiled kernel, and gives one to: its cache, whose failures cost time
    only.
    """

    def __init__(self, kernel: Callable[..., Any], options: dict[str, bool]) -> None:
        self._kernel, self._options = kernel, options
        self._identity: str | None = None

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(kept.folder())

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The kernel for a signature as it is kept, None if it has to be compiled.

        It has to be if it is not kept and no other program compiles it just now.
        """
        name = self._name(signature, target)
        found = _loaded(name, target)
        if found is None:
            for _ in kept.turn.waits():
                found = _loaded(name, target)
                if found is not None:
                    break
        return found

    def save_overload(self, signature: Any, kernel: Any) -> None:
        """Keep the kernel for a signature, if that is possible."""
        if kernel.library.has_dynamic_globals:
            return  # addresses that mean nothing to another program
        name = self._name(signature, kernel.target_context)
        try:
            kept.save(name, kernel)
        except Exception as error:
            _say_unkept(str(kept.folder()), _words(error))

    def _name(self, signature: Any, target: Any) -> str:
        if self._identity is None:
            self._identity = identity(self._kernel, sorted(self._options))
        own_name = f"{self._kernel.__module__}.{self._kernel.__qualname__}"
        return kept.name_of(own_name, self._identity, signature, target)

    enable = disable = flush = lambda self: None


def _loaded(name: str, target: Any) -> Any:
    for folder in kept.folders(target):
        try:
            found = kept.load(folder, name, target)
        except Exception as error:  # unpickling raises whatever a damaged file leads it to
            _say_damaged(str(folder), error)
            continue
        if found is not None:
            return found
    return None


def _say_damaged(folder: str, error: Exception) -> None:
    _say_once(
        folder,
        f"kernels kept in {folder!r} cannot be read ({_words(error)}); they are compiled again, "
        "and stored if possible",
    )


def _say_unkept(folder: str, why: str) -> None:
    _say_once(
        folder,
        f"compiled kernels cannot be stored in {folder!r} ({why}), so every program compiles "
        "them; set NUMBA_CACHE_DIR to a writable folder with free space",
    )


def _words(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


_said: set[str] = set()  # folders, of which one message each is enough


def _say_once(folder: str, message: str) -> None:
    if folder not in _said:
        _said.add(folder)
        warnings.warn(message, RuntimeWarning, stacklevel=2)
