"""One call of `sweep`: what is known, what is computed, and by what name an answer is kept."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from amoeboid.assignments import SECTIONS
from amoeboid.config import Config
from amoeboid.identity.content import Unidentified, content, name_of
from amoeboid.model.parameters import Parameters, refuse_unwritable_relations
from amoeboid.output.versions import installed_versions
from amoeboid.sweeps.evaluation import FAILED, Solver, failure, without_conflicts
from amoeboid.sweeps.execution import Parallel, run_serially
from amoeboid.sweeps.folder import FORMAT, VERSION, SweepFolder
from amoeboid.sweeps.meanings import Meanings, agreed
from amoeboid.sweeps.points import Base, Points
from amoeboid.sweeps.refinement import Refinement
from amoeboid.sweeps.result import Sweep
from amoeboid.sweeps.table import Layout, layout
from amoeboid.validation import InvalidInput

Report = Callable[[int, int], None]
"""A callback that gets the number of points that are done, and of all."""


class Computation:
    """One call of `sweep`: its solver, how it is computed, and where answers are kept.

    `how`: the arguments of `Parallel`, None for one point after the other.
    """

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


def refined(run: Computation, plan: Refinement, report: Report) -> Sweep:
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
