"""One point of a sweep: the answer of the solver as a line of JSON, and never an exception.

This is what workers do. A line holds `status`, `why`, `warnings` and the recorded `values`: numbers
with all their digits, null where there is none, and texts. What the names mean (unit, title,
dimensions) is told once for all lines, as a `Meaning` of each.
"""

from __future__ import annotations

import functools
import json
import math
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from amoeboid.studies.recorded import Recorded, texts
from amoeboid.sweeps.meanings import NUMBER, TEXT, Meaning, Meanings, joined
from amoeboid.terminal import silenced
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput, refuse_unknown

OK, INCOMPLETE, FAILED, MISSING = "ok", "incomplete", "failed", "missing"
STATUSES = (OK, INCOMPLETE, FAILED, MISSING)
OWN_NAMES = ("status", "why", "warnings")
POINT = "point"
"""The dimension of points that are in a row."""
VALUE = "value"
"""The name of what is recorded of a solver that gives one number or one array."""

MAX_WHY = 2000
LETTERS = "ijkl"  # of the dimensions of an array


@dataclass(frozen=True)
class Solver:
    """A function of a cell, and the names of what is recorded of its answers; None: the usual.

    A function may have an attribute `batch`, a function of a list of cells that gives a list of
    answers, an exception in the place of each that it has not found; `batch_size` is how many it
    takes at once. `varied` are names that the sweep has for coordinates.
    """

    function: Callable[..., Any]
    record: tuple[str, ...] | None
    varied: tuple[str, ...]

    @property
    def batch(self) -> Callable[..., Any] | None:
        """The function that takes many cells at once, if there is one."""
        function = self.function
        if isinstance(function, functools.partial):
            own = getattr(function.func, "batch", None)
            return None if own is None else functools.partial(own, *function.args,
                                                              **function.keywords)  # fmt: skip
        return getattr(function, "batch", None)

    @property
    def batch_size(self) -> int:
        """How many cells the solver takes at once."""
        function = self.function
        own = function.func if isinstance(function, functools.partial) else function
        return int(getattr(own, "batch_size", 1)) if self.batch is not None else 1


def evaluated(solver: Solver, cells: Sequence[Any]) -> tuple[list[str], Meanings]:
    """Lines for cells, in their order, and what the names in them mean."""
    meanings: Meanings = {}
    with one_thread, silenced():
        if solver.batch is not None:
            return _of_batch(solver, cells, meanings), meanings
        return [_line(solver, _called(solver.function, cell), meanings) for cell in cells], meanings


def failure(why: str, again: bool = False) -> str:
    """The line of a point that failed; `again`: another time it may succeed."""
    told = _printable(why)[:MAX_WHY]
    return _json({"status": FAILED, "why": told, **({"again": True} if again else {})})


def _of_batch(solver: Solver, cells: Sequence[Any], meanings: Meanings) -> list[str]:
    found = _called(solver.batch, list(cells))
    answers = found.answer
    if not isinstance(answers, BaseException) and len(answers) != len(cells):
        answers = InvalidInput(f"batch must give {len(cells)} answers, got {len(answers)}")
    each = [answers] * len(cells) if isinstance(answers, BaseException) else answers
    return [_line(solver, replace(found, answer=answer), meanings) for answer in each]


@dataclass(frozen=True)
class _Called:
    """What a function gave or raised, and the warnings meanwhile."""

    answer: Any
    warnings: tuple[str, ...]


def _called(function: Any, argument: Any) -> _Called:
    with _recorder.messages() as told:
        try:
            answer = function(argument)
        except (Exception, SystemExit) as error:  # a user's function may raise anything
            answer = error
    return _Called(answer, tuple(dict.fromkeys(told)))


def _line(solver: Solver, called: _Called, meanings: Meanings) -> str:
    answer = called.answer
    if isinstance(answer, BaseException):
        return failure(_why(answer), isinstance(answer, OSError | MemoryError))
    try:
        with _recorder.messages() as told:  # stability, for one, is found when it is asked for
            values, own = _values(solver, answer)
            complete, problems = _completeness(answer)
        meanings |= {name: joined(name, meanings.get(name), m) for name, m in own.items()}
    except Exception as error:
        return failure(_why(error), isinstance(error, OSError | MemoryError))
    row = {
        "status": OK if complete else INCOMPLETE,
        "why": _printable(texts(problems))[:MAX_WHY],
        "warnings": _printable(texts(dict.fromkeys((*called.warnings, *told))))[:MAX_WHY],
    }
    return _json({**{k: v for k, v in row.items() if v}, "values": values})


def _why(error: BaseException) -> str:
    kind = type(error).__name__
    try:
        told = " ".join(str(error).split())
    except Exception:  # a user's exception may fail to tell itself
        told = ""
    if not told:
        return kind
    return told if isinstance(error, InvalidInput) else f"{kind}: {told}"


def _printable(told: str) -> str:
    """A message on one line that neither a terminal nor a file takes for anything else."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in told)


def _completeness(answer: Any) -> tuple[bool, tuple[str, ...]]:
    if not hasattr(answer, "recorded"):
        return True, ()
    return bool(getattr(answer, "complete", True)), tuple(getattr(answer, "problems", ()))


def _values(solver: Solver, answer: Any) -> tuple[dict[str, Any], Meanings]:
    """The values that a line holds, and what their names mean. Raises InvalidInput."""
    entries = entries_of(answer)
    if solver.record is None:
        entries = {name: entry for name, entry in entries.items() if entry.default}
    else:
        refuse_unknown(solver.record, entries, "result", "of this solver")
        entries = {name: entries[name] for name in solver.record}
    for name in (*solver.varied, *OWN_NAMES):
        if name in entries:
            raise InvalidInput(
                f"the solver returns {name!r}, which the sweep varies; vary another parameter, "
                "rename the result, or record other names"
            )
    for dim in dict.fromkeys((POINT, *(dim for entry in entries.values() for dim in entry.dims))):
        if dim in entries and entries[dim].dims != (dim,):
            raise InvalidInput(
                f"the solver returns {dim!r}, which is the name of a dimension of the table; "
                "rename the result, or record other names"
            )
    values, meanings = {}, {}
    for name, entry in entries.items():
        values[name], kind = _written(name, entry)
        labels = tuple((dim, tuple(given)) for dim, given in entry.labels.items())
        meanings[name] = Meaning(kind, entry.unit, entry.title or name, entry.dims, labels)
    return values, meanings


def entries_of(answer: Any) -> Mapping[str, Recorded]:
    """What an answer has to record, by name. Raises InvalidInput for one that has nothing."""
    if hasattr(answer, "recorded"):
        return dict(answer.recorded())
    if isinstance(answer, Mapping):
        if not answer or not all(isinstance(name, str) and name for name in answer):
            raise InvalidInput(f"the names of solver results must be texts, got {answer!r:.200}")
        for name in answer:
            if "/" in name or not name.isprintable() or name != name.strip():
                raise InvalidInput(
                    "the names of solver results must be valid in NetCDF, without '/', control "
                    f"characters and outer spaces, got {name!r:.100}"
                )
        return {name: _entry(name, value) for name, value in answer.items()}
    return {VALUE: _entry(VALUE, answer)}


def _entry(name: str, value: Any) -> Recorded:
    """A value of a user's function: a number, a text, an array of them, a quantity of pint."""
    if isinstance(value, Recorded):
        return value
    unit = ""
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        value, unit = value.magnitude, f"{value.units:~}"
    if isinstance(value, np.ma.MaskedArray):
        value = value.tolist()  # None where it is masked
    if value is None or isinstance(value, str):
        return Recorded(value, unit)
    found = np.array(value, dtype=object)  # which keeps numbers and texts apart
    if found.ndim > len(LETTERS):
        raise InvalidInput(
            f"{name!r} must have at most {len(LETTERS)} dimensions, got {found.ndim}"
        )
    dims = tuple(f"{name}_{letter}" for letter in LETTERS[: found.ndim])
    return Recorded(found.tolist(), unit, "", dims)


def without_conflicts(line: str, conflicts: Mapping[str, str]) -> str:
    """The line of a point, which has failed if its names mean something else than elsewhere."""
    if not conflicts:
        return line
    values = json.loads(line).get("values") or {}
    why = [told for name, told in conflicts.items() if values.get(name) is not None]
    return failure(why[0]) if why else line


def _written(name: str, entry: Recorded) -> tuple[Any, str]:
    """Values as JSON has them, and their kind. Raises InvalidInput."""
    kinds: set[str] = set()

    def written(value: Any, depth: int) -> Any:
        if isinstance(value, np.ndarray | np.generic):
            value = value.tolist()
        if isinstance(value, list | tuple):
            if depth == len(entry.dims):
                raise InvalidInput(f"{name!r} must have {len(entry.dims)} dimensions, got more")
            return [written(v, depth + 1) for v in value]
        if depth < len(entry.dims):
            raise InvalidInput(f"{name!r} must have {len(entry.dims)} dimensions, got fewer")
        if value is None:
            return None
        if isinstance(value, str):
            if any(c == "\0" or "\ud800" <= c <= "\udfff" for c in value):
                raise InvalidInput(
                    f"texts must be valid in UTF-8 and NetCDF, got {value!r:.100} for {name!r}; "
                    "leave out null characters and surrogates"
                )
            kinds.add(TEXT)
            return value
        if isinstance(value, bool | int | float):
            kinds.add(NUMBER)
            number = float(value)
            return number if math.isfinite(number) else _without_number(number)
        raise InvalidInput(
            "a solver must return real numbers, texts, arrays of them, a dict of those, or a "
            f"result of this package, got {type(value).__name__} for {name!r}"
        )

    found = written(entry.values, 0)
    if len(kinds) > 1:
        raise InvalidInput(f"{name!r} must hold only numbers or only texts, got both")
    return found, next(iter(kinds), "")


def _without_number(number: float) -> str | None:
    """Infinity as a text, which `float` reads; nothing for a value that is not a number."""
    return None if math.isnan(number) else repr(number)


def _json(row: Mapping[str, Any]) -> str:
    return json.dumps(row, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


class _Recorder:
    """Warnings of one thread, while others may collect theirs."""

    def __init__(self) -> None:
        self._lock, self._count = threading.Lock(), 0
        self._own = threading.local()
        self._catching: Any = None
        self._before: Any = None

    @contextmanager
    def messages(self) -> Iterator[list[str]]:
        """The texts of the warnings of this thread, as they come."""
        found: list[str] = []
        outer, self._own.found = getattr(self._own, "found", None), found
        with self._lock:
            if self._count == 0:
                self._catching = warnings.catch_warnings()
                self._catching.__enter__()
                warnings.simplefilter("always")
                self._before, warnings.showwarning = warnings.showwarning, self._take
            self._count += 1
        try:
            yield found
        finally:
            self._own.found = outer
            with self._lock:
                self._count -= 1
                if self._count == 0:
                    self._catching.__exit__(None, None, None)

    def _take(self, message: Warning | str, *rest: Any, **more: Any) -> None:
        found = getattr(self._own, "found", None)
        if found is None:
            self._before(message, *rest, **more)
        else:
            found.append(" ".join(str(message).split()))


_recorder = _Recorder()
