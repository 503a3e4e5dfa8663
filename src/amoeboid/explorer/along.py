"""A branch between its computed points: curves to draw, and exact states at any value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.steady import homogeneous, steady_state
from amoeboid.axisymmetric.unknowns import resampled
from amoeboid.studies.branch import Branch
from amoeboid.studies.states import SteadyState, steady_states
from amoeboid.validation import InvalidInput

BETWEEN = 6
"""Points of a curve from one computed point to the next."""

NEIGHBORS = 4
"""Points that an interpolation is made from: its error is of fourth order in their distance."""

TRIALS = 32


@dataclass(frozen=True)
class Curve:
    """A stretch of a branch that is stable, or unstable, all along.

    `x` are values of the parameter, `y` observables by name, in the units of the solver.
    """

    stable: bool
    x: Array
    y: dict[str, Array]


def curves(branch: Branch, names: Sequence[str]) -> list[Curve]:
    """The branch as smooth curves, cut where a mode is neutral."""
    found = []
    special = (*branch.folds, *branch.bifurcations)
    for k, (piece, lengths) in enumerate(zip(branch.pieces, branch.lengths, strict=True)):
        cuts = sorted(s.length for s in special if s.piece == k)
        points = sorted(
            [
                *zip(lengths, piece, strict=True),
                *((s.length, s.state) for s in special if s.piece == k),
            ],
            key=lambda point: point[0],
        )
        points = [*_origin(branch, points), *points]
        apart = [points[0]] + [b for a, b in pairwise(points) if b[0] > a[0]]
        length = np.array([s for s, _ in apart])
        x = np.array([state.parameters.value(branch.name) for _, state in apart])
        y = {name: np.array([state.number(name) for _, state in apart]) for name in names}
        ends = [length[0], *[s for s in cuts if length[0] < s < length[-1]], length[-1]]
        for begin, end in pairwise(ends):
            inside = [st for s, st in zip(lengths, piece, strict=True) if begin <= s <= end]
            if end > begin and inside:
                fine = _fine(length, begin, end)
                found.append(
                    Curve(
                        inside[len(inside) // 2].stable,
                        _interpolated(length, x, fine),
                        {name: _interpolated(length, values, fine) for name, values in y.items()},
                    )
                )
    return found


def _origin(branch: Branch, points: Sequence[tuple[float, Any]]) -> list[tuple[float, Any]]:
    """The sphere from which a piece leaves, before its points, if it leaves one.

    Its place is where the speed, which grows in proportion to the length at first, is 0.
    """
    if not branch.origins or len(points) < 2:
        return []
    (first, near), (second, next_one) = points[:2]
    speeds = [state.number("max_retrograde_speed") for state in (near, next_one)]
    x = [state.parameters.value(branch.name) for state in (near, next_one)]
    origin = min(branch.origins, key=lambda value: abs(value - x[0]))
    if not 0.0 < speeds[0] < speeds[1] or abs(origin - x[0]) > abs(x[1] - x[0]):
        return []
    before = (second - first) * speeds[0] / (speeds[1] - speeds[0])
    sphere = SteadyState(homogeneous(branch.parameters.replace(**{branch.name: origin})))
    return [(first - before, sphere)]


def states_at(branch: Branch, value: float) -> tuple[list[SteadyState], list[str]]:
    """The steady states of a branch at a value of its parameter, slowest first, and problems.

    Newton's method starts from the polynomial through the states nearby.
    """
    p = branch.parameters.replace(**{branch.name: value})
    found: list[SteadyState] = []
    problems: list[str] = []
    for piece, lengths in zip(branch.pieces, branch.lengths, strict=True):
        values = np.array([state.parameters.value(branch.name) for state in piece])
        for guess in _guesses(piece, np.array(lengths), values, value):
            state = SteadyState(steady_state(p, guess))
            if not state.solution.converged:
                problems.append(f"a state was not found: {state.solution.message}")
            elif not any(_same(state, other) for other in found):
                found.append(state)
    if problems:  # the search that follows every branch again takes longer, and finds them
        searched = steady_states(p, (1,))
        return [s for s in searched if not _at_rest(s)], list(searched.problems)
    return sorted(found, key=lambda s: s.number("max_retrograde_speed")), problems


def _guesses(piece: Sequence[Any], lengths: Array, values: Array, value: float) -> list[Any]:
    """States (not converged) near where the branch passes a value."""
    found = []
    for k in range(len(piece) - 1):
        first = max(0, min(k - 1, len(piece) - NEIGHBORS))
        near = slice(first, first + NEIGHBORS)
        s = np.linspace(lengths[k], lengths[k + 1], TRIALS)
        off = _polynomial(lengths[near], values[near], s) - value
        for j in np.flatnonzero((off[:-1] <= 0) != (off[1:] <= 0)):
            here = s[j] - off[j] * (s[j + 1] - s[j]) / (off[j + 1] - off[j])
            states = [state.solution for state in piece[near]]
            n = max(state.n for state in states)
            rows = np.array([resampled(state.x, state.n, n) for state in states])
            x = _polynomial(lengths[near], rows, np.array([here]))[0]
            found.append(replace(states[0], n=n, x=x))
    return found


def _polynomial(nodes: Array, values: Array, s: Array) -> Array:
    """The polynomial through values (N, ...) at nodes (N,), at s (S,)."""
    total: Any = 0.0
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        weight = np.prod((s[:, None] - others) / (node - others), axis=1)
        total = total + np.multiply.outer(weight, values[i])
    return np.asarray(total)


def _interpolated(length: Array, values: Array, fine: Array) -> Array:
    """A smooth curve through points: on each interval the polynomial through the nearest four."""
    found = np.empty(len(fine))
    interval = np.clip(np.searchsorted(length, fine, side="right") - 1, 0, len(length) - 2)
    for k in np.unique(interval):
        first = max(0, min(int(k) - 1, len(length) - NEIGHBORS))
        near = slice(first, first + NEIGHBORS)
        found[interval == k] = _polynomial(length[near], values[near], fine[interval == k])
    return found


def _fine(length: Array, begin: float, end: float) -> Array:
    knots = np.concatenate([[begin], length[(length > begin) & (length < end)], [end]])
    parts = [np.linspace(a, b, BETWEEN, endpoint=False) for a, b in pairwise(knots)]
    return np.append(np.concatenate(parts), end)


def _same(a: SteadyState, b: SteadyState) -> bool:
    speeds = [s.number("max_retrograde_speed") for s in (a, b)]
    return bool(abs(speeds[0] - speeds[1]) < 1e-7 * max(map(abs, speeds)))


def _at_rest(state: SteadyState) -> bool:
    p = state.parameters
    return state.number("max_retrograde_speed") < 1e-9 * p.R0 * p.rate


def nearest_window(p: Any, threshold: float | None) -> float:
    """The end of the window in v_p0 that shows the branch and the present point.

    It does not change while v_p0 does, as long as v_p0 stays inside. Raises InvalidInput where
    nothing tells how far to go.
    """
    end = 1.5 * threshold if threshold else 2.0 * p.v_p0
    if not end > 0:
        raise InvalidInput("v_p0 must be > 0 where the cell has no threshold, got 0; raise it")
    while p.v_p0 > 0.95 * end:
        end *= 1.5
    return float(f"{end:.2g}")
