"""Results that are kept: what was computed once is read, not computed again.

A result is known by the function that computes it, its arguments and the code of the package. It
is kept in memory and, where there is a folder, as a file of JSON each, so that what a killed
command has computed is there when it is given again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from amoeboid.identity.content import Unidentified, code, content
from amoeboid.output.atomic import write_text
from amoeboid.validation import InvalidInput

FOLDER = ".computed"
"""Where the results lie, in the folder of the pictures."""

Tell = Callable[[Sequence[str]], None]
"""A callback that gets the parts of a line of progress."""

_in_memory: dict[str, str] = {}


def untold(_: Sequence[str]) -> None:
    """No-op callback."""


class Results:
    """Results of functions, computed where they are not known yet.

    `folder`: where they are kept beyond the life of the process; `again`: compute what is known,
    once more.
    """

    def __init__(self, folder: Path | None = None, tell: Tell = untold, again: bool = False):
        self._folder = None if folder is None else folder / FOLDER
        self._tell, self._again = tell, again
        self._fresh: set[str] = set()

    def of(self, function: Callable[..., Any], *arguments: Any, task: str) -> Any:
        """`function(*arguments)`, or what it gave before; `task` names it in lines of progress.

        The arguments are Parameters, numbers, texts and tuples of them. The result is made of
        numbers, texts, None, lists and dicts of them with texts as keys.
        """
        self._tell([task])
        key = _key(function, arguments)
        if key is None:
            return json.loads(json.dumps(function(*arguments)))
        known = None if self._again and key not in self._fresh else self._known(key)
        if known is None:
            known = json.dumps(function(*arguments))
            self._keep(key, known)
        self._fresh.add(key)
        return json.loads(known)

    def progress(self, *parts: str) -> None:
        """Show a line of progress."""
        self._tell(parts)

    def _path(self, key: str) -> Path | None:
        if self._folder is None:
            return None
        return self._folder / f"{sha256(key.encode()).hexdigest()[:32]}.json"

    def _known(self, key: str) -> str | None:
        path = self._path(key)
        if path is None:
            return _in_memory.get(key)
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):  # also one that is no JSON: computed again
            return None
        if not isinstance(found, dict) or found.get("key") != key or "result" not in found:
            return None
        return json.dumps(found["result"])

    def _keep(self, key: str, result: str) -> None:
        path = self._path(key)
        if path is None:
            _in_memory[key] = result
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, f'{{"key": {json.dumps(key)}, "result": {result}}}\n')


def _key(function: Callable[..., Any], arguments: Sequence[Any]) -> str | None:
    """A text that differs where the result may; None where no text can describe that.

    This is so for a law or stress that is a Python function, and for a function that its name does
    not tell from others.
    """
    try:
        identity = code(function)
    except Unidentified:
        return None
    try:
        return "\n".join([identity, *map(content, arguments)])
    except InvalidInput:
        return None
