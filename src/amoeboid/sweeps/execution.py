"""Points on executors: one process, several, or a cluster, with a second try for what is lost.

An executor is anything with `submit` that gives futures with `done` and `result`, those of
`concurrent.futures` first. A task that raises was lost with its worker, as evaluating a point never
does. Its points are tried once more, each of them alone, so that one that ends its worker is found
and no other pays for it.

A task takes about `TASK_SECONDS`, by the time that workers measure: the cost of a task to an
executor does not count then. Towards the end tasks become smaller, so that all workers end at once.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from amoeboid.sweeps.evaluation import Solver, evaluated, failure
from amoeboid.sweeps.meanings import Meanings
from amoeboid.validation import InvalidInput

Take = Callable[[Sequence[int], Sequence[str], Meanings], None]
"""A callback that gets the lines of points, and what names mean."""

MAX_QUEUED = 1000  # tasks given to an executor that does not say how many it works on
TASK_SECONDS = 0.5  # of a task that takes several points
MAX_TASK = 200  # points of a task
POLL = 0.2  # seconds between looks at futures that do not call back
HOPELESS = 3  # points lost one after the other, and none that was not


def run_serially(solver: Solver, cells: Sequence[Any], todo: Sequence[int], take: Take) -> None:
    """Evaluate the points `todo` of `cells` in this process, one batch after the other."""
    size = solver.batch_size
    for start in range(0, len(todo), size):
        places = todo[start : start + size]
        take(places, *evaluated(solver, [cells[k] for k in places]))


class Parallel:
    """Points that are evaluated by an executor; `points_per_task` is found from their time if None.

    `workers`: make an executor of that many processes instead.
    """

    def __init__(
        self,
        solver: Solver,
        cells: Sequence[Any],
        take: Take,
        executor: Any = None,
        workers: int | None = None,
        points_per_task: int | None = None,
    ) -> None:
        self._solver, self._cells, self._take = solver, cells, take
        self._own = executor is None
        self._executor = own_processes(workers or 1) if executor is None else executor
        if isinstance(self._executor, ProcessPoolExecutor):
            check_pickles(solver)
        self._client = _dask_client(self._executor)
        self._width = _width(self._executor)
        self._size = points_per_task
        self._running: dict[Any, list[int]] = {}
        self._ended: SimpleQueue[Any] = SimpleQueue()  # tasks that have called back
        self._seconds: float | None = None  # a point takes
        self._tries: dict[int, int] = {}
        self._lost_in_a_row, self._succeeded = 0, False

    def run(self, todo: Iterable[int]) -> None:
        """Evaluate points; on the way out nothing is left running."""
        waiting, suspects = deque(todo), deque[int]()
        try:
            while waiting or suspects or self._running:
                if suspects and not self._running:
                    self._submit([suspects.popleft()])
                while waiting and not suspects and len(self._running) < self._queued:
                    count = min(self._task_size(len(waiting)), len(waiting))
                    self._submit([waiting.popleft() for _ in range(count)])
                for future in self._done():
                    suspects.extend(self._taken(future, self._running.pop(future)))
        finally:
            for future in self._running:
                with suppress(Exception):
                    future.cancel()
            if self._own:
                end(self._executor)

    @property
    def _queued(self) -> int:
        """How many tasks an executor has at a time.

        A cluster of Dask has many, as it may grow with them, but not before their size is known.
        """
        unsized = self._size is None and self._seconds is None
        if self._width is None or (self._client is not None and not unsized):
            return MAX_QUEUED
        return 2 * self._width

    def _task_size(self, left: int) -> int:
        if self._size is not None:
            return self._size
        if self._solver.batch_size > 1:
            return self._solver.batch_size
        if self._seconds is None or self._width is None:
            return 1
        fits = int(TASK_SECONDS / max(self._seconds, 1e-6))
        return max(1, min(fits, MAX_TASK, left // (4 * self._width)))

    def _submit(self, places: list[int]) -> None:
        task = (self._solver, [self._cells[k] for k in places])
        try:
            future = submitting(self._executor)(timed, *task)
        except BrokenProcessPool:  # it broke since the last look
            self._replace()
            future = self._executor.submit(timed, *task)
        self._running[future] = places
        if hasattr(future, "add_done_callback"):
            future.add_done_callback(self._ended.put)

    def _done(self) -> list[Any]:
        """The tasks that are done; waits for one."""
        if not self._running:
            return []
        found: list[Any] = []
        while not found:
            with suppress(Empty):
                found.append(self._ended.get(timeout=POLL))
                while True:
                    found.append(self._ended.get_nowait())
            silent = (f for f in self._running if not hasattr(f, "add_done_callback"))
            found.extend(future for future in silent if future.done())
        return found

    def _taken(self, future: Any, places: list[int]) -> list[int]:
        """Take up what a task gave; the points to try again."""
        try:
            seconds, lines, meanings = future.result()
        except Exception as error:  # whatever an executor raises for a task that is lost
            return self._lost(places, error)
        self._succeeded, self._lost_in_a_row = True, 0
        latest = seconds / len(places)
        self._seconds = latest if self._seconds is None else 0.5 * (self._seconds + latest)
        self._take(places, lines, meanings)
        return []

    def _lost(self, places: list[int], error: Exception) -> list[int]:
        broken = isinstance(error, BrokenProcessPool)
        if broken:
            self._replace()
        again = []
        for k in places:
            self._tries[k] = self._tries.get(k, 0) + 1
            if self._tries[k] < 2 or len(places) > 1:
                again.append(k)
                continue
            told = " ".join(str(error).split()) or type(error).__name__
            why = "the worker ended" if broken else f"{type(error).__name__}: {told}"
            self._lost_in_a_row += 1
            if self._lost_in_a_row >= HOPELESS and not self._succeeded and not self._works():
                raise InvalidInput(
                    f"workers must be able to evaluate points, {HOPELESS} points were lost twice "
                    f"and none succeeded ({why}); scripts need `if __name__ == '__main__':`, and "
                    "remote workers the same packages; try executor=None first"
                ) from error
            self._take([k], [failure(f"lost twice: {why}", again=True)], {})
        return again

    def _works(self) -> bool:
        """Whether workers can have the solver at all."""
        try:
            return bool(submitting(self._executor)(_has, self._solver).result())
        except Exception:
            return False

    def _replace(self) -> None:
        """A new pool of processes for one that is broken."""
        if not isinstance(self._executor, ProcessPoolExecutor) or not _is_broken(self._executor):
            return
        if self._own:
            end(self._executor)
        context = getattr(self._executor, "_mp_context", None)
        self._executor, self._own = own_processes(self._width or 1, context), True


def timed(solver: Solver, cells: Sequence[Any]) -> tuple[float, list[str], Meanings]:
    """What `evaluated` gives, after the seconds that it took."""
    begun = time.monotonic()
    lines, meanings = evaluated(solver, cells)
    return time.monotonic() - begun, lines, meanings


def submitting(executor: Any) -> Callable[..., Any]:
    """The function that gives an executor a task.

    Of Dask it is that of the client: a future of Dask's executor never ends if its worker dies
    between the end of the task and the transfer of its result. Its tasks are not `pure`, which
    would give a task that was lost the same key, and the same end, when it is tried again.
    """
    client = _dask_client(executor)
    if client is not None:
        return partial(client.submit, **{**getattr(executor, "_kwargs", {}), "pure": False})
    return executor.submit


def _dask_client(executor: Any) -> Any:
    """The client of an executor of Dask; None for others."""
    known = type(executor).__name__ == "ClientExecutor"
    return getattr(executor, "_client", None) if known else None


def _width(executor: Any) -> int | None:
    """How many tasks an executor works on at a time, at least 1; None if it does not say."""
    client = _dask_client(executor)
    if client is not None:
        return max(1, sum(client.nthreads().values()))
    found = getattr(executor, "_max_workers", None)
    return None if found is None else int(found)


def own_processes(workers: int, context: Any = None) -> ProcessPoolExecutor:
    """Processes that end with this one, and leave Ctrl-C to it."""
    context = context or multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_begin)


def end(executor: Executor) -> None:
    """End the processes of an executor of `own_processes` at once."""
    processes = list((getattr(executor, "_processes", None) or {}).values())
    executor.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        with suppress(Exception):
            process.terminate()
    for process in processes:
        with suppress(Exception):
            process.join(5.0)


def check_pickles(solver: Solver) -> None:
    """Raise InvalidInput for a function that other processes cannot have."""
    remedy = (
        "write it as a function of a file that is imported (arguments by functools.partial), or "
        "leave out workers and executor"
    )
    try:
        pickle.dumps(solver)
    except Exception as error:  # pickle raises what it meets
        raise InvalidInput(
            "a solver must be a function that other processes can import, this one cannot be: "
            f"{error}; {remedy}"
        ) from None
    function = getattr(solver.function, "func", solver.function)
    main = sys.modules["__main__"]
    if getattr(function, "__module__", "") == "__main__" and not hasattr(main, "__file__"):
        raise InvalidInput(
            "a solver must be a function that other processes can import, this one was typed "
            f"interactively; {remedy}"
        )


def _has(solver: Solver) -> bool:
    """Whether a worker has a solver: it could import all that it needs."""
    return callable(solver.function)


def _is_broken(executor: ProcessPoolExecutor) -> bool:
    try:
        executor.submit(os.getpid).cancel()
    except BrokenProcessPool:
        return True
    return False


def _begin() -> None:
    """What each process of ours does first: it leaves Ctrl-C to the first one, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
