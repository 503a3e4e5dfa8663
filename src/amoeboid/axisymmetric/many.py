"""Polarized steady states at many parameter points: how lanes are started, filled and judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric import lanes
from amoeboid.axisymmetric.lanes import FOUND, NONE, OUTSIDE, STALLED, Cells, Problem
from amoeboid.axisymmetric.steady import homogeneous_unknowns
from amoeboid.axisymmetric.system import FRICTION, OPTIONAL, STRONG, Magnitudes, unknown_counts
from amoeboid.axisymmetric.unknowns import resampled
from amoeboid.closed_forms.linear import critical_slope, critical_speed
from amoeboid.closed_forms.modes import flow_response
from amoeboid.closed_forms.points import Points, points
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
MIN_SEEDS, SHARE_OF_SEEDS, MAX_SEEDS = 32, 0.05, 1000
"""Cells that are followed from the threshold; the others start from the nearest that is known."""
GROWTH = 8
"""Cells that start from known ones at a time, as a multiple of those."""
Told = Callable[[int, int], None]
"""Called with the number of cells that are done, and of all."""


@dataclass(frozen=True, eq=False)
class Found:
    """Number of modes n, status and Newton steps of every cell (cells,), and its unknowns.

    `x` has an array (cells with n modes, 3 n + 3) for every n, `row` (cells,) where in it.
    """

    n: Array
    x: dict[int, Array]
    row: Array
    status: Array
    steps: Array

    def unknowns(self, k: int) -> Array:
        """Those of the cell k."""
        return np.asarray(self.x[int(self.n[k])][self.row[k]])


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

    @cached_property
    def magnitudes(self) -> Array:
        """Typical magnitude of each kind of unknown (cells, 7)."""
        return Magnitudes.of(self.of).by_unknown(self.of)

    def scale(self, n: int, cells: Array) -> Array:
        """Typical magnitude of each unknown of these cells (cells, 3 n + 3)."""
        return np.repeat(self.magnitudes[cells], unknown_counts(n), axis=1)

    @cached_property
    def cells(self) -> Cells:
        """What the lanes need of all cells."""
        numbers = {name: value[:, None] for name, value in self.numbers.items() if name != "v_p0"}
        by_equation = Magnitudes.of(self.of).by_equation(self.of)
        target = self.numbers["v_p0"] / self.threshold
        return Cells(
            numbers, by_equation, self.magnitudes, self._sphere(), self._departure(), target,
            self.threshold,
        )  # fmt: skip

    def _sphere(self) -> Array:
        speed = np.where(np.isfinite(self.threshold), self.threshold, self.numbers["v_p0"])
        x = homogeneous_unknowns(self.of.at_speed(speed), 1)[:, 1:4]
        return np.asarray(x / self.magnitudes[:, 2:5])

    def _departure(self) -> Array:
        """Flow and concentration of the critical mode, more filaments at the pole x = 0."""
        p = self.of
        with np.errstate(divide="ignore", invalid="ignore"):  # no threshold, never followed
            flow = flow_response(p, 1) * critical_slope(p) / self.magnitudes[:, 1]
            mode = np.stack(np.broadcast_arrays(flow, 1.0 / self.magnitudes[:, 2]), axis=1)
            return np.asarray(mode / np.sqrt(np.sum(mode**2, axis=1, keepdims=True)))


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

    `guess` (n, x (3 n + 3,)): a state that all start from, instead of the threshold. `chunk` is the
    number of lanes, by default one that suits the device.
    """
    jax = lanes.jax()
    with jax.enable_x64(True):
        if chunk is None:
            chunk = CHUNK_ON_CPU if jax.default_backend() == "cpu" else CHUNK
        return _Search(Table.made(p), modes, max_modes, chunk, told).done(guess)


class _Search:
    """All cells, what is known of each, and the scaled states: row `row` of z[n] (..., 3 n + 3)."""

    def __init__(self, table: Table, modes: int, max_modes: int, chunk: int, told: Told) -> None:
        self.table, self.modes, self.max_modes = table, modes, max_modes
        self.chunk, self.told = min(chunk, len(table)), told
        count = len(table)
        self.n = np.full(count, modes)
        self.row = np.arange(count)
        self.z = {modes: np.zeros((count, 3 * modes + 3))}
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
            everyone = np.arange(len(self.table))
            x = resampled(guess[1], guess[0], self.modes)
            self._corrected(everyone, x / self.table.scale(self.modes, everyone))
        self._refined()
        states = {}
        for n, z in self.z.items():
            cells = np.flatnonzero(self.n == n)
            states[n] = z[self.row[cells]] * self.table.scale(n, cells)
            self.row[cells] = np.arange(cells.size)
        return Found(self.n, states, self.row, self.status, self.steps)

    def _tell(self, count: int, kept: bool = True) -> None:
        self.told(self.finished + count, len(self.table))
        self.finished += count * kept

    def _from_threshold_and_neighbors(self, cells: Array) -> None:
        count = min(max(MIN_SEEDS, int(SHARE_OF_SEEDS * cells.size)), MAX_SEEDS)
        order = np.random.default_rng(0).permutation(cells)
        self._followed(np.sort(order[:count]))
        done, lost = count, []
        places = self._places()
        while done < order.size:
            known = np.sort(order[:done])
            known = known[self.status[known] == CONVERGED]
            end = done + max(GROWTH * known.size, self.chunk)
            next_ones = np.sort(order[done:end])
            if known.size:
                nearest = np.asarray(lanes.nearest()(places[next_ones], places[known]))
                guesses = self.z[self.modes][known[nearest]]
                next_ones = next_ones[self._corrected(next_ones, guesses)]
            lost.append(next_ones)
            done = end
        if lost:
            self._followed(np.sort(np.concatenate(lost)))

    def _places(self) -> Array:
        """Where the cells are among the parameters, in units of their spread (cells, axes)."""
        columns = [v / np.ptp(v) for v in self.table.numbers.values() if np.ptp(v) > 0]
        return np.stack([*columns, self.table.cells.target], axis=1)

    def _followed(self, cells: Array) -> None:
        """Along the branch from the threshold of each cell."""
        if cells.size:
            self._keep(cells, *self._run(cells, np.zeros((cells.size, 3 * self.modes + 3)), True))

    def _corrected(self, cells: Array, z: Array) -> Array:
        """By Newton's method from a guess; which cells did not get there."""
        found, doing, total = self._run(cells, z, False)
        good = doing == FOUND
        self._keep(cells[good], found[good], doing[good], total[good])
        self.status[cells[~good]] = np.where(doing == NONE, SPHERE, STOPPED)[~good]
        self.steps[cells[~good]] += total[~good]
        return ~good

    def _refined(self) -> None:
        """States that are not resolved once more, with twice the modes each time."""
        n, cells = self.modes, np.flatnonzero(self.status == CONVERGED)
        while cells.size:
            cells = cells[self._unresolved(n, cells)]
            if 2 * n > self.max_modes or not cells.size:
                self.status[cells] = UNRESOLVED
                break
            guess = resampled(self.z[n][self.row[cells]], n, 2 * n)
            found = self._run(cells, guess, False, 2 * n)
            self.z[2 * n] = np.zeros_like(found[0])
            self.n[cells], self.row[cells] = 2 * n, np.arange(cells.size)
            self._keep(cells, *found)
            n *= 2
            cells = cells[self.status[cells] == CONVERGED]

    def _unresolved(self, n: int, cells: Array) -> Array:
        """Whether the continuous equations do not hold; marks cells where the law has no value."""
        judge, everything = lanes.checked(self._problem(n)), self.table.cells
        residual, lowest = np.zeros(cells.size), np.zeros(cells.size)
        for first in range(0, cells.size, self.chunk):
            part = np.resize(cells[first : first + self.chunk], self.chunk)  # of one size: compiled
            here = lanes.some(everything, part)
            found = judge(self.z[n][self.row[part]], here.target, here)
            for known, values in zip((residual, lowest), found, strict=True):
                known[first : first + self.chunk] = values[: cells.size - first]
        for relation in (self.table.of.law, self.table.of.stress):
            if relation.above is not None:
                self.status[cells[lowest <= relation.above]] = UNDEFINED
        return ~(residual <= STRONG) & (self.status[cells] == CONVERGED)

    def _problem(self, n: int) -> Problem:
        return Problem(n, self.table.of.law, self.table.of.stress, self.table.present)

    def _keep(self, cells: Array, z: Array, doing: Array, total: Array) -> None:
        ends = np.full(OUTSIDE + 1, STOPPED)
        ends[[FOUND, STALLED, NONE, OUTSIDE]] = CONVERGED, STOPPED, SPHERE, UNDEFINED
        self.status[cells] = ends[doing]
        self.steps[cells] += total
        self.z[(z.shape[1] - 3) // 3][self.row[cells]] = z

    def _run(
        self, cells: Array, z: Array, following: bool, n: int | None = None
    ) -> tuple[Array, Array, Array]:
        """Newton steps in all lanes until every cell is done: z, how it ended, and its steps."""
        n = n or self.modes
        problem = self._problem(n)
        step, refill = lanes.advance(problem), lanes.refilled(problem, following)
        these = lanes.on_device(lanes.some(self.table.cells, cells))
        work = lanes.emptied(problem, self.chunk, z)
        while True:
            work, here, numbers = refill(work, these)
            busy, begun, found = np.asarray(numbers).tolist()
            if n == self.modes:
                self._tell(begun - busy if following else found, kept=not busy)
            if not busy:
                break
            work = work._replace(lane=step(work.lane, here))
        return np.asarray(work.z), np.asarray(work.doing), np.asarray(work.total)
