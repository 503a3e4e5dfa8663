"""`sweep`: a solver at many points, one after the other, in parallel or as shards of an array."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from numbers import Integral
from pathlib import Path
from typing import Any

from amoeboid.config import SECTIONS, Config
from amoeboid.identity.content import Unidentified, content, name_of
from amoeboid.model.parameters import Parameters, refuse_unwritable_relations
from amoeboid.output.versions import installed_versions
from amoeboid.sweeps.evaluation import FAILED, Solver, failure, without_conflicts
from amoeboid.sweeps.execution import Parallel, run_serially
from amoeboid.sweeps.folder import FORMAT, TABLE, VERSION, SweepFolder
from amoeboid.sweeps.meanings import Meanings, agreed
from amoeboid.sweeps.points import Base, Points, listed
from amoeboid.sweeps.refinement import Refinement
from amoeboid.sweeps.result import Sweep
from amoeboid.sweeps.table import Layout, check_netcdf, layout
from amoeboid.terminal import shown_line
from amoeboid.validation import InvalidInput, path_of

QUIET = 2.0  # seconds; a sweep that is over by then shows nothing from Python
WHOLE = (1, 1)

Report = Callable[[int, int], None]
"""A callback that gets the number of points that are done, and of all."""


def sweep(
    points: Points | Refinement | Iterable[Any],
    solver: Callable[..., Any],
    *,
    record: Iterable[str] | None = None,
    executor: Any = None,
    workers: int | None = None,
    points_per_task: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    shard: tuple[int, int] | None = None,
    retry: bool = False,
    key: str | None = None,
    progress: Any = None,
) -> Sweep:
    """The answers of a solver at many points; a point that fails is named, and the rest continues.

    `points`: what `grid`, `paired`, `sobol` or `refine` make, or a list of parameters. `solver`: a
    function of Parameters, such as `amoeboid.theory`, `steady_states`, `branch`, `simulate`, or one
    of your own that gives a number, a text, an array, or a dict of them; arguments are given by
    `functools.partial(amoeboid.branch, name="v_p0", end=8)`. `record`: names of what is recorded,
    the usual ones if left out.

    `executor`: any of `concurrent.futures`, Dask's `client.get_executor()`, submitit's; `workers`:
    that many processes instead; without both, points are computed one after the other. All give the
    same bits. `points_per_task`: found from their time if left out.

    `folder`: where each answer is kept at once, and the table in the end (`sweep.nc`); the same
    call continues where an earlier one stopped, also with more points. Answers of another version
    of the code are computed anew. `shard=(3, 10)` computes the third of ten parts of the points, in
    a folder that all parts share; `load_sweep` reads them together. `retry`: compute points again
    that failed. `key`: a text that tells your function from others, if it is not in a file.
    `progress`: None shows a line on a terminal or in a notebook after two seconds, True at once,
    False never; a function is called with the number of points done, and of all.

    Raises InvalidInput; OSError for a folder that cannot be written; KeyboardInterrupt, after
    which what is done is kept in the folder.

    >>> import amoeboid as am
    >>> found = am.sweep(am.grid(D=[0.1, 0.4, -1], v_p0=[4, 6]), am.theory)
    >>> found
    Sweep of theory at 6 points (3 x 2) in D -1 to 0.4 L^2/T, v_p0 4 to 6 L/T: 2 failed, 4 ok
    - D = -1, v_p0 = 4: D must be a finite number >= 0, got -1.0
    - D = -1, v_p0 = 6: D must be a finite number >= 0, got -1.0
    >>> found["bifurcation"].sel(D=0.4).values.tolist()
    ['subcritical', 'subcritical']
    """
    plan = points if isinstance(points, Refinement) else None
    part = _checked_shard(shard, folder, plan)
    place = None if folder is None else path_of(folder, "the folder of a sweep")
    if place is not None and part == WHOLE:
        check_netcdf()
    first = _points(points)
    names = _checked_record(record, plan)
    run = _Run(
        Solver(_checked(solver), names, first.names),
        _checked_executor(executor, workers, points_per_task),
        place,
        part,
        retry,
        key,
    )
    try:
        with run.storing(first), _reported(progress) as report:
            found = run.made(first, report) if plan is None else _refined(run, plan, report)
    except KeyboardInterrupt as stop:
        if place is not None:
            stop.add_note(f"what is done is kept in {str(place)!r}; the same call continues")
        raise
    if place is not None and part == WHOLE:
        found.save(place / TABLE)
    return found


def _points(given: Points | Refinement | Iterable[Any]) -> Points:
    """The points that are computed first."""
    if isinstance(given, Refinement):
        return given.grid
    return given if isinstance(given, Points) else listed(given)


class _Run:
    """One call of `sweep`."""

    def __init__(
        self,
        solver: Solver,
        how: Mapping[str, Any] | None,
        folder: Path | None,
        shard: tuple[int, int],
        retry: bool,
        key: str | None,
    ) -> None:
        self.solver, self.how, self.shard, self.retry = solver, how, shard, retry
        self.store = None if folder is None else SweepFolder(folder)
        self.code = _code(solver, key, needed=folder is not None)
        self.described = content(solver.function, _named)
        self._fresh: set[str] = set()  # points that failed and were computed again

    @contextmanager
    def storing(self, points: Points) -> Iterator[None]:
        """With the folder open, if there is one."""
        if self.store is None:
            yield
            return
        with self.store.opened(self._manifest(points, self._layout(points), []), self.shard):
            yield

    def made(self, points: Points, report: Report) -> Sweep:
        """The answers at points, from the folder or computed now."""
        table = self._layout(points)
        cells = [_cell(points, k) for k in range(len(points))]
        keys = [self._key(points, k, cell) for k, cell in enumerate(cells)]
        known, meanings = (self.store.rows, self.store.meanings) if self.store else ({}, {})
        if self.store is not None:
            self.store.tell(self._manifest(points, table, keys))
        todo = self._todo(keys, known)
        done, total = len(keys) - len(todo), len(keys)

        def take(places: Sequence[int], lines: Sequence[str], new: Meanings) -> None:
            nonlocal done
            joint, conflicts = agreed(meanings, new)
            sound = [without_conflicts(line, conflicts) for line in lines]
            rows = {keys[k]: line for k, line in zip(places, sound, strict=True)}
            if self.store is not None:
                self.store.add(rows, joint, together=self.solver.batch_size > 1)
            else:
                known.update(rows)
                meanings.update(joint)
            self._fresh.update(rows)
            done += len(places)
            report(done, total)

        report(done, total)
        impossible = [k for k in todo if isinstance(cells[k], InvalidInput)]
        if impossible:
            take(impossible, [failure(str(cells[k])) for k in impossible], {})
        possible = [k for k in todo if not isinstance(cells[k], InvalidInput)]
        if self.how is None:
            run_serially(self.solver, cells, possible, take)
        elif possible:
            Parallel(self.solver, cells, take, **self.how).run(possible)
        rows = tuple(known.get(key) for key in keys)
        if self.store is None:
            return Sweep(table, rows, dict(meanings))
        outdated = len(self.store.outdated.difference(keys))
        return Sweep(table, rows, dict(meanings), self.store.path, outdated)

    def _todo(self, keys: Sequence[str], known: Mapping[str, str]) -> list[int]:
        """The points of this shard that are not done, the same point once."""
        number, count = self.shard
        mine = {key: k for k, key in reversed(list(enumerate(keys))) if k % count == number - 1}
        return sorted(k for key, k in mine.items() if not self._is_done(key, known.get(key)))

    def _is_done(self, key: str, row: str | None) -> bool:
        if row is None:
            return False
        found = json.loads(row)
        if found["status"] != FAILED or key in self._fresh:
            return True
        return not (self.retry or found.get("again"))

    def _key(self, points: Points, k: int, cell: Any) -> str:
        """The name under which the answer at a point is kept."""
        if self.store is None:
            return str(k)
        if isinstance(cell, InvalidInput):
            told = f"{_written(points.base)}{points.changes(k)!r}"
        elif isinstance(cell, Parameters):
            told = json.dumps([cell.as_dict(), repr(cell.units)])
        else:
            told = content(cell)
        return sha256(f"{self.code}\n{told}".encode()).hexdigest()[:32]

    def _layout(self, points: Points) -> Layout:
        attributes = {
            "solver": self.described,
            "base": json.dumps({} if points.cells else _written(points.base)),
            "amoeboid": version("amoeboid"),
            "code": self.code,
        }
        seed = {} if points.seed is None else {"seed": points.seed}
        return layout(points, attributes | seed)

    def _manifest(self, points: Points, table: Layout, keys: Sequence[str]) -> dict[str, Any]:
        for cell in points.cells or (points.base,):
            refuse_unwritable_relations(cell.parameters if isinstance(cell, Config) else cell)
        record = self.solver.record
        manifest = {
            "format": FORMAT,
            "format_version": VERSION,
            "solver": self.described,
            "record": None if record is None else list(record),
            "base": {} if points.cells else _written(points.base),
            "code": self.code,
            "versions": installed_versions(),
            "layout": table.written(),
            "keys": list(keys),
        }
        return json.loads(json.dumps(manifest))


def _refined(run: _Run, plan: Refinement, report: Report) -> Sweep:
    """The answers at the points of a grid, and at more of them where a label changes."""
    places = plan.first()
    while True:
        found = run.made(plan.points(places), report)
        new = plan.next(dict(zip(places, _labels(plan, found), strict=True)))
        if not new:
            return found
        places = [*places, *new]


def _labels(plan: Refinement, found: Sweep) -> list[Any]:
    """The labels of points; None for those that failed. Raises InvalidInput."""
    labels: list[Any] = []
    for row in found.rows:
        read = json.loads(row or "{}")
        values = read.get("values")
        if read.get("status", FAILED) == FAILED or values is None:
            labels.append(None)
            continue
        for name in plan.label:
            if name not in values or isinstance(values[name], list):
                single = [n for n, v in values.items() if not isinstance(v, list)]
                raise InvalidInput(
                    "the label of a refinement must be recorded, with one value per point, got "
                    f"{name!r}; allowed: {', '.join(single)}"
                )
        labels.append(tuple(values[name] for name in plan.label))
    return labels


def _cell(points: Points, k: int) -> Base | InvalidInput:
    """The parameters of a point, or why they cannot be."""
    try:
        return points.cell(k)
    except InvalidInput as problem:
        return problem


def _written(base: Base) -> dict[str, Any]:
    """A base as JSON has it."""
    p = base.parameters if isinstance(base, Config) else base
    found: dict[str, Any] = dict(p.as_dict())
    if p.units is not None:
        found |= {f"unit of {name}": size for name, size in asdict(p.units).items()}
    if isinstance(base, Config):
        sections = {s: base.section(s) for s in SECTIONS if s != "parameters"}
        found |= {f"{s}.{k}": v for s, values in sections.items() for k, v in values.items()}
    return found


def _code(solver: Solver, key: str | None, needed: bool) -> str:
    """A digest of all that answers depend on beside the point. Raises InvalidInput."""
    if key is not None and not isinstance(key, str):
        raise InvalidInput(f"key must be a text, got {key!r:.100}")
    try:
        function = content(solver.function)
    except Unidentified as why:
        if key is None and needed:
            raise InvalidInput(
                "results kept in a folder need a solver whose code can be identified, this one "
                f"cannot be: {why}; define it in a file, or give a key that you change with the "
                "solver"
            ) from None
        function = content(solver.function, _named)
    told = f"{function}\n{solver.record!r}\n{key!r}\n{version('amoeboid')}"
    return sha256(told.encode()).hexdigest()[:32]


def _named(function: Any) -> str:
    """The name of a function, whatever it is."""
    known = hasattr(function, "__module__") and hasattr(function, "__qualname__")
    return name_of(function) if known else f"{type(function).__module__}.{type(function).__name__}"


def _checked(solver: Any) -> Callable[..., Any]:
    if not callable(solver):
        raise InvalidInput(
            "solver must be a function of Parameters, such as amoeboid.steady_states, got "
            f"{solver!r:.100}"
        )
    return solver


def _checked_record(record: Any, plan: Refinement | None) -> tuple[str, ...] | None:
    """Names of what is recorded; None: the usual ones. Raises InvalidInput."""
    if record is None:
        return None
    one = isinstance(record, str) or not isinstance(record, Iterable)
    names = (record,) if one else tuple(record)
    if not all(isinstance(name, str) for name in names):
        raise InvalidInput(f"record must be a list of names, got {record!r:.100}")
    for label in () if plan is None else plan.label:
        if label not in names:
            raise InvalidInput(
                f"the label of a refinement must be recorded, {label!r} is not among "
                f"{', '.join(names) or 'no names'}; add it to record"
            )
    return names


def _checked_executor(executor: Any, workers: Any, points_per_task: Any) -> dict[str, Any] | None:
    """The arguments of `Parallel`; None for one point after the other. Raises InvalidInput."""
    for name, count in (("workers", workers), ("points_per_task", points_per_task)):
        whole = isinstance(count, Integral) and not isinstance(count, bool)
        if count is not None and not (whole and count >= 1):
            raise InvalidInput(f"{name} must be a whole number >= 1, got {count!r}")
    if executor is not None and workers is not None:
        raise InvalidInput("give an executor or workers, not both")
    usable = callable(getattr(executor, "submit", None)) and not isinstance(executor, type)
    if executor is not None and not usable:
        raise InvalidInput(
            "executor must have `submit`, as those of concurrent.futures and Dask's "
            f"client.get_executor(), got {executor!r:.100}"
        )
    if executor is None and workers is None:
        return None
    return {"executor": executor, "workers": workers, "points_per_task": points_per_task}


def _checked_shard(shard: Any, folder: Any, plan: Refinement | None) -> tuple[int, int]:
    if shard is None:
        return WHOLE
    pair = isinstance(shard, tuple | list) and len(shard) == 2
    whole = pair and all(isinstance(n, Integral) and not isinstance(n, bool) for n in shard)
    if not whole or not 1 <= shard[0] <= shard[1]:
        raise InvalidInput(
            f"shard must be (k, n), part k of n with 1 <= k <= n, got {shard!r:.100}"
        )
    if folder is None:
        raise InvalidInput("a shard needs a folder that all shards share, got none; give one")
    if plan is not None:
        raise InvalidInput(
            "a refinement cannot be divided into shards, because its points depend on each "
            "other; use workers or an executor"
        )
    return int(shard[0]), int(shard[1])


@contextmanager
def _reported(progress: Any) -> Iterator[Report]:
    """What the keyword `progress` asks for: None, after a while; True, at once; False, nothing."""
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise InvalidInput(
            f"progress must be None, True, False or a function of two numbers, got {progress!r}"
        )
    if progress is False:
        yield lambda done, total: None
        return
    if callable(progress):
        yield progress
        return
    began, before = time.monotonic(), None
    with shown_line(0.0 if progress else QUIET) as show:

        def report(done: int, total: int) -> None:
            nonlocal before
            before = done if before is None else before
            if show is not None:
                show(_parts(done, total, done - before, time.monotonic() - began))

        yield report


def _parts(done: int, total: int, now: int, elapsed: float) -> tuple[str, ...]:
    """The parts of a line of progress; `now` are the points that this call has computed."""
    left = elapsed / now * (total - done) if now else None
    told = "" if left is None else f"about {_duration(left)} left"
    return tuple(part for part in (f"{done} of {total} points", told) if part)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"
