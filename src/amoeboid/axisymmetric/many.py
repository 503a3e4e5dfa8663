"""Polarized steady states at many parameter points: how lanes are started, filled and judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric import lanes
from amoeboid.axisymmetric.lanes import (
    AT_SPEED,
    FIRST_STEP,
    FOLLOWING,
    FOUND,
    NONE,
    OUTSIDE,
    STALLED,
    Cells,
    Lane,
    Problem,
)
from amoeboid.axisymmetric.spectral import grid
from amoeboid.axisymmetric.steady import (
    FRICTION,
    OPTIONAL,
    STRONG,
    Magnitudes,
    SteadySystem,
    homogeneous_unknowns,
)
from amoeboid.axisymmetric.unknowns import resampled
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import Points, points
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.newton import solve
from amoeboid.validation import InvalidInput

CONVERGED, STOPPED, UNRESOLVED, SPHERE, UNDEFINED = range(5)
STATUSES = ("converged", "stalled", "unresolved", "sphere", "undefined")
REASONS = (
    "",
    "Newton's method failed at every step length along the branch",
    "the series of {modes} modes does not resolve the state; allow more modes, or raise D",
    "only the homogeneous sphere was found: the branch that leaves it as v_p0 grows has no "
    "other state here, or the start led back to the sphere",
    "the law has no value at the concentrations of the state",
)

CHUNK_ON_CPU, CHUNK = 64, 3000
"""Cells that are computed at the same time, on a processor and on an accelerator."""
MIN_SEEDS, SHARE_OF_SEEDS = 32, 0.05
"""Cells that are followed from the threshold; the others start from the nearest of them."""
Told = Callable[[int, int], None]
"""Called with the number of cells that are done, and of all."""


@dataclass(frozen=True, eq=False)
class Found:
    """Unknowns of n modes of every cell, its status, and the Newton steps that it took."""

    n: Array
    x: list[Array]
    status: Array
    steps: Array


@dataclass(frozen=True, eq=False)
class Table:
    """Parameter points as columns (cells,), and what the lanes need of them."""

    of: Points
    numbers: dict[str, Array]
    threshold: Array

    @classmethod
    def made(cls, p: Points) -> Table:
        """The points one after the other, in C order."""
        shape = p.shape
        numbers = {
            name: np.broadcast_to(value, shape).reshape(-1).astype(float)
            for name, value in p.columns().items()
        }
        flat = points(p, **numbers)
        return cls(flat, numbers, _thresholds(flat))

    def __len__(self) -> int:
        return len(self.threshold)

    @cached_property
    def present(self) -> frozenset[str]:
        """The names of `OPTIONAL` that are not 0 everywhere. Raises InvalidInput, see below."""
        friction = sum(self.numbers[name] for name in FRICTION)
        if np.any(friction > 0) and np.any(friction == 0):
            raise InvalidInput(
                "either all cells or none must have friction (gamma_t, gamma_n or gamma_c > 0), "
                f"got {int(np.sum(friction == 0))} of {len(self)} without; compute the two groups "
                "separately"
            )
        return frozenset(n for n in OPTIONAL if np.any(self.numbers.get(n, np.zeros(1)) != 0))

    def parameters(self, k: int) -> Parameters:
        """The parameters of a cell at its threshold."""
        return self.of.parameters(k).replace(v_p0=float(self.threshold[k]))

    def scale(self, n: int) -> Array:
        """Typical magnitude of each unknown (cells, unknowns)."""
        return Magnitudes.of(self.of).of_unknowns(self.of, n)

    def cells(self, n: int) -> Cells:
        """What the lanes need of all cells."""
        numbers = {name: value[:, None] for name, value in self.numbers.items() if name != "v_p0"}
        return Cells(
            numbers, Magnitudes.of(self.of).of_equations(self.of, n), self.scale(n),
            self.numbers["v_p0"] / self.threshold, self.threshold,
        )  # fmt: skip

    def spheres(self, n: int) -> Array:
        """Scaled unknowns of the homogeneous sphere at the threshold."""
        return homogeneous_unknowns(self.of.at_speed(self.threshold), n) / self.scale(n)


def _thresholds(p: Points) -> Array:
    """The lowest threshold of l = 1 in v_p0 of every point, NaN where there is none."""
    try:
        return np.asarray(np.broadcast_to(critical_speed(p), p.shape), dtype=float)
    except InvalidInput:
        if p.shape == (1,):
            return np.array([np.nan])
        half = p.shape[0] // 2
        columns = p.columns()
        parts = [
            points(p, **{name: np.broadcast_to(v, p.shape)[part] for name, v in columns.items()})
            for part in (slice(None, half), slice(half, None))
        ]
        return np.concatenate([_thresholds(part) for part in parts])


def solved(
    p: Points,
    guess: tuple[int, Array] | None,
    modes: int,
    max_modes: int,
    chunk: int | None,
    told: Told,
) -> Found:
    """The polarized state of every point, on the branch that leaves the sphere as v_p0 grows.

    `guess` (n, x (cells, 3 n + 3)): states to start from, instead of the threshold. `chunk` is the
    number of lanes, by default one that suits the device.
    """
    jax = lanes.jax()
    with jax.enable_x64(True):
        if chunk is None:
            chunk = CHUNK_ON_CPU if jax.default_backend() == "cpu" else CHUNK
        return _Work(Table.made(p), modes, max_modes, chunk, told).done(guess)


class _Work:
    """All cells, those that are done, and their states."""

    def __init__(self, table: Table, modes: int, max_modes: int, chunk: int, told: Told) -> None:
        self.table, self.modes, self.max_modes = table, modes, max_modes
        self.chunk, self.told = min(chunk, len(table)), told
        count = len(table)
        self.n = np.full(count, modes)
        self.z = np.zeros((count, 3 * modes + 3))
        self.finer: dict[int, Array] = {}
        self.status = np.full(count, SPHERE)
        self.steps = np.zeros(count, dtype=int)
        self.finished = 0

    def done(self, guess: tuple[int, Array] | None) -> Found:
        """The states of all cells."""
        with_threshold = np.flatnonzero(np.isfinite(self.table.threshold))
        self._tell(len(self.table) - with_threshold.size)
        if guess is None:
            self._from_threshold_and_neighbors(with_threshold)
        else:
            n, x = guess
            z = np.array([resampled(row, n, self.modes) for row in x])
            self._corrected(np.arange(len(self.table)), z / self.table.scale(self.modes))
        self._refined()
        scales = {n: self.table.scale(n) for n in np.unique(self.n)}
        states = [self._state(k) * scales[self.n[k]][k] for k in range(len(self.table))]
        return Found(self.n, states, self.status, self.steps)

    def _state(self, k: Any) -> Array:
        return self.finer.get(int(k), self.z[k])

    def _tell(self, count: int) -> None:
        self.finished += count
        self.told(self.finished, len(self.table))

    def _from_threshold_and_neighbors(self, cells: Array) -> None:
        count = max(MIN_SEEDS, int(SHARE_OF_SEEDS * cells.size))
        order = np.random.default_rng(0).permutation(cells)
        seeds, others = np.sort(order[:count]), np.sort(order[count:])
        self._followed(seeds)
        known = seeds[self.status[seeds] == CONVERGED]
        if others.size and known.size:
            nearest = self._nearest(others, known)
            failed = self._corrected(others, self.z[nearest])
            others = others[failed]
        self._followed(others)

    def _nearest(self, cells: Array, known: Array) -> Array:
        """For every cell the known one whose parameters are nearest, in units of their spread."""
        columns = [v for v in self.table.numbers.values() if np.ptp(v) > 0]
        columns += [self.table.numbers["v_p0"] / self.table.threshold]
        places = np.stack([v / (np.ptp(v) or 1.0) for v in columns], axis=1)
        found = np.empty(cells.size, dtype=int)
        for k, cell in enumerate(cells):
            away = np.sum((places[known] - places[cell]) ** 2, axis=1)
            found[k] = known[np.argmin(away)]
        return found

    def _followed(self, cells: Array) -> None:
        """Along the branch from the threshold of each cell."""
        if not cells.size:
            return
        problem, all_cells = self._problem(self.modes), self.table.cells(self.modes)
        spheres = self.table.spheres(self.modes)
        tangents = np.zeros_like(spheres)
        for k in cells:
            tangents[k] = _departure(self.table.parameters(k), self.modes)
        zero = np.zeros(len(self.table))
        begin = Lane(
            z=spheres + FIRST_STEP * tangents, q=zero + 1.0, z0=spheres, q0=zero + 1.0,
            z_tangent=tangents, q_tangent=zero, step=zero + FIRST_STEP,
            count=zero.astype(int), total=zero.astype(int), last=zero,
            doing=zero.astype(int) + FOLLOWING, alone=zero > 0,
        )  # fmt: skip
        self._run(problem, all_cells, begin, cells, self._keep)

    def _corrected(self, cells: Array, z: Array) -> Array:
        """By Newton's method from a guess; which cells did not get there."""
        problem, all_cells = self._problem(self.modes), self.table.cells(self.modes)
        guess = np.zeros_like(self.z)
        guess[cells] = z
        ended = np.zeros(len(self.table), dtype=int)

        def keep(which: Array, lane: Lane) -> None:
            ended[which] = lane.doing
            good = lane.doing == FOUND
            self._keep(which[good], Lane(*(x[good] for x in lane)))

        self._run(problem, all_cells, _at_speed(guess, all_cells.target), cells, keep)
        failed = ended[cells] != FOUND
        slid = ended[cells] == NONE
        self.status[cells[failed]] = np.where(slid, SPHERE, STOPPED)[failed]
        return failed

    def _refined(self) -> None:
        """States that are not resolved once more, with twice the modes each time."""
        n, cells = self.modes, np.flatnonzero(self.status == CONVERGED)
        while cells.size:
            cells = cells[self._unresolved(n, cells)]
            if 2 * n > self.max_modes or not cells.size:
                self.status[cells] = UNRESOLVED
                break
            problem, all_cells = self._problem(2 * n), self.table.cells(2 * n)
            guess = np.zeros((len(self.table), 3 * 2 * n + 3))
            for k in cells:
                guess[k] = resampled(self._state(k), n, 2 * n)
            self._run(problem, all_cells, _at_speed(guess, all_cells.target), cells, self._keep)
            n *= 2
            cells = cells[self.status[cells] == CONVERGED]

    def _unresolved(self, n: int, cells: Array) -> Array:
        """Whether the continuous equations do not hold; marks cells where the law has no value."""
        problem, all_cells = self._problem(n), self.table.cells(n)
        judge = lanes.checked(problem)
        residual, lowest = np.zeros(len(self.table)), np.zeros(len(self.table))
        for part in self._parts(cells):
            z = np.array([self._state(k) for k in part])
            some = _some(all_cells, part)
            residual[part], lowest[part] = judge(z, some.target, some)
        for relation in (self.table.of.law, self.table.of.stress):
            if relation.above is not None:
                self.status[cells[lowest[cells] <= relation.above]] = UNDEFINED
        return ~(residual[cells] <= STRONG) & (self.status[cells] == CONVERGED)

    def _problem(self, n: int) -> Problem:
        return Problem(n, self.table.of.law, self.table.of.stress, self.table.present)

    def _parts(self, cells: Array) -> list[Array]:
        """The cells in parts of the same size, the last one filled up with its first cell."""
        parts = [cells[k : k + self.chunk] for k in range(0, cells.size, self.chunk)]
        return [np.append(p, np.full(self.chunk - p.size, p[0], dtype=int)) for p in parts]

    def _keep(self, which: Array, lane: Lane) -> None:
        ends = {FOUND: CONVERGED, STALLED: STOPPED, NONE: SPHERE, OUTSIDE: UNDEFINED}
        self.status[which] = [ends[int(d)] for d in lane.doing]
        self.steps[which] += lane.total
        n = (lane.z.shape[1] - 3) // 3
        self.n[which] = n
        for k, z in zip(which, lane.z, strict=True):
            if n == self.modes:
                self.z[k] = z
            else:
                self.finer[int(k)] = z
        if n == self.modes:
            self._tell(which.size)

    def _run(
        self,
        problem: Problem,
        all_cells: Cells,
        begin: Lane,
        cells: Array,
        keep: Callable[[Array, Lane], None],
    ) -> None:
        """Newton steps in all lanes until every cell is done; free lanes take the next cell."""
        step = lanes.advance(problem)
        [first] = self._parts(cells[: self.chunk])
        waiting = cells[self.chunk :]
        at, here = _lanes(begin, first), first.copy()
        busy = np.arange(self.chunk) < min(cells.size, self.chunk)
        some = _some(all_cells, here)
        while busy.any():
            at = step(at, some)
            ready = np.flatnonzero(busy & (np.asarray(at.doing) >= FOUND))
            if not ready.size:
                continue
            at = Lane(*(np.array(x) for x in at))
            keep(here[ready], Lane(*(x[ready] for x in at)))
            following, waiting = waiting[: ready.size], waiting[ready.size :]
            places = ready[: following.size]
            here[places] = following
            for x, new in zip(at, _lanes(begin, following), strict=True):
                x[places] = new
            busy[ready[following.size :]] = False
            some = _some(all_cells, here)


def _departure(p: Parameters, n: int) -> Array:
    """The null vector of the scaled Jacobian at the sphere at its threshold, a unit tangent."""
    system = SteadySystem(p, n)
    jacobian = system.jacobian(homogeneous_unknowns(p, n), np.zeros(0)) * system.scale
    size, k = jacobian.shape[0], 2 * n  # the coefficient of cos(x) in c
    bordered = np.zeros((size + 1, size + 1))
    bordered[:size, :size], bordered[size, k] = jacobian, 1.0
    bordered[2 * n : 3 * n, size] = np.cos(grid(n).x)
    found = solve(bordered, np.append(np.zeros(size), 1.0))[:size]
    towards = np.sign(np.sum(found[2 * n - 1 : 3 * n - 1]))  # more filaments at the pole x = 0
    return towards * found / np.sqrt(np.sum(found[:-4] ** 2))


def _at_speed(z: Array, target: Array) -> Lane:
    """Lanes at the v_p0 asked for, with nothing to go back to."""
    zero = np.zeros(len(z))
    none = np.zeros_like(z)
    return Lane(
        z=z, q=target, z0=z, q0=target, z_tangent=none, q_tangent=zero, step=zero,
        count=zero.astype(int), total=zero.astype(int), last=zero,
        doing=zero.astype(int) + AT_SPEED, alone=zero == 0,
    )  # fmt: skip


def _lanes(lane: Lane, cells: Array) -> Lane:
    return Lane(*(np.array(x[cells]) for x in lane))


def _some(cells: Cells, which: Array) -> Cells:
    numbers = {name: value[which] for name, value in cells.numbers.items()}
    return Cells(numbers, *(x[which] for x in cells[1:]))
