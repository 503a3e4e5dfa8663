"""A sweep's folder: what is done, so that it is not done again.

    sweep.json           what is computed: solver, base, points, units, versions
    results/*.jsonl      one line a point, and lines that say what the names in them mean
    sweep.nc             the table, once the sweep is finished or merged

Every process has a file of its own in `results`, `1-of-1.jsonl` or that of its shard, which only
grows: a point costs one line, however many there are. A line is written in one piece. A killed
process may leave the last one unfinished; without its end of line it does not count, and is cut off
when the sweep is continued. Points that are computed side by side have a line before theirs that
tells their number, and count only if all are there: their answers depend on each other in the last
digits, and a sweep that is continued shall have the same bits. A damaged line does not count
either: its point is computed again.
Points are known by their content, so that their order and their number may change. Nothing in the
folder is executed, or made of pickles.
"""

from __future__ import annotations

import json
import os
import socket
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from io import FileIO
from pathlib import Path
from typing import Any

from amoeboid.locks import FileLock, TakenError
from amoeboid.output.atomic import PARTIAL, remove_partial, text_of, write_text
from amoeboid.sweeps.evaluation import FAILED, STATUSES, without_conflicts
from amoeboid.sweeps.meanings import Meanings, agreed, holds, joined, meaning_from
from amoeboid.validation import InvalidInput

FORMAT, VERSION = "amoeboid sweep", 1
MANIFEST, TABLE, LOCK, RESULTS = "sweep.json", "sweep.nc", ".lock", "results"
SYNCED = 1.0  # seconds after which lines are surely on the disk
LARGEST_LINE = 100_000_000  # bytes
TOGETHER = "together"


class SweepFolder:
    """The folder of a sweep; `rows` are the lines that are done, by the key of their points."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, str] = {}
        self.meanings: Meanings = {}
        self.outdated: set[str] = set()
        """Keys of lines that other code has written, for the same points perhaps."""
        self._told: Meanings = {}  # those that our own file tells: each file explains itself
        self._file: FileIO | None = None
        self._size, self._synced, self._code = 0, 0.0, ""

    @contextmanager
    def opened(self, manifest: Mapping[str, Any], shard: tuple[int, int]) -> Iterator[SweepFolder]:
        """The folder, made if need be, for one process that adds lines to the file of its shard.

        Raises InvalidInput for a folder of something else, and one that another process has open.
        """
        self._make(manifest)
        with ExitStack() as locks:
            whole = shard == (1, 1)
            name = f"{shard[0]}-of-{shard[1]}"
            kept = self._locked(self.path / LOCK, not whole, locks)
            if not whole:
                kept = self._locked(self.path / RESULTS / f".{name}.lock", False, locks) and kept
            if not kept:  # a file that nobody else can write to
                name = f"{name}-{socket.gethostname()}-{os.getpid()}"
            if whole:
                remove_partial(self.path)
            self._begin(self.path / RESULTS / f"{name}.jsonl", manifest)
            try:
                yield self
            finally:
                self._close()

    def _make(self, manifest: Mapping[str, Any]) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise InvalidInput(
                f"the folder of a sweep must be a folder, {str(self.path)!r} is a file; choose "
                "another"
            )
        begun = (self.path / MANIFEST).exists()
        if not begun and self.path.exists():
            strange = [
                p.name for p in self.path.iterdir()
                if p.name not in (LOCK, RESULTS) and not PARTIAL.fullmatch(p.name)
            ]  # fmt: skip
            if strange:
                raise InvalidInput(
                    f"the folder of a sweep must be new, empty or that of the same sweep, "
                    f"{str(self.path)!r} holds {strange[0]!r} and no {MANIFEST}; choose another"
                )
        if begun:
            _refuse_another(manifest, read_manifest(self.path), self.path)
        (self.path / RESULTS).mkdir(parents=True, exist_ok=True)

    def _begin(self, file: Path, manifest: Mapping[str, Any]) -> None:
        if not (self.path / MANIFEST).exists():
            self.tell(manifest)
        file.touch()
        self._size = self.read(str(manifest["code"]), file)
        self._file = file.open("r+b", buffering=0)
        self._file.truncate(self._size)

    def tell(self, manifest: Mapping[str, Any]) -> None:
        """Write what the sweep is, if that is not what the folder says."""
        path = self.path / MANIFEST
        text = json.dumps(manifest, allow_nan=False)
        if not path.is_file() or text_of(path) != text:
            write_text(path, text)

    def read(self, code: str, own: Path | None = None) -> int:
        """Read what is done, in all files; what is whole counts.

        Names mean what they do in the results of this code. `own` is the file that grows; gives the
        size of what is whole in it.
        """
        self._code, size = code, 0
        for path in sorted((self.path / RESULTS).glob("*.jsonl")):
            file = _File(self._told if path == own else {}, code)
            for lines, end in _groups(path):
                size = end if path == own else size
                for line in lines:
                    self._take(line, file)
        return size

    def _take(self, line: str, file: _File) -> None:
        try:
            found = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(found, dict):
            return
        key = found.get("key")
        if isinstance(found.get("meanings"), dict):
            file.code = str(found.get("code"))
            if file.code == self._code:
                self._learn_from(found["meanings"], file)
            return
        if isinstance(key, str) and file.code != self._code:
            self.outdated.add(key)
        if isinstance(key, str) and _is_sound(found, file.told):
            line = without_conflicts(line, file.conflicts)
            failed_now = status_of(line) == FAILED
            if not failed_now or key not in self.rows or status_of(self.rows[key]) == FAILED:
                self.rows[key] = line

    def _learn_from(self, given: Mapping[str, Any], file: _File) -> None:
        with suppress(TypeError, ValueError, KeyError):
            read = {n: meaning_from(m) for n, m in given.items()}
            joint, differing = agreed(self.meanings, read)
            file.conflicts |= differing
            self.meanings |= joint
            file.told |= agreed(file.told, read)[0]

    def add(self, rows: Mapping[str, str], meanings: Meanings, together: bool = False) -> None:
        """Take up lines of points, for good: {key: line}. Raises OSError for a full disk.

        `together`: they were computed side by side, and count only if all are there.
        """
        _learn(self.meanings, meanings)
        new = _learn(self._told, meanings)
        told = {name: asdict(meaning) for name, meaning in new.items()}
        lines = [json.dumps({"code": self._code, "meanings": told})] if told else []
        if together:
            lines.append(json.dumps({TOGETHER: len(rows)}))
        keyed = {key: f'{{"key":{json.dumps(key)},{row[1:]}' for key, row in rows.items()}
        self._write("".join(f"{line}\n" for line in (*lines, *keyed.values())))
        self.rows |= keyed

    def _write(self, text: str) -> None:
        if self._file is None:
            return
        data = text.encode()
        rest = memoryview(data)
        self._file.seek(self._size)
        try:
            while rest:
                rest = rest[self._file.write(rest) or 0 :]
        except OSError:
            with suppress(OSError):  # what was begun does not count anyway
                self._file.truncate(self._size)
            raise
        self._size += len(data)
        if time.monotonic() - self._synced > SYNCED:
            os.fsync(self._file.fileno())
            self._synced = time.monotonic()

    def _close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            with file, suppress(OSError):
                os.fsync(file.fileno())

    def _locked(self, path: Path, shared: bool, locks: ExitStack) -> bool:
        """Keep others away, but for other shards if `shared`; False where that is not possible."""
        lock = FileLock(path, shared)
        try:
            held = lock.take()
        except TakenError as by:
            raise InvalidInput(
                "only one process at a time may use the folder of a sweep, "
                f"{str(self.path)!r} is used by {by}; wait for it, choose another folder, or "
                "divide the work into shards (--shard 1/2 and --shard 2/2)"
            ) from None
        locks.callback(lock.release)
        if lock.why_not:
            warnings.warn(
                f"{str(path)!r} cannot be locked ({lock.why_not}); run only one process in this "
                "folder",
                stacklevel=2,
            )
        return held


def _learn(known: Meanings, meanings: Meanings) -> Meanings:
    """Take up what names mean; those that say something new. Raises InvalidInput."""
    new = {}
    for name, meaning in meanings.items():
        whole = joined(name, known.get(name), meaning)
        if whole != known.get(name):
            new[name] = known[name] = whole
    return new


def status_of(line: str) -> str:
    """How the point of a line ended."""
    return str(json.loads(line)["status"])


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a sweep's folder. Raises InvalidInput."""
    path = folder / MANIFEST
    if not path.is_file():
        raise InvalidInput(
            f"the folder of a sweep must have a {MANIFEST}, {str(folder)!r} has none; give the "
            "output folder of amoeboid sweep"
        )
    try:
        found = json.loads(text_of(path))
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidInput(f"{str(path)!r} must be the manifest of a sweep: {error}") from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InvalidInput(f"{str(path)!r} must be the manifest of a sweep, it is not")
    version = found.get("format_version")
    if not isinstance(version, int) or version > VERSION:
        raise InvalidInput(
            f"the format of {str(folder)!r} must be {VERSION} or older, it is {version!r}; use the "
            "release of amoeboid that wrote it, or a newer one"
        )
    return found


IDENTITY = ("solver", "record", "base")
"""What makes a sweep: a folder continues with other points, not with another one of these."""


def _refuse_another(wanted: Mapping[str, Any], found: Mapping[str, Any], folder: Path) -> None:
    for name in IDENTITY:
        now, was = wanted.get(name), found.get(name)
        if now == was:
            continue
        if isinstance(now, dict) and isinstance(was, dict):
            keys = [k for k in {**was, **now} if was.get(k) != now.get(k)]
            name, was, now = f"{name}.{keys[0]}", was.get(keys[0]), now.get(keys[0])
        raise InvalidInput(
            f"the folder of a sweep must be new or that of the same sweep, {str(folder)!r} has "
            f"{name} = {was!r:.200}, now it is {now!r:.200}; choose another folder"
        )


def _is_sound(found: Mapping[str, Any], told: Meanings) -> bool:
    """Whether the line of a point is one that a sweep writes, given what its file tells."""
    values = found.get("values", {})
    return (
        found.get("status") in STATUSES
        and isinstance(values, dict)
        and all(holds(told.get(name), value) for name, value in values.items())
    )


@dataclass
class _File:
    """What is known of a file of results while its lines are read.

    `told`: what names mean; `conflicts`: names that mean something else in another file; `code`
    that has written the next lines.
    """

    told: Meanings
    code: str
    conflicts: dict[str, str] = field(default_factory=dict)


def _groups(path: Path) -> Iterator[tuple[list[str], int]]:
    """The lines of a file that count, those of points side by side together, and where they end.

    The last ones may not be whole, where they are being written or their process was killed.
    """
    waiting: list[str] = []
    missing = 0  # lines of points side by side
    with path.open("rb") as file:
        while data := file.readline(LARGEST_LINE):
            if not data.endswith(b"\n"):
                continue
            line = data[:-1].decode(errors="replace")
            count = _together(line)
            if count:
                waiting, missing = [], count
                continue
            waiting.append(line)
            missing = max(0, missing - 1)
            if not missing:
                yield waiting, file.tell()
                waiting = []


def _together(line: str) -> int:
    """The number of points side by side that a line announces; 0 for any other line."""
    if not line.startswith(f'{{"{TOGETHER}"'):
        return 0
    with suppress(ValueError, RecursionError):
        found = json.loads(line)[TOGETHER]
        return found if type(found) is int and found > 0 else 0
    return 0
