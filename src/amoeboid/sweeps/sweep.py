"""`sweep`: a solver at many points, one after the other, in parallel or as shards of an array."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from numbers import Integral
from typing import Any

from amoeboid.sweeps.computation import Computation, Report, refined
from amoeboid.sweeps.evaluation import Solver
from amoeboid.sweeps.folder import TABLE
from amoeboid.sweeps.points import Points, listed
from amoeboid.sweeps.refinement import Refinement
from amoeboid.sweeps.result import Sweep
from amoeboid.sweeps.table import check_netcdf
from amoeboid.terminal import shown_line
from amoeboid.validation import InvalidInput, path_of

QUIET = 2.0  # seconds; a sweep that is over by then shows nothing from Python
WHOLE = (1, 1)


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
    run = Computation(
        Solver(_checked(solver), names, first.names),
        _checked_executor(executor, workers, points_per_task),
        place,
        part,
        retry,
        key,
    )
    try:
        with run.storing(first), _reported(progress) as report:
            found = run.made(first, report) if plan is None else refined(run, plan, report)
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
