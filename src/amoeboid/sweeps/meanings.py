"""What recorded names mean: told once for all lines of a sweep, and checked when they are read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from amoeboid.validation import InvalidInput

TEXT, NUMBER = "text", "number"
INFINITE = ("inf", "-inf")
"""Infinity as lines hold it, which JSON has no number for."""


@dataclass(frozen=True)
class Meaning:
    """What a recorded name is: `kind` "number", "text" or "" (not known), unit, title, dims."""

    kind: str
    unit: str
    title: str
    dims: tuple[str, ...]
    labels: tuple[tuple[str, tuple[Any, ...]], ...] = ()

    @property
    def is_nothing(self) -> bool:
        """Whether it is that of None, which any value may take the place of."""
        return not (self.kind or self.unit or self.dims)

    def __str__(self) -> str:
        what = f"{self.kind or 'no value'}{f' in {self.unit}' if self.unit else ''}"
        return f"{what} along {', '.join(self.dims)}" if self.dims else f"a single {what}"


Meanings = dict[str, Meaning]


def joined(name: str, before: Meaning | None, now: Meaning) -> Meaning:
    """One meaning for a name that several points give. Raises InvalidInput where they differ."""
    if before is None or before == now or before.is_nothing:
        return now
    if now.is_nothing:
        return before
    kind = before.kind or now.kind
    if replace(before, kind=kind) != replace(now, kind=now.kind or kind):
        raise InvalidInput(
            f"{name!r} must be of one kind at all points, it is {before} at one and {now} at "
            "another; use different names, or None for a missing value"
        )
    return replace(now, kind=kind)


def agreed(known: Meanings, new: Meanings) -> tuple[Meanings, dict[str, str]]:
    """What names mean now, of those that may join what is known; why not, of the others."""
    joint: Meanings = {}
    conflicts: dict[str, str] = {}
    for name, meaning in new.items():
        try:
            joint[name] = joined(name, known.get(name), meaning)
        except InvalidInput as problem:
            conflicts[name] = str(problem)
    return joint, conflicts


def meaning_from(found: Mapping[str, Any]) -> Meaning:
    """The meaning that a file holds. Raises ValueError, TypeError or KeyError for none."""
    texts = [found["kind"], found["unit"], found["title"], *found["dims"]]
    labels = tuple((dim, tuple(given)) for dim, given in found["labels"])
    entries = [entry for _, given in labels for entry in given]
    dims = tuple(found["dims"])
    known = found["kind"] in ("", TEXT, NUMBER) and {dim for dim, _ in labels} <= set(dims)
    if not known or not all(isinstance(text, str) for text in texts):
        raise ValueError(found)
    if len(set(dims)) < len(dims) or not all(isinstance(e, str | int | float) for e in entries):
        raise ValueError(found)
    return Meaning(found["kind"], found["unit"], found["title"], dims, labels)


def holds(meaning: Meaning | None, value: Any) -> bool:
    """Whether a value that was read is one that such a name can have."""
    if value is None:
        return True
    if meaning is None:
        return False
    labeled = dict(meaning.labels)

    def fits(value: Any, depth: int) -> bool:
        if depth < len(meaning.dims):
            dim = meaning.dims[depth]
            whole = isinstance(value, list) and len(value) <= len(labeled.get(dim, value))
            return whole and all(fits(entry, depth + 1) for entry in value)
        if isinstance(value, str) and meaning.kind == NUMBER:
            return value in INFINITE
        return value is None or isinstance(value, str if meaning.kind == TEXT else float)

    return fits(value, 0)
