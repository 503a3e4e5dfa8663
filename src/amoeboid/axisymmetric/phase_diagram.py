"""Phase diagram in v_p0 and one other parameter: where the cell rests, polarizes, or may do both.

The threshold and the fold are the edges of the bistable region; they meet where the bifurcation
turns from super- to subcritical.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.axisymmetric.branches import interpolated_state
from amoeboid.axisymmetric.criticality import critical_values
from amoeboid.axisymmetric.onset import departure, onset_speed
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.axisymmetric.stability import count_unstable, growth_rates, unstable_modes
from amoeboid.axisymmetric.steady import SteadyState, SteadySystem, homogeneous
from amoeboid.numerics.continuation import Options, Point, Stalled, follow, through
from amoeboid.numerics.newton import newton
from amoeboid.numerics.singular import fold_system
from amoeboid.parameters import Parameters
from amoeboid.validation import InvalidInput

Array = NDArray[Any]

REST, POLARIZED, BISTABLE, NEITHER, UNRESOLVED = range(5)
AT_TIP = 1e-3
"""A fold this near the threshold, relatively, lies at the tip of the bistable region."""
REGIONS = ("rest", "polarized", "bistable", "neither stable", "unresolved")


@dataclass(frozen=True, eq=False)
class Column:
    """One value of the other parameter: threshold, folds and what is stable at every v_p0.

    `regions` (rows,) indexes REGIONS; `flow` (rows,) is the maximal retrograde speed of the
    fastest stable polarized state, 0 where there is none. `problem` says what stopped the branch
    before it passed all of `speeds`, if anything did.
    """

    value: float
    threshold: float | None
    folds: tuple[Point, ...]
    regions: Array
    flow: Array
    problem: str = ""


@dataclass(frozen=True, eq=False)
class PhaseDiagram:
    """Regions and flow (rows of v_p0, columns of the other parameter) with their edges.

    `fold_line` holds (value, v_p0) along the curve of folds, `tips` the points (value, v_p0) where
    it meets the threshold. `problems` says what could not be followed to its end.
    """

    name: str
    values: Array
    speeds: Array
    columns: tuple[Column, ...]
    fold_line: tuple[tuple[float, float], ...]
    tips: tuple[tuple[float, float], ...]
    problems: tuple[str, ...] = ()

    @property
    def regions(self) -> Array:
        """Indices into REGIONS, shape (rows, columns)."""
        return np.column_stack([c.regions for c in self.columns])

    @property
    def flow(self) -> Array:
        """Maximal retrograde speed of the stable polarized state, shape (rows, columns)."""
        return np.column_stack([c.flow for c in self.columns])


def phase_columns(p: Parameters, name: str, values: Array, speeds: Array) -> Iterator[Column]:
    """The columns of a phase diagram one by one, so that progress can be shown.

    Raises InvalidInput for a `name` that is v_p0 or no number, or speeds that do not ascend.
    """
    if name == "v_p0":
        raise InvalidInput("the parameter beside v_p0 must be another one, got 'v_p0'")
    for label, axis in ((name, values), ("v_p0", speeds)):
        if axis.size < 2 or np.any(np.diff(axis) <= 0):
            raise InvalidInput(f"the values of {label} must ascend and be two or more")
    for value in values:
        yield phase_column(p.replace(**{name: float(value)}), float(value), speeds)


def phase_column(p: Parameters, value: float, speeds: Array) -> Column:
    """What is stable at each v_p0 of `speeds`, from one polarized branch."""
    resting = np.array([_rests(p.replace(v_p0=float(v))) for v in speeds])
    threshold = onset_speed(p)
    if threshold is None:
        return Column(value, None, (), np.where(resting, REST, NEITHER), np.zeros(speeds.size))
    points, folds, problem = _polarized_branch(p, threshold, float(speeds[-1]))
    # a branch that stops on its way down hides the faster states at every v_p0
    hidden = not points or points[-1].parameter_tangent < 0
    flow, unresolved = np.zeros(speeds.size), np.zeros(speeds.size, dtype=bool)
    for row, v in enumerate(speeds):
        state = _fastest(p.replace(v_p0=float(v)), points)
        beyond = problem != "" and (hidden or v > points[-1].parameter)
        if beyond or (state is not None and not state.converged):
            unresolved[row] = True
        elif state is not None and not any(unstable_modes(state).values()):
            flow[row] = state.max_retrograde_speed
    regions = np.where(
        flow > 0, np.where(resting, BISTABLE, POLARIZED), np.where(resting, REST, NEITHER)
    )
    regions = np.where(unresolved, UNRESOLVED, regions)
    return Column(value, threshold, folds, regions, flow, problem)


def _rests(p: Parameters) -> bool:
    """Whether the homogeneous sphere is stable; its growth rates do not depend on m."""
    return count_unstable(growth_rates(homogeneous(p, 4), 0, 8), p) == 0


def _polarized_branch(
    p: Parameters, threshold: float, high: float
) -> tuple[list[Point], tuple[Point, ...], str]:
    """Points and folds of the branch, and what stopped it before it rose beyond `high`."""
    options = Options(parameter_scale=threshold, max_step=0.4, angle=0.2, max_points=200)
    points: list[Point] = []
    folds = []
    try:
        points.append(departure(p, "v_p0", threshold, options))
        for point in follow(points[0], options):
            if point.fold:
                folds.append(point)
                continue
            points.append(point)
            if point.parameter > max(high, threshold) or point.parameter <= 0:
                return points, tuple(folds), ""
    except (Stalled, InvalidInput) as stop:
        return points, tuple(folds), str(stop)
    return points, tuple(folds), f"not finished after {options.max_points} points"


def _fastest(p: Parameters, points: list[Point]) -> SteadyState | None:
    """The last crossing of p.v_p0 along the branch, beyond its fold; None if it never crosses.

    Look at `converged`: Newton's method may fail at a crossing.
    """
    for a, b in zip(points[-2::-1], points[:0:-1], strict=True):
        if min(a.parameter, b.parameter) <= p.v_p0 <= max(a.parameter, b.parameter):
            return interpolated_state(p, a, b)
    return None


def fold_line(
    p: Parameters, name: str, values: Array, column: Column, watch: Watch = unwatched
) -> tuple[list[tuple[float, float]], list[str]]:
    """(value, v_p0) along the curve of folds through the first fold of a column, both ways.

    The second entry says what stopped it elsewhere than at one of its ends, if anything did.

    Two-parameter continuation; it ends at the limits of `values` or where the fold meets the
    threshold, its amplitude vanishing.
    """
    fold = column.folds[0]
    n = (fold.x.size - 3) // 3
    at = p.replace(**{name: column.value, "v_p0": fold.parameter})
    steady = SteadySystem(at, n, ("v_p0", name))
    system, start = fold_system(steady, fold.x, fold.x_tangent, fold.parameter)
    q = np.array([column.value])
    found = newton(
        lambda y: system.residual(y, q),
        lambda y: system.residual_and_jacobian(y, q),
        start,
        scale=system.scale,
    )
    if not found.converged:
        return [], [f"the fold at {name} = {column.value:.6g} was not found again"]
    options = Options(parameter_scale=float(np.ptp(values)), max_step=0.1, max_points=80)
    line = [(column.value, float(found.x[-1]))]
    problems = []
    for direction in (1.0, -1.0):
        half: list[tuple[float, float]] = []
        try:
            begin = through(system, found.x, column.value, direction, options)
            for count, point in enumerate(follow(begin, options), 1):
                watch(Progress("fold line", name, point.parameter, n, count))
                turned = point.fold or point.parameter_tangent * direction < 0
                if turned or not values[0] <= point.parameter <= values[-1]:
                    break
                half.append((point.parameter, float(point.x[-1])))
            else:
                problems.append(f"not finished after {options.max_points} points")
        except (Stalled, InvalidInput) as stop:
            if not _at_tip(p, name, half or line):
                problems.append(str(stop))
        line = line + half if direction > 0 else half[::-1] + line
    return line, problems


def _at_tip(p: Parameters, name: str, line: list[tuple[float, float]]) -> bool:
    """Whether the line of folds has come to the threshold."""
    value, speed = line[-1]
    threshold = onset_speed(p.replace(**{name: value}))
    return threshold is not None and abs(speed - threshold) < AT_TIP * threshold


def phase_diagram(
    p: Parameters,
    name: str,
    values: Array,
    speeds: Array,
    columns: tuple[Column, ...],
    watch: Watch = unwatched,
) -> PhaseDiagram:
    """The diagram of finished columns, with its fold line and the tips of the bistable region."""
    folded = [c for c in columns if c.folds]
    line: list[tuple[float, float]] = []
    problems = [f"branch at {name} = {c.value:.6g}: {c.problem}" for c in columns if c.problem]
    if folded:
        line, stops = fold_line(p, name, values, max(folded, key=_depth), watch)
        problems += [f"line of folds: {stop}" for stop in stops]
    tips = []
    for value in critical_values(p, name, list(np.linspace(values[0], values[-1], 9))):
        threshold = onset_speed(p.replace(**{name: value}))
        if threshold is not None:
            tips.append((value, threshold))
    return PhaseDiagram(name, values, speeds, columns, tuple(line), tuple(tips), tuple(problems))


def _depth(column: Column) -> float:
    """How far the fold lies below the threshold: the deepest is the safest to start from."""
    return (column.threshold or 0.0) - column.folds[0].parameter
