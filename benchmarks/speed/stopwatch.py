"""Wall-clock times of tasks, and of the phases of a time step.

The solvers hold no timers. `phases_timed` replaces their functions, for its duration, by ones that
note when they are entered and left.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from statistics import median
from typing import Any

from amoeboid.meshes.geometry import geometry
from amoeboid.numerics.sparse import Factor
from amoeboid.observables import observed
from amoeboid.surface.force_balance import factorized_cortex, force_balance
from amoeboid.surface.model import Model
from amoeboid.surface.stepping import semi_implicit_step
from amoeboid.surface.transport import transported

PHASES = (
    "geometry",
    "assembly",
    "factorization",
    "solve",
    "shape",
    "transport",
    "control",
    "observables",
)
"""What a step consists of.

geometry: areas, normals, gradients; assembly: matrix and forces of the force balance;
factorization and solve: its linear system; shape: motion of the nodes, area, checks; transport: the
concentration, with its own linear system; control: error estimate and rates of change;
observables.
"""

_TIMED: tuple[tuple[str, Callable[..., Any]], ...] = (
    ("geometry", geometry),
    ("assembly", factorized_cortex),
    ("assembly", force_balance),
    ("shape", semi_implicit_step),
    ("transport", transported),
    ("observables", observed),
)


@dataclass(frozen=True)
class Timing:
    """Best and median wall-clock time of `repetitions` [s]."""

    best_s: float
    median_s: float
    repetitions: int

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Timing:
        """The timing of measured times, at least one."""
        return cls(min(seconds), median(seconds), len(seconds))


def timed(task: Callable[[], object], repetitions: int) -> Timing:
    """Time a task; a first call, which may compile or fill caches, does not count."""
    task()
    seconds = []
    for _ in range(repetitions):
        began = time.perf_counter()
        task()
        seconds.append(time.perf_counter() - began)
    return Timing.of(seconds)


class Stopwatch:
    """Time spent in phases that may contain each other; each moment belongs to the innermost."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = defaultdict(float)
        self._open: list[str] = []
        self._since = 0.0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Attribute the time until the end of the block to `name`."""
        self._turn()
        self._open.append(name)
        try:
            yield
        finally:
            self._turn()
            self._open.pop()

    def read(self) -> dict[str, float]:
        """Seconds by phase since the last reading; call it outside all phases."""
        seconds, self._seconds = dict(self._seconds), defaultdict(float)
        return seconds

    def _turn(self) -> None:
        now = time.perf_counter()
        if self._open:
            self._seconds[self._open[-1]] += now - self._since
        self._since = now

    def timing(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """`function` that counts as phase `name`."""

        @wraps(function)
        def in_phase(*args: Any, **kwargs: Any) -> Any:
            with self.phase(name):
                return function(*args, **kwargs)

        return in_phase


class _TimedSolver:
    """A linear solver whose factorizations and solutions are timed."""

    def __init__(self, solver: Any, watch: Stopwatch) -> None:
        self._solver, self._watch = solver, watch

    def factor(self, entries: Any) -> Factor:
        with self._watch.phase("factorization"):
            factor = self._solver.factor(entries)
        return _TimedFactor(factor, self._watch)


class _TimedFactor:
    def __init__(self, factor: Factor, watch: Stopwatch) -> None:
        self._factor, self._watch = factor, watch

    def solve(self, b: Any) -> Any:
        with self._watch.phase("solve"):
            return self._factor.solve(b)


@contextmanager
def phases_timed() -> Iterator[Stopwatch]:
    """A stopwatch that runs while steps are made by any part of the package."""
    watch = Stopwatch()
    replaced: list[tuple[Any, str, Any]] = []
    vector_solver = vars(Model)["vector_solver"]

    def timed_solver(model: Model) -> _TimedSolver:
        return _TimedSolver(vector_solver.__get__(model, Model), watch)

    def replace(owner: Any, name: str, value: Any) -> None:
        replaced.append((owner, name, vars(owner)[name]))
        setattr(owner, name, value)

    try:
        for phase, function in _TIMED:
            in_phase = watch.timing(phase, function)
            for module in [m for n, m in sys.modules.items() if n.startswith("amoeboid.")]:
                if module.__name__ != __name__:
                    for name in [n for n, value in vars(module).items() if value is function]:
                        replace(module, name, in_phase)
        replace(Model, "vector_solver", property(timed_solver))
        yield watch
    finally:
        for owner, name, value in replaced:
            setattr(owner, name, value)
