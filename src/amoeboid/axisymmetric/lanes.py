"""The axisymmetric steady problem at many parameter points side by side, with JAX in float64.

The equations are those of `system`, recorded once; lanes differ only in their parameters. A lane
holds the scaled unknowns z = x/scale and q = v_p0/threshold, and does one Newton step at a time:
along the polarized branch from its threshold, by pseudo-arclength as in `numerics.continuation`,
or at the v_p0 that is asked for. Lanes that are done make room for others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from amoeboid.axisymmetric.spectral import grid
from amoeboid.axisymmetric.system import (
    FRICTION,
    equation_counts,
    recorded_equations,
    strong_units,
    unknown_counts,
)
from amoeboid.axisymmetric.unknowns import Fields, maps_of, unknown_count
from amoeboid.extras import needed
from amoeboid.model.parameters import ParameterPoint
from amoeboid.model.polymerization import Law
from amoeboid.model.stress import Stress
from amoeboid.numerics import lanes
from amoeboid.numerics.traced import Traced, untraced

FOLLOWING, AT_SPEED, FOUND, STALLED, NONE, OUTSIDE = range(6)
"""What a lane does, or how it ended: along the branch, at its v_p0, and see `ENDS`."""

FIRST_STEP, MIN_STEP, MAX_STEP = 0.05, 1e-5, 0.5
MAX_TURN = 0.3
"""Largest angle between the tangents at the ends of a step, in radians."""
MAX_NEWTON = 8
"""Newton steps to a point of the branch before the step is halved."""
MAX_STEPS = 400
"""Newton steps of a lane in all."""
NEAR, CLOSE, SMALL = 1e-7, 1e-9, 1e-7
"""Last Newton step at a point of the branch and at the end, and the residual there."""
UNPOLARIZED = 1e-6
"""First harmonic of c, in units of c0, up to which a state is the sphere."""
LONG = 10.0
"""A Newton step longer than this leads nowhere."""
PLACES_AT_A_TIME = 4096
"""Cells for which the nearest one is looked for at a time."""
SAMPLES = 64
"""Points of a step of the branch at which the value asked for is looked for."""


class Lane(NamedTuple):
    """The state of all lanes: the current point, the last one of the branch with its tangent.

    `z` (lanes, unknowns), `q` (lanes,); `step` is the distance to the point that is looked for,
    `count` the Newton steps to it so far and `total` those of the lane; `last` the length of the
    latest. `alone`: there is no branch to go back to.
    """

    z: Any
    q: Any
    z0: Any
    q0: Any
    z_tangent: Any
    q_tangent: Any
    step: Any
    count: Any
    total: Any
    last: Any
    doing: Any
    alone: Any


class Cells(NamedTuple):
    """What belongs to each cell: parameters (cells, 1), v_p0/threshold and the threshold (cells,).

    Typical magnitudes of the kinds of equations (cells, 5) and of unknowns (cells, 7). The scaled
    sphere at the threshold: c, length scale and tension (cells, 3). The scaled unit tangent of the
    branch that leaves it: u of sin(x) and c of cos(x) (cells, 2).
    """

    numbers: Mapping[str, Any]
    by_equation: Any
    by_unknown: Any
    sphere: Any
    departure: Any
    target: Any
    threshold: Any


class Work(NamedTuple):
    """The lanes, the cell in each (`here`; none: the number of cells), and all cells.

    Those from `waiting` on have not begun. `z` (cells, unknowns): where a cell starts at its v_p0
    as long as it waits, then where it ended; `doing` and `total` (cells,): how, and after how many
    Newton steps.
    """

    lane: Lane
    here: Any
    waiting: Any
    z: Any
    doing: Any
    total: Any


@dataclass(frozen=True)
class Problem:
    """What all lanes have in common. Raises InvalidInput where JAX is not installed."""

    n: int
    law: Law
    stress: Stress
    present: frozenset[str] = frozenset()
    """Names of `steady.OPTIONAL` that are not 0 in every lane."""

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return unknown_count(self.n)

    def residual(self, z: Any, q: Any, cells: Cells) -> Any:
        """Scaled residuals (lanes, equations)."""
        of = recorded_equations(self.n, self.present)
        inputs = self._inputs(z * self._scale(cells), q, cells, self.n)
        return lanes.residual(of, inputs, _jnp()) / self._row_scales(cells)

    def residual_and_jacobian(self, z: Any, q: Any, cells: Cells) -> tuple[Any, Any]:
        """The same with its derivatives to z."""
        of = recorded_equations(self.n, self.present)
        scale, row_scales = self._scale(cells), self._row_scales(cells)
        inputs = self._inputs(z * scale, q, cells, self.n)
        f, f_x = lanes.residual_and_jacobian(of, inputs, _jnp(), jax().lax.optimization_barrier)
        return f / row_scales, f_x * scale[:, None, :] / row_scales[:, :, None]

    def strong_residual(self, z: Any, q: Any, cells: Cells) -> Any:
        """That of `steady.strong_residual` (lanes,)."""
        jnp, n, m = _jnp(), self.n, 3 * self.n
        psi, u, c, scalars = jnp.split(
            z * self._scale(cells), [n - 1, 2 * n - 1, 3 * n - 1], axis=1
        )
        longer = [jnp.pad(a, ((0, 0), (0, m - n))) for a in (psi, u, c)]
        slack = 2 if self.present.isdisjoint(FRICTION) else 3
        x = jnp.concatenate([*longer, scalars.at[:, slack:].set(0.0)], axis=1)
        inputs = self._inputs(x, q, cells, m)
        found = lanes.residual(recorded_equations(m, self.present), inputs, jnp)
        f, p = inputs.fields(), inputs.point
        u, v_p, c, tau = (
            np.max(np.abs(field), axis=-1, keepdims=True)
            for field in (f.u, p.v_p(f.c), f.c, p.tau(f.c))
        )
        units = [untraced(unit) for unit in strong_units(u, v_p, c, tau, p)]
        sizes = _spread(jnp.concatenate(units, axis=1), equation_counts(m))
        return jnp.max(jnp.abs(found) / sizes, axis=1)

    def lowest(self, z: Any, cells: Cells) -> Any:
        """Lowest concentration of each lane at the points (lanes,)."""
        return _jnp().min(_fields(z * self._scale(cells), self.n)["c"], axis=1)

    def begun(self, z: Any, cells: Cells, following: bool) -> Lane:
        """Lanes along the branch from their thresholds, or at the v_p0 asked for from z."""
        jnp, zero = _jnp(), _jnp().zeros_like(cells.target)
        count, none = zero.astype(int), jnp.zeros_like(z)
        if not following:
            return Lane(
                z=z, q=cells.target, z0=z, q0=cells.target, z_tangent=none, q_tangent=zero,
                step=zero, count=count, total=count, last=zero, doing=count + AT_SPEED,
                alone=zero == 0,
            )  # fmt: skip
        n = self.n
        sphere = none.at[:, jnp.array([2 * n - 1, 3 * n - 1, 3 * n])].set(cells.sphere)
        tangent = none.at[:, jnp.array([n - 1, 2 * n])].set(cells.departure)
        return Lane(
            z=sphere + FIRST_STEP * tangent, q=zero + 1.0, z0=sphere, q0=zero + 1.0,
            z_tangent=tangent, q_tangent=zero, step=zero + FIRST_STEP, count=count, total=count,
            last=zero, doing=count + FOLLOWING, alone=zero > 0,
        )  # fmt: skip

    def _scale(self, cells: Cells) -> Any:
        return _spread(cells.by_unknown, unknown_counts(self.n))

    def _row_scales(self, cells: Cells) -> Any:
        return _spread(cells.by_equation, equation_counts(self.n))

    def _inputs(self, x: Any, q: Any, cells: Cells, n: int) -> _Inputs:
        numbers = {**cells.numbers, "v_p0": (q * cells.threshold)[:, None]}
        traced = {name: Traced(value, _jnp()) for name, value in numbers.items()}
        relations = {
            kind: relation.with_values(
                {k.partition(".")[2]: v for k, v in traced.items() if k.startswith(kind + ".")}
            )
            for kind, relation in (("law", self.law), ("stress", self.stress))
        }
        return _Inputs(
            _fields(x, n), ParameterPoint({k: v for k, v in traced.items() if "." not in k} |
                                          relations)
        )  # fmt: skip


class _Inputs:
    """What a recorded program is given: fields and parameters by their names."""

    def __init__(self, given: dict[str, Any], point: ParameterPoint) -> None:
        self._given, self.point = given, point

    def fields(self) -> Fields:
        """The fields, for functions of NumPy."""
        return Fields(**{f.name: Traced(self._given[f.name], _jnp()) for f in fields(Fields)})

    def __getitem__(self, name: str) -> Any:
        if name in self._given:
            return self._given[name]
        found = getattr(self.point, name)
        return self._function(found) if callable(found) else untraced(found)

    @staticmethod
    def _function(derivatives: Callable[..., Any]) -> Callable[[Any, int], tuple[Any, ...]]:
        def called(c: Any, order: int) -> tuple[Any, ...]:
            found = derivatives(Traced(c, _jnp()), order)
            return tuple(_jnp().broadcast_to(untraced(value), c.shape) for value in found)

        return called


def _fields(x: Any, n: int) -> dict[str, Any]:
    """The unknowns at the points, (lanes, n) or (lanes, 1), as `unknowns.fields_of`."""
    found = {
        name: x[:, first : first + matrix.shape[1]] @ matrix.T
        for name, (first, matrix) in maps_of(n).items()
    }
    return found | {"psi": found["psi"] + grid(n).x, "psi_slope": found["psi_slope"] + 1.0}


def _spread(each: Any, counts: list[int]) -> Any:
    """Every column as many times as it counts."""
    jnp, lanes_ = _jnp(), each.shape[0]
    columns = [jnp.broadcast_to(each[:, k : k + 1], (lanes_, m)) for k, m in enumerate(counts)]
    return jnp.concatenate(columns, axis=1)


def jax() -> Any:
    """The module of JAX. Raises InvalidInput where it is not installed."""
    return needed("jax", "steady states of many cells side by side need")


def _jnp() -> Any:
    import jax.numpy as jnp

    return jnp


@lru_cache(maxsize=16)
def advance(problem: Problem) -> Callable[[Lane, Cells], Lane]:
    """A compiled function that makes a Newton step in every lane that is not done.

    One step: a loop of several in JAX took three times as long a step on a processor.
    """
    return jax().jit(lambda lane, cells: _stepped(problem, lane, cells))


@lru_cache(maxsize=16)
def refilled(problem: Problem, following: bool) -> Callable[[Work, Cells], tuple[Work, Cells, Any]]:
    """A compiled function that takes lanes that are done out and gives them the next cells.

    Besides the work it returns what belongs to the lanes, and three numbers: the lanes that are
    busy, the cells that have begun, and those of them that were FOUND. The work that it is given is
    used up.
    """
    return jax().jit(lambda work, cells: _refilled(problem, following, work, cells),
                     donate_argnums=0)  # fmt: skip


@lru_cache(maxsize=16)
def checked(problem: Problem) -> Callable[[Any, Any, Cells], tuple[Any, Any]]:
    """A compiled function: strong residual and lowest concentration of each lane."""
    return jax().jit(
        lambda z, q, cells: (
            problem.strong_residual(z, q, cells),
            problem.lowest(z, cells),
        )
    )


@lru_cache(maxsize=1)
def nearest() -> Callable[[Any, Any], Any]:
    """A compiled function: for each place (cells, axes) the index of the nearest known one."""
    jnp = _jnp()

    def of_one(place: Any, known: Any) -> Any:
        return jnp.argmin(jnp.sum((known - place) ** 2, axis=1))

    return jax().jit(
        lambda places, known: jax().lax.map(
            lambda place: of_one(place, known), places, batch_size=PLACES_AT_A_TIME
        )
    )


def emptied(problem: Problem, lanes_: int, z: Any) -> Work:
    """No lane with a cell, and all cells waiting; `z` (cells, unknowns) is where they start."""
    jnp, count = _jnp(), z.shape[0]
    whole, none = jnp.zeros(lanes_, dtype=int), jnp.zeros((lanes_, problem.size))
    numbers = jnp.zeros(lanes_)
    lane = Lane(
        z=none, q=numbers, z0=none, q0=numbers, z_tangent=none, q_tangent=numbers, step=numbers,
        count=whole, total=whole, last=numbers, doing=whole + OUTSIDE, alone=whole > 0,
    )  # fmt: skip
    begun, doing, total = jnp.array(0), jnp.zeros(count, dtype=int), jnp.zeros(count, dtype=int)
    # a copy of each, since the work is used up
    return jax().tree.map(jnp.copy, Work(lane, whole + count, begun, jnp.asarray(z), doing, total))


def on_device(cells: Cells) -> Cells:
    """The same where JAX computes."""
    return jax().tree.map(_jnp().asarray, cells)


def some(cells: Cells, which: Any) -> Cells:
    """What belongs to these cells."""
    return jax().tree.map(lambda x: x[which], cells)


def _refilled(
    problem: Problem, following: bool, work: Work, cells: Cells
) -> tuple[Work, Cells, Any]:
    jnp, lane, count = _jnp(), work.lane, work.z.shape[0]
    vacant = lane.doing >= FOUND
    done = jnp.where(vacant, work.here, count)  # beyond the last: dropped
    z = work.z.at[done].set(lane.z, mode="drop")
    doing = work.doing.at[done].set(lane.doing, mode="drop")
    total = work.total.at[done].set(lane.total, mode="drop")
    following_ = work.waiting + jnp.cumsum(vacant) - 1
    here = jnp.where(vacant, jnp.minimum(following_, count), work.here)
    waiting = jnp.minimum(work.waiting + jnp.sum(vacant), count)
    at = jnp.minimum(here, count - 1)
    lanes_cells = some(cells, at)
    begun = problem.begun(z[at], lanes_cells, following)
    lane = _where(vacant & (here < count), begun, lane)
    numbers = jnp.array([jnp.sum(here < count), waiting, jnp.sum(doing == FOUND)])
    return Work(lane, here, waiting, z, doing, total), lanes_cells, numbers


def _weights(problem: Problem) -> Any:
    return np.append(np.ones(problem.size - 4), np.zeros(4))


def _bordered(f_z: Any, f_q: Any, row: Any) -> Any:
    jnp, lanes_ = _jnp(), f_z.shape[0]
    top = jnp.concatenate([f_z, f_q[:, :, None]], axis=2)
    return jnp.concatenate(
        [top, jnp.broadcast_to(row[:, None, :], (lanes_, 1, top.shape[2]))], axis=1
    )


def _stepped(problem: Problem, at: Lane, cells: Cells) -> Lane:
    """A Newton step and a chord step with its matrix in every lane, and what follows from them."""
    jnp, weights = _jnp(), _weights(problem)
    fixed = at.doing == AT_SPEED
    f, f_z = problem.residual_and_jacobian(at.z, at.q, cells)
    _, f_q = jax().jvp(lambda q: problem.residual(at.z, q, cells), (at.q,), (jnp.ones_like(at.q),))
    row, behind = _condition(problem, at, cells)
    solve = _factorized(_bordered(f_z, f_q, row))
    ahead = jnp.zeros((*f.shape[:1], problem.size + 1)).at[:, -1].set(1.0)
    solved = solve(jnp.stack([_joined(-f, -behind), ahead], axis=2))
    change, tangent = solved[:, :, 0], solved[:, :, 1]
    length = jnp.sqrt(jnp.mean(change**2, axis=1))
    good = jnp.isfinite(length) & (length < LONG)
    good &= (at.count < MAX_NEWTON) & ((at.count < 2) | (length < 2 * at.last))
    moved = at._replace(
        z=at.z + change[:, :-1], q=at.q + change[:, -1], count=at.count + 1, last=length
    )
    f = problem.residual(moved.z, moved.q, cells)
    chord = solve(_joined(-f, -_condition(problem, moved, cells)[1])[:, :, None])[:, :, 0]
    left = jnp.sqrt(jnp.mean(chord**2, axis=1))
    nearer = left < length  # not where Newton's method is still far away
    chord = jnp.where(nearer[:, None], chord, 0.0)
    moved = moved._replace(z=moved.z + chord[:, :-1], q=moved.q + chord[:, -1])
    small = nearer & (left <= jnp.where(fixed, CLOSE, NEAR))
    arrived = good & small & (~fixed | (jnp.sqrt(jnp.mean(f**2, axis=1)) <= SMALL))
    norm = jnp.sqrt(jnp.sum(weights * tangent[:, :-1] ** 2, axis=1) + tangent[:, -1] ** 2)
    tangent = tangent / norm[:, None]
    done = _where(arrived & fixed, _ended(problem, moved, tangent), moved)
    further = _further(problem, moved, tangent, cells)
    done = _where(arrived & ~fixed, further, done)
    done = _where(~good, _shortened(at), done)
    done = done._replace(total=at.total + 1)
    late = (done.total >= MAX_STEPS) & (done.doing < FOUND)
    done = done._replace(doing=jnp.where(late, STALLED, done.doing))
    return _where(at.doing >= FOUND, at, done)


def _condition(problem: Problem, at: Lane, cells: Cells) -> tuple[Any, Any]:
    """The last equation: that of the arc from the last point, or the v_p0 asked for.

    Its derivatives (lanes, unknowns + 1) and its residual (lanes,).
    """
    jnp, weights = _jnp(), _weights(problem)
    fixed = at.doing == AT_SPEED
    row = _joined(weights * at.z_tangent, at.q_tangent)
    only_q = jnp.zeros(problem.size + 1).at[-1].set(1.0)
    behind = jnp.sum(weights * at.z_tangent * (at.z - at.z0), axis=1)
    behind = behind + at.q_tangent * (at.q - at.q0) - at.step
    return jnp.where(fixed[:, None], only_q, row), jnp.where(fixed, at.q - cells.target, behind)


def _joined(z: Any, q: Any) -> Any:
    return _jnp().concatenate([z, q[:, None]], axis=1)


def _factorized(matrix: Any) -> Callable[[Any], Any]:
    """The solution of linear systems (lanes, size, columns) with these matrices."""
    jnp, linear = _jnp(), jax().lax.linalg
    factors, _, order = linear.lu(matrix)

    def solve(right: Any) -> Any:
        right = jnp.take_along_axis(right, order[:, :, None], axis=1)
        lower = {"left_side": True, "lower": True, "unit_diagonal": True}
        right = linear.triangular_solve(factors, right, **lower)
        return linear.triangular_solve(factors, right, left_side=True, lower=False)

    return solve


def _where(condition: Any, a: Lane, b: Lane) -> Lane:
    jnp = _jnp()
    return Lane(
        *(
            jnp.where(condition[:, None] if x.ndim > 1 else condition, x, y)
            for x, y in zip(a, b, strict=True)
        )
    )


def _ended(problem: Problem, moved: Lane, tangent: Any) -> Lane:
    """At the v_p0 asked for: polarization has to grow with v_p0 there, or it is no stable part.

    A lane that has come to the sphere goes back to the branch, if it has one.
    """
    jnp, k = _jnp(), 2 * problem.n
    rising = moved.z[:, k] * tangent[:, k] * jnp.sign(tangent[:, -1]) > 0
    polarized = jnp.abs(moved.z[:, k]) > UNPOLARIZED
    back = _shortened(moved)
    slid = jnp.where(moved.alone & ~polarized, NONE, back.doing)
    found = moved._replace(doing=jnp.full_like(moved.doing, FOUND))
    return _where(rising & polarized, found, back._replace(doing=slid))


def _shortened(at: Lane) -> Lane:
    """Back at the last point of the branch, with half the step."""
    jnp, half = _jnp(), at.step / 2
    lost = at.alone | (half < MIN_STEP)
    return at._replace(
        z=at.z0 + half[:, None] * at.z_tangent,
        q=at.q0 + half * at.q_tangent,
        step=half,
        count=jnp.zeros_like(at.count),
        doing=jnp.where(lost, STALLED, FOLLOWING),
    )


def _further(problem: Problem, moved: Lane, tangent: Any, cells: Cells) -> Lane:
    """From a new point of the branch on: to the v_p0 asked for if it lies behind, or a step."""
    jnp, weights = _jnp(), _weights(problem)
    z_tangent, q_tangent = tangent[:, :-1], tangent[:, -1]
    cosine = jnp.sum(weights * z_tangent * moved.z_tangent, axis=1) + q_tangent * moved.q_tangent
    turn = jnp.arccos(jnp.clip(cosine, -1.0, 1.0))
    s = np.linspace(0.0, 1.0, SAMPLES + 1)
    slopes = moved.step * moved.q_tangent, moved.step * q_tangent
    q = _cubic(s, *(x[:, None] for x in (moved.q0, moved.q, *slopes)))
    below = q < cells.target[:, None]
    crossing = below[:, :-1] & ~below[:, 1:]
    last = SAMPLES - 1 - jnp.argmax(crossing[:, ::-1], axis=1)
    passed = jnp.any(crossing, axis=1)
    before, after = (jnp.take_along_axis(q, (last + k)[:, None], axis=1)[:, 0] for k in (0, 1))
    share = last + (cells.target - before) / jnp.where(after > before, after - before, 1.0)
    share = (share / SAMPLES)[:, None]
    guess = _cubic(share, moved.z0, moved.z, moved.step[:, None] * moved.z_tangent,
                   moved.step[:, None] * z_tangent)  # fmt: skip
    beyond = (q_tangent > 0) & (moved.q >= cells.target) & ~passed
    longer = moved.step * jnp.clip(0.5 * MAX_TURN / jnp.maximum(turn, 1e-3), 0.5, 1.6)
    step = jnp.clip(longer, MIN_STEP, MAX_STEP)
    on = moved._replace(
        z0=moved.z, q0=moved.q, z_tangent=z_tangent, q_tangent=q_tangent, step=step,
        z=moved.z + step[:, None] * z_tangent, q=moved.q + step * q_tangent,
        count=jnp.zeros_like(moved.count), doing=jnp.where(beyond, NONE, FOLLOWING),
    )  # fmt: skip
    there = moved._replace(
        z=guess, q=cells.target, count=jnp.zeros_like(moved.count),
        doing=jnp.full_like(moved.doing, AT_SPEED),
    )  # fmt: skip
    return _where(turn > MAX_TURN, _shortened(moved), _where(passed, there, on))


def _cubic(s: Any, a: Any, b: Any, slope_a: Any, slope_b: Any) -> Any:
    """The cubic through values and slopes at s = 0 and 1."""
    rise = b - a
    return a + s * (slope_a + s * (3 * rise - 2 * slope_a - slope_b
                                   + s * (slope_a + slope_b - 2 * rise)))  # fmt: skip
