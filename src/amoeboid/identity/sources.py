"""The files that a function computes with: where one of them differs, its result may."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache, lru_cache
from hashlib import sha256
from importlib.machinery import ModuleSpec
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any

WITHOUT_RESULTS = ("cli", "exports", "figures", "plotting")
"""Folders of the package that no result depends on, besides what its own file imports of them."""

INSTALLED = "site-packages"


def digest_of(own: Path, module: str) -> str:
    """A digest of the code that a function of this file, and module, computes with.

    It is that of the version and of three parts: the package without WITHOUT_RESULTS; the file; and
    what the file imports of these folders and beside it, and what that imports of them. Files
    outside the package are read each time: they may change, and be imported again, meanwhile.
    """
    own = own.resolve()
    return _known_digest(own, module) if own in _package() else _digest(own, module)


@cache
def _known_digest(own: Path, module: str) -> str:
    return _digest(own, module)


def _digest(own: Path, module: str) -> str:
    digest = _always().copy()
    for path, text in sorted(used_files(own, module).items()):
        _add(digest, path, text)
    return digest.hexdigest()


@cache
def _always() -> Any:
    digest = sha256(version("amoeboid").encode())
    for path, text in sorted(_package().items()):
        if _counts_always(path):
            _add(digest, path, text)
    return digest


def _add(digest: Any, path: Path, text: bytes) -> None:
    digest.update(f"{path.name} {len(text)}\n".encode())
    digest.update(text)


@cache
def _root() -> Path:
    return Path(str(files("amoeboid"))).resolve()


@cache
def _package() -> dict[Path, bytes]:
    """All code of the package, read once: as it was when the process began to use it."""
    return {path: path.read_bytes() for path in _root().rglob("*.py")}


def _counts_always(path: Path) -> bool:
    return path.relative_to(_root()).parts[0] not in WITHOUT_RESULTS


def used_files(own: Path, module: str) -> dict[Path, bytes]:
    """The file and those that it imports, directly or not; what always counts is not followed."""
    package, home = _package(), _home(own)
    found: dict[Path, bytes] = {}
    waiting = [(own, module.rpartition(".")[0])]
    while waiting:
        path, parent = waiting.pop()
        if path in found:
            continue
        found[path] = package[path] if path in package else path.read_bytes()
        for name in _imports(found[path], parent):
            spec = _spec(name, home)
            if spec is None or not str(spec.origin).endswith(".py"):
                continue
            there = Path(str(spec.origin)).resolve()
            if not _counts_always(there) if there in package else _beside(there, home):
                waiting.append((there, str(spec.parent)))
    return found


def _home(own: Path) -> Path:
    """The folder of a file; of a file of a package, the folder that holds the package."""
    folder = own.parent
    while (folder / "__init__.py").exists():
        folder = folder.parent
    return folder


def _beside(path: Path, home: Path) -> bool:
    return path.is_relative_to(home) and INSTALLED not in path.relative_to(home).parts


def _spec(name: str, home: Path) -> ModuleSpec | None:
    """Where a name that code imports is found, if it may be a module of the package or of home."""
    first = name.partition(".")[0]
    if first != _root().name and not any((home / f"{first}{end}").exists() for end in ("", ".py")):
        return None
    try:
        return find_spec(name)
    except (ImportError, ValueError, AttributeError):  # a name in a module, or nothing
        return None


@lru_cache(maxsize=256)
def _imports(text: bytes, parent: str) -> tuple[str, ...]:
    """The names that code of a package imports: modules, and what may be modules of them."""
    return tuple(dict.fromkeys(_named(ast.parse(text), parent)))


def _named(tree: ast.AST, parent: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            if node.level and not parent:
                continue
            base = resolve_name(base, parent) if node.level else base
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)
