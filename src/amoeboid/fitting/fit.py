"""Parameters of a cell from measured profiles and numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.fitting.diagnosis import problems, undetermined
from amoeboid.fitting.followed import DIFFERENCE, FollowedState
from amoeboid.fitting.measurements import Measurements, measurements
from amoeboid.fitting.problem import Point, Problem, solved, targets_of
from amoeboid.fitting.result import Fit
from amoeboid.fitting.synthetic import polarized_state
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.numerics.least_squares import Minimum
from amoeboid.studies.columns import physical_number, text, value_of
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput, refuse_unknown

FRONT, REAR, UNKNOWN = "front", "rear", "unknown"
POLES = (FRONT, REAR, UNKNOWN)

REACH = 1000.0
"""A parameter is sought within this factor of its start, if no bounds are given."""

SCATTER, SHORTER = 0.3, (1.0, 0.5, 0.25)
"""Standard deviation of the logarithms of further starts, and what is tried where none is there."""

SAME = 1e-2
"""Difference of chi2, relative or absolute, up to which two minima are one."""


@one_thread
def fit(
    data: Any,
    free: Iterable[str],
    start: Parameters | None = None,
    *,
    theta_from: str = FRONT,
    bounds: Mapping[str, Any] | None = None,
    starts: int = 3,
    seed: int = 0,
    watch: Watch = unwatched,
) -> Fit:
    """The parameters `free` of a polarized cell from measurements, by least squares.

    `data`: a CSV file, a dictionary of columns, a pandas.DataFrame (see `measurements`). `start`
    holds all other parameters and first guesses; without it the paper's cell is taken where the
    data have units, and else the paper's table. `theta_from`: the pole from which theta counts,
    "front" (low c), "rear" or "unknown" (both are tried). `bounds`: {name: (lowest, highest)},
    otherwise a factor of 1000 around the start. The search begins at `start` and, to find other
    minima, at `starts` - 1 random points around what it found, drawn with `seed`.

    Raises InvalidInput for data and names that are refused and for a start without a stable
    polarized steady state.

    >>> import amoeboid as am
    >>> profile = am.synthetic(am.Parameters(D=0.4, v_p0=6.0), {"u": 0.02})
    >>> found = am.fit(profile, ["v_p0"], am.Parameters(D=0.4, v_p0=5.8), starts=1)
    >>> found.interval("v_p0", 0.99).holds(6.0)
    True
    """
    found = measurements(data, theta_from)
    base = _base(found, start)
    names = _names(base, free)
    _check_options(theta_from, starts, seed)
    state = polarized_state(base, names)
    mirrors = (False, True) if theta_from == UNKNOWN else (False,)
    solutions = [
        _solution(found, base, names, state, bounds or {}, mirrored, starts, seed, watch)
        for mirrored in mirrors
    ]
    best = min(solutions, key=lambda one: one.chi2)
    if theta_from == UNKNOWN:
        best = _oriented(best, solutions, mirrored=best is solutions[1])
    best = replace(best, undetermined=undetermined(best))
    return replace(best, problems=problems(best))


def _base(data: Measurements, start: Parameters | None) -> Parameters:
    """The parameters to start from. Raises InvalidInput where units do not go together."""
    if start is None:
        return Parameters.physical() if data.physical else Parameters()
    refuse_no_parameters(start)
    if data.physical and start.units is None:
        raise InvalidInput(
            "start must have units because the data have, got plain numbers; use "
            "Parameters.physical(...) (--physical)"
        )
    plain = [q.name for q in data if q.dimension and not q.unit and q.dimension != "1"]
    if start.units is not None and plain:
        raise InvalidInput(
            f"{data.source}: {plain[0]} must have a unit because the parameters have; write it in "
            f"square brackets in the heading, such as {plain[0]} "
            f"[{'um/s' if plain[0] == 'u' else '1/um^2' if plain[0] == 'c' else '...'}]"
        )
    return start


def _names(p: Parameters, free: Iterable[str]) -> tuple[str, ...]:
    """The free parameters. Raises InvalidInput for unknown or doubled ones, and those at zero."""
    names = (free,) if isinstance(free, str) else tuple(free)
    if not names:
        raise InvalidInput("free must name at least one parameter, such as D or v_p0, got none")
    refuse_unknown(names, p.names, "parameter")
    for name in names:
        if names.count(name) > 1:
            raise InvalidInput(f"free must name each parameter once, got {name} twice")
        if p.value(name) == 0:
            raise InvalidInput(
                f"a free parameter must not start at 0 because it is varied by a factor, {name} "
                f"does; set {name} in start (--set {name}=...)"
            )
    return names


def _check_options(theta_from: Any, starts: Any, seed: Any) -> None:
    if theta_from not in POLES:
        raise InvalidInput(f"theta_from must be one of {', '.join(POLES)}, got {theta_from!r}")
    for name, value, least in (("starts", starts, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise InvalidInput(f"{name} must be a whole number >= {least}, got {value!r}")


def _solution(
    data: Measurements,
    base: Parameters,
    names: tuple[str, ...],
    state: FollowedState,
    bounds: Mapping[str, Any],
    mirrored: bool,
    starts: int,
    seed: int,
    watch: Watch,
) -> Fit:
    """The best of the minima found with theta as it is, or mirrored."""
    targets, factors, factor_names = targets_of(data, base, len(names), state, mirrored)
    unknowns = (*names, *factor_names)
    count = sum(target.values.size for target in targets)
    estimated = any(target.estimated for target in targets)
    if count < len(unknowns) + estimated:
        raise InvalidInput(
            f"data must hold at least {len(unknowns) + estimated} values for "
            f"{', '.join(unknowns)}{' and unknown errors' if estimated else ''}, got {count}; set "
            "fewer parameters free"
        )
    lower, upper = _bounds(base, names, bounds, len(factor_names))
    problem = Problem(base, names, targets, lower, upper)
    begin = Point(targets, np.append(np.zeros(len(names)), factors), state)
    with np.errstate(over="ignore"):
        if not np.isfinite(begin.chi2):
            raise InvalidInput(
                f"{data.source}: values must be within 150 orders of magnitude of the "
                "predictions, and errors not much smaller; check the units"
            )

    def shown(iteration: int, point: Point) -> None:
        p = point.state.solution.parameters
        task = f"fit, chi2 = {point.chi2:.4g}"
        value = physical_number(p, p.value(names[0]), p.dimension(names[0]))
        watch(Progress(task, names[0], value, point.state.solution.n, iteration))

    problem, best = solved(problem, begin, shown)
    others: list[float] = []
    generator = np.random.default_rng(seed)
    for _ in range(starts - 1):
        begin_there = _scattered(problem, best, generator)
        if begin_there is None:
            continue
        there = problem.minimum(begin_there, shown)
        a, b = there.point.chi2, best.point.chi2
        if abs(a - b) > SAME * max(1.0, min(a, b)):
            others.append(max(a, b))
        best = there if a < b else best
    problem, best = solved(problem, best.point, shown)
    return Fit(data, problem, best, unknowns, tuple(others))


def _scattered(
    problem: Problem, best: Minimum[Point], generator: np.random.Generator
) -> Point | None:
    """A random point around the best one where there is a state; None if none is found."""
    change = SCATTER * generator.standard_normal(best.point.y.size)
    for share in SHORTER:
        y = np.clip(best.point.y + share * change, problem.lower, problem.upper)
        point = problem.evaluated(y, best.point)
        if point is not None:
            return point
    return None


def _bounds(
    p: Parameters, names: tuple[str, ...], bounds: Mapping[str, Any], factors: int
) -> tuple[Array, Array]:
    """Lowest and highest y; factors have none. Raises InvalidInput."""
    refuse_unknown(bounds, names, "free parameter")
    lower = np.append(np.full(len(names), -np.log(REACH)), np.full(factors, -np.inf))
    upper = -lower
    for k, name in enumerate(names):
        if name not in bounds:
            upper[k] = min(upper[k], _highest(p, name))
            continue
        pair = bounds[name]
        if isinstance(pair, str) or np.size(pair) != 2:
            raise InvalidInput(f"the bounds of {name} must be two values, got {pair!r}")
        ratios = [value_of(p, name, end, f"bound of {name}") / p.value(name) for end in pair]
        if not 0 < ratios[0] < 1 < ratios[1]:
            raise InvalidInput(
                f"the bounds of {name} must enclose its start "
                f"{text(p, p.value(name), p.dimension(name))}, on the same side of 0, got "
                f"{pair[0]} and {pair[1]}; change the bounds or the start"
            )
        lower[k], upper[k] = np.log(ratios[0]), min(np.log(ratios[1]), _highest(p, name))
    return lower, upper


def _highest(p: Parameters, name: str) -> float:
    """The highest y of a parameter that has a largest value. Raises InvalidInput for a start there.

    Derivatives need a neighbor beyond each state.
    """
    declared = Parameters.__dataclass_fields__.get(name)
    largest = None if declared is None else declared.metadata.get("bounds", {}).get("<=")
    if largest is None:
        return np.inf
    highest = float(np.log(largest / p.value(name))) - 2 * DIFFERENCE
    if highest <= 0:
        raise InvalidInput(
            f"a free parameter must start below its largest value, {largest:g} of {name}, got "
            f"{p.value(name):g}; start lower, or do not fit it"
        )
    return highest


def _oriented(best: Fit, solutions: list[Fit], mirrored: bool) -> Fit:
    """The better one of both orientations, with the difference of chi2."""
    difference = max(one.chi2 for one in solutions) - best.chi2
    pole = REAR if mirrored else FRONT
    return replace(best, orientation=(pole, difference))
