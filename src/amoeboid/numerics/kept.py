"""Where compiled kernels lie, so that they are compiled once: by the build, or once a machine.

A file holds one kernel for one signature, as numba stores it, behind a hash of its content. Its
bitcode, which other kernels that call it are compiled with, is parsed only then. The name of a file
is a hash of all that the machine code depends on (`kernel_identity`, signature, versions of numba,
llvmlite and Python, platform), so that nothing in it can be out of date. Files are renamed into
place, never changed. The file PROCESSOR of a folder names the instructions that its kernels use: a
processor that lacks one of them does not load any.

What lies there is executed. A folder of kernels is therefore used only if it belongs to this user,
or to root, and nobody else can write to it. The hash tells damage, it does not protect.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import pickle
import platform
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from llvmlite.binding import parse_assembly, parse_bitcode
from numba.core import config
from numba.core.compiler import CompileResult
from numba.core.environment import Environment, _rebuild_env, lookup_environment
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from amoeboid.locks import FileLock, TakenError
from amoeboid.terminal import Line, progress_line

BUILT = Path(__file__).parents[1] / "built_kernels"  # those that came with the package
FORMAT = 2  # of the files
PROCESSOR, LOCK = "PROCESSOR", "lock"
MAX_VERSIONS = 16  # of one kernel in the folder of the user; the oldest are removed
MAX_WAIT = 300.0  # seconds for another program that compiles
MIN_POLL, MAX_POLL = 0.02, 0.2  # seconds between looks for what another program compiles
_HASH = hashlib.sha256().digest_size


def folder() -> Path:
    """The folder of this user and machine, or what NUMBA_CACHE_DIR says."""
    if config.CACHE_DIR:
        base = Path(config.CACHE_DIR)
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
        if str(base).startswith("~"):  # a user without a home, as in containers
            base = Path(tempfile.gettempdir()) / f"cache-{os.geteuid()}"
    # of a home that several machines share
    return base / "amoeboid" / f"kernels-{_short(processor())}"


@cache
def processor() -> str:
    """The instructions that kernels compiled here use, in words of LLVM."""
    from numba.core.registry import cpu_target

    _, name, features = cpu_target.target_context.codegen().magic_tuple()
    used = sorted(f for f in features.split(",") if f.startswith("+"))
    return f"{platform.machine()} {name}\n{','.join(used)}\n"


def folders(target: Any) -> list[Path]:
    """Folders to look in: those of the build if this processor can run them, and of the user."""
    return [*([BUILT] if _runs(BUILT) else []), folder()]


@cache
def _runs(where: Path) -> bool:
    try:
        needs = (where / PROCESSOR).read_text(encoding="utf-8")
    except OSError:
        return False
    from llvmlite.binding import get_host_cpu_features

    machine, _, features = needs.partition("\n")
    has = {f"+{name}" for name, present in get_host_cpu_features().items() if present}
    return machine.split()[0] == platform.machine() and set(features.strip().split(",")) <= has


def name_of(kernel: str, identity: str, signature: Any, target: Any) -> str:
    """The name of the file of a kernel for a signature."""
    triple = target.codegen().magic_tuple()[0]
    program = (FORMAT, sys.implementation.cache_tag, *_versions())
    depends_on = (identity, str(signature), triple, *program)
    return f"{kernel.replace('<locals>', '')}-{_short(repr(depends_on))}.kernel"


@cache
def _versions() -> tuple[str, ...]:
    return version("numba"), version("llvmlite")


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def load(where: Path, name: str, target: Any) -> Any:
    """A kernel of a folder, None if it has none of that name.

    numba would first set up all that it needs to compile, which takes longer than to load.
    Raises whatever a damaged file leads to.
    """
    try:
        if where != BUILT:  # which is trusted as the package beside it is
            refuse_foreign(where)
        data = (where / name).read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
    if hashlib.sha256(data[_HASH:]).digest() != data[:_HASH]:
        raise ValueError("a file is damaged")
    rtsys.initialize(target)  # what the kernels allocate arrays by
    (library, *rest), bitcode = _Reader(io.BytesIO(data[_HASH:])).load()
    found = CompileResult._rebuild(target, library, *rest)
    # else numba would link the names
    found.library._shared_module = None
    found.library._get_module_for_linking = cache(partial(parse_bitcode, bitcode))
    return found


class _Reader(pickle.Unpickler):  # of our own files
    """Does not import modules of numba for what their functions, compiled with ours, belong to."""

    def find_class(self, module: str, name: str) -> Any:
        found = super().find_class(module, name)
        return _environment if found is _rebuild_env else found


def _environment(module: str, constants: list[Any], name: str) -> Environment:
    """As numba rebuilds it, whose names compiled code does not look up.

    Numba would import `module` for them: that of its arrays takes longer than all our kernels.
    """
    found = lookup_environment(name)
    if found is None:
        names = sys.modules.get(module)
        found = Environment({"__name__": module} if names is None else vars(names))
        found.consts[:] = constants
        found.env_name = name
        Environment._memo[name] = found
    return found


def _parts(kernel: Any) -> tuple[Any, bytes]:
    """What numba stores of a kernel, with the names of its entries for its bitcode; and that."""
    (name, kind, (machine_code, bitcode)), *rest = kernel._reduce()
    described = kernel.fndesc
    entries = {described.llvm_func_name, described.llvm_cpython_wrapper_name}
    there = [f.name for f in kernel.library.get_defined_functions() if f.name in entries]
    names = "\n".join(f'define void @"{entry}"() {{ ret void }}' for entry in there)
    return ((name, kind, (machine_code, parse_assembly(names).as_bitcode())), *rest), bitcode


def refuse_foreign(where: Path) -> None:
    """Raise PermissionError if anyone but this user, or root, could have put a file there."""
    if not hasattr(os, "geteuid"):  # Windows: the folder lies within the profile of the user
        return
    found = where.stat()
    if found.st_uid not in (0, os.geteuid()):
        raise PermissionError(errno.EPERM, "it belongs to another user")
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(errno.EPERM, "other users can write to it: chmod go-w")


def made_folder() -> Path:
    """The folder of the user, made if it is not there. Raises OSError."""
    where = folder()
    where.parent.mkdir(parents=True, exist_ok=True)
    where.mkdir(mode=0o700, exist_ok=True)
    refuse_foreign(where)
    return where


def save(name: str, kernel: Any) -> None:
    """Keep a kernel in the folder of the user. Raises OSError."""
    data = dumps(_parts(kernel))
    where = made_folder()
    if not (where / PROCESSOR).exists():
        _write(where / PROCESSOR, processor().encode())
    _write(where / name, hashlib.sha256(data).digest() + data)
    versions = sorted(where.glob(f"{name.rpartition('-')[0]}-*.kernel"), key=_age)
    for old in versions[MAX_VERSIONS:]:
        old.unlink(missing_ok=True)


def _write(path: Path, data: bytes) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _age(path: Path) -> float:
    with suppress(OSError):
        return -path.stat().st_mtime
    return 0.0


class _Turn:
    """The turn of this program to compile: one program of a user at a time, others wait.

    It begins when a kernel is not found, and ends with the outermost compilation. Entered and left
    under numba's own lock for threads.
    """

    def __init__(self) -> None:
        self._depth, self._count = 0, 0
        self._lock: FileLock | None = None
        self._line: Line | None = None

    def __enter__(self) -> None:
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            if self._lock is not None:
                self._lock.release()
                self._lock = None
            if self._line is not None:
                self._line.erase()

    def waits(self) -> Iterator[None]:
        """Pauses until it is this program's turn, and one more: look for the kernel in each.

        Who continues after the last compiles it.
        """
        if self._lock is None:
            with suppress(OSError):  # no folder
                self._lock = FileLock(made_folder() / LOCK)
        begin, pause = time.monotonic(), MIN_POLL
        while not self._locked() and time.monotonic() - begin < MAX_WAIT:
            self._show("waiting for another program that compiles the numerical kernels")
            yield
            time.sleep(pause)
            pause = min(1.5 * pause, MAX_POLL)
        yield
        self._count += 1
        self._show("compiling the numerical kernels, once on this machine", str(self._count))

    def _locked(self) -> bool:
        """Whether to continue: it is this program's turn, or there are no locks here.

        Programs that start together then compile the same kernels.
        """
        try:
            if self._lock is not None:
                self._lock.take()
        except TakenError:
            return False
        except OSError:  # a folder that cannot be written to
            return True
        return True

    def _show(self, *parts: str) -> None:
        if self._line is None:
            self._line = progress_line()
        if self._line is not None:
            self._line.show(parts)


turn = _Turn()
