"""What a compiled kernel depends on, as one text: the same text, the same machine code.

Bytecode and constants of the kernel, of the kernels that it calls, and every value that it takes
from its module. numba itself looks at the file of the kernel only, and would use a kept kernel
although one that it calls has changed.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np


def identity(kernel: Callable[..., Any], options: object = ()) -> str:
    """A hash of all that the kernel is made of, and of the options it is compiled with."""
    digest = hashlib.sha256(repr(options).encode())
    for part in _function(kernel, kernel.__module__.partition(".")[0], set()):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def _function(kernel: Any, package: str, seen: set[int]) -> Iterator[str]:
    if id(kernel) in seen:
        return
    seen.add(id(kernel))
    yield kernel.__qualname__
    yield repr(kernel.__defaults__)
    names: set[str] = set()
    yield from _code(kernel.__code__, names)
    for cell in kernel.__closure__ or ():
        yield from _value(cell.cell_contents, package, names, seen)
    for name in sorted(names & kernel.__globals__.keys()):
        yield name
        yield from _value(kernel.__globals__[name], package, names, seen)


def _code(code: CodeType, names: set[str]) -> Iterator[str]:
    names.update(code.co_names)
    yield code.co_code.hex()
    yield repr((code.co_varnames, code.co_names, code.co_freevars, code.co_cellvars))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code(constant, names)
        else:
            yield repr(constant)


def _value(value: Any, package: str, names: set[str], seen: set[int]) -> Iterator[str]:
    """What a kernel takes from its module: `names` are those that it uses, also of modules."""
    if hasattr(value, "py_func"):
        yield from _function(value.py_func, package, seen)
    elif isinstance(value, ModuleType):
        yield value.__name__
        if value.__name__.partition(".")[0] == package:
            for name in sorted(names & vars(value).keys()):
                yield from _value(vars(value)[name], package, names, seen)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}{value.tobytes().hex()}"
    elif isinstance(value, bool | int | float | complex | str | np.generic | tuple | type(None)):
        yield repr(value)
    else:  # intrinsics, which emit instructions by whatever stands in their file
        module = getattr(value, "__module__", None) or type(value).__module__
        yield f"{module}.{getattr(value, '__qualname__', type(value).__qualname__)}"
        if module.partition(".")[0] == package:
            yield _file(module)
            for cell in getattr(inspect.unwrap(value), "__closure__", None) or ():
                yield from _emitted(cell.cell_contents)


def _emitted(value: Any) -> Iterator[str]:
    """Values by which the makers of intrinsics differ: numbers, and functions that hold some."""
    if isinstance(value, bool | int | float | str):
        yield repr(value)
    for cell in getattr(value, "__closure__", None) or ():
        yield from _emitted(cell.cell_contents)


@cache
def _file(module: str) -> str:
    return hashlib.sha256(Path(str(sys.modules[module].__file__)).read_bytes()).hexdigest()
