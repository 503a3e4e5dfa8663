"""Phase diagram in v_p0 and one other parameter: where the cell is at rest, polarized, or bistable.

The threshold and the fold are the edges of the bistable region; they meet where the bifurcation
turns from super- to subcritical.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.criticality import critical_values
from amoeboid.axisymmetric.onset import branch_tangent, onset_speed
from amoeboid.axisymmetric.paths import Path, asymmetry
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.axisymmetric.search import Rising
from amoeboid.axisymmetric.stability import are_stable_along
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.axisymmetric.unknowns import mode_count
from amoeboid.axisymmetric.window import Window
from amoeboid.closed_forms.linear import finite_pressure_rates, growth_rate
from amoeboid.closed_forms.points import points
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import Arc, arcs, at_value, on_one_system, unknowns_at
from amoeboid.numerics.branch_points import Options, Point, Stalled, through
from amoeboid.numerics.newton import newton
from amoeboid.numerics.singular import fold_system
from amoeboid.validation import InvalidInput

REST, POLARIZED, BISTABLE, NEITHER, UNRESOLVED = range(5)
AT_TIP = 1e-3
"""A fold this near the threshold, relatively, lies at the tip of the bistable region."""
ROUNDING = 100 * float(np.finfo(float).eps)
"""Error of the growth rates of the sphere in units of the fastest of them."""
ON_LINE = 1e-2
"""A fold this near a line of folds, relatively, lies on it; the line is straight between points."""
HIGHEST = 8
"""Highest mode of the sphere that decides whether it is at rest."""
REGIONS = ("rest", "polarized", "bistable", "neither stable", "unresolved")


@dataclass(frozen=True, eq=False)
class Column:
    """One value of the other parameter: threshold, folds and what is stable at every v_p0.

    `regions` (rows,) indexes REGIONS; `flow` (rows,) is the maximal retrograde speed of the
    fastest stable polarized state, 0 where there is none. `problem` says what stopped the branch
    before it passed all of `speeds`; empty if nothing did.
    """

    value: float
    threshold: float | None
    folds: tuple[Point, ...]
    regions: Array
    flow: Array
    problem: str = ""


@dataclass(frozen=True, eq=False)
class DiagramSolution:
    """Regions and flow (rows of v_p0, columns of the other parameter) with their edges.

    Each of `fold_lines` holds (value, v_p0) along a curve of folds, `tips` are the points
    (value, v_p0) where one meets the threshold. `problems` says what could not be followed to its
    end.
    """

    name: str
    values: Array
    speeds: Array
    columns: tuple[Column, ...]
    fold_lines: tuple[tuple[tuple[float, float], ...], ...]
    tips: tuple[tuple[float, float], ...]
    problems: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all branches and lines of folds were followed to their ends."""
        return not self.problems

    @property
    def threshold_line(self) -> tuple[tuple[float, float], ...]:
        """(value, v_p0) of the threshold in every column that has one."""
        return tuple((c.value, c.threshold) for c in self.columns if c.threshold is not None)

    @property
    def fold_line(self) -> tuple[tuple[float, float], ...]:
        """The points of all lines of folds, line after line."""
        return tuple(pair for line in self.fold_lines for pair in line)

    def __repr__(self) -> str:
        found = "complete" if self.complete else "incomplete"
        rows, columns = self.speeds.size, self.values.size
        counts = [f"{np.sum(self.regions == k)} {REGIONS[k]}" for k in np.unique(self.regions)]
        lines = [f"phase diagram in {self.name} and v_p0, {found}: {columns} x {rows} cells"]
        return "\n".join([*lines, ", ".join(counts), *(f"- {text}" for text in self.problems)])

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
        raise InvalidInput(
            "the second parameter must differ from v_p0, got 'v_p0'; choose another, such as D"
        )
    for label, axis in ((name, values), ("v_p0", speeds)):
        if axis.size < 2 or np.any(np.diff(axis) <= 0):
            raise InvalidInput(f"there must be at least two values of {label}, in ascending order")
    for value in values:
        yield phase_column(p.replace(**{name: float(value)}), float(value), speeds)


def phase_column(p: Parameters, value: float, speeds: Array) -> Column:
    """What is stable at each v_p0 of `speeds`, from one polarized branch."""
    resting = _resting(p, speeds)
    threshold = onset_speed(p)
    if threshold is None:
        return Column(value, None, (), np.where(resting, REST, NEITHER), np.zeros(speeds.size))
    path, folds, problem = _polarized_branch(p, threshold, speeds)
    # a branch that stops on its way down hides the faster states at every v_p0
    hidden = not path or path[-1].b.parameter_tangent < 0
    unresolved = np.full(speeds.size, bool(problem))
    if problem and not hidden:
        unresolved = speeds > path[-1].b.parameter
    found = _fastest_stable(p, speeds[~unresolved], path, _options(threshold))
    flow = np.zeros(speeds.size)
    flow[~unresolved] = np.nan_to_num(found)
    unresolved[~unresolved] = np.isnan(found)
    regions = np.where(
        flow > 0, np.where(resting, BISTABLE, POLARIZED), np.where(resting, REST, NEITHER)
    )
    regions = np.where(unresolved, UNRESOLVED, regions)
    return Column(value, threshold, folds, regions, flow, problem)


def _resting(p: Parameters, speeds: Array) -> Array:
    """Whether the homogeneous sphere is stable at each v_p0 of `speeds`.

    Its rates in closed form are exact to rounding: a cell right next to the threshold is on its
    side of it. Modes beyond HIGHEST are not looked at.
    """
    at = points(p).at_speed(speeds[:, None])
    pairs = finite_pressure_rates(at, np.arange(2, HIGHEST + 1)).reshape(speeds.size, -1)
    rates = np.hstack([growth_rate(at, 1), pairs])
    return np.asarray(rates.real.max(axis=1) <= ROUNDING * np.abs(rates).max(axis=1))


def _options(threshold: float) -> Options:
    return Options(parameter_scale=threshold, max_step=0.4, angle=0.2, max_points=200)


def _polarized_branch(
    p: Parameters, threshold: float, speeds: Array
) -> tuple[list[Arc], tuple[Point, ...], str]:
    """Arcs and folds of the branch, and what stopped it before it rose beyond all speeds."""
    options, rising = _options(threshold), Rising(float(max(speeds[-1], threshold)))
    window = Window(float(min(speeds[0], threshold)), rising.value)
    found: list[Arc] = []
    problem = ""
    path: Path | None = None
    try:
        start = branch_tangent(p, "v_p0", threshold, options)
        path = Path(p, "v_p0", start, options, window=window)
        for arc in path:
            found.append(arc)
            if rising.for_good(arc.b):
                break
        else:
            if not path.end:
                problem = f"not finished after {options.max_points} points"
    except (Stalled, InvalidInput) as stop:
        problem = "" if rising.already else str(stop)
        if path is not None and path.unresolved is not None:
            found.append(path.unresolved)  # the first part of it may be resolved
    return found, tuple(arc.b for arc in found if arc.b.fold), problem


def _fastest_stable(p: Parameters, speeds: Array, path: list[Arc], options: Options) -> Array:
    """Maximal retrograde speed of the last stable state along the branch at each of `speeds`.

    0 without one; NaN where a state that the branch passes cannot be found.
    """
    flow = np.zeros(speeds.size)
    passed = [(_prepared(arc, speeds, options), sheet) for arc, sheet in _with_sheets(path)][::-1]
    waiting = {row: _polarized(p, float(v), passed, options) for row, v in enumerate(speeds)}
    while waiting:
        tried: dict[int, dict[int, tuple[SteadySolution, float]]] = {}
        for row, others in list(waiting.items()):
            try:
                sheet, state, speed = next(others)
                tried.setdefault(sheet, {})[row] = state, speed
            except (StopIteration, Stalled) as stop:
                flow[row] = np.nan if isinstance(stop, Stalled) else 0.0
                del waiting[row]
        for found in tried.values():
            stable = are_stable_along([state for state, _ in found.values()])
            for row in [row for row, good in zip(found, stable, strict=True) if good]:
                flow[row] = found[row][1]
                del waiting[row]
    return flow


def _with_sheets(path: list[Arc]) -> list[tuple[Arc, int]]:
    """Arcs with the number of folds before them: states with the same one have no fold between."""
    return list(zip(path, accumulate(int(arc.a.fold) for arc in path), strict=True))


def _prepared(arc: Arc, speeds: Array, options: Options) -> Arc:
    """The arc on one system if any of the speeds lies on it: once for all of them."""
    if any(arc.holds(v) for v in speeds):
        with suppress(Stalled):  # whoever looks for a state there meets it again
            return on_one_system(arc, options)
    return arc


def _polarized(
    p: Parameters, v_p0: float, path: list[tuple[Arc, int]], options: Options
) -> Iterator[tuple[int, SteadySolution, float]]:
    """The polarized states at v_p0 on arcs, each with its sheet and its maximal retrograde speed.

    Raises Stalled.
    """
    for arc, sheet in path:
        x = unknowns_at(arc, v_p0, options)
        if x is not None:
            state = SteadySolution(p.replace(v_p0=v_p0), mode_count(x), x, True, ())
            flow: float = state.max_retrograde_speed
            if flow > 0:
                yield sheet, state, flow


def fold_line(
    p: Parameters, name: str, values: Array, column: Column, watch: Watch = unwatched
) -> tuple[list[tuple[float, float]], list[str]]:
    """(value, v_p0) along the curve of folds through the first fold of a column, both ways.

    The second entry says what stopped it before one of its ends, if anything did.

    Two-parameter continuation; it ends at the limits of `values` or where the fold meets the
    threshold, its amplitude vanishing.
    """
    fold = column.folds[0]
    n = mode_count(fold.x)
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
        return [], [f"the fold at {name} = {column.value:.6g} could not be located"]
    options = Options(parameter_scale=float(np.ptp(values)), max_step=0.1, max_points=80)
    line = [(column.value, float(found.x[-1]))]
    problems = []
    for direction in (1.0, -1.0):
        half: list[tuple[float, float]] = []
        try:
            begin = through(system, found.x, column.value, direction, options)
            for count, arc in enumerate(arcs(begin, options), 1):
                reached = float(np.clip(arc.b.parameter, values[0], values[-1]))
                if reached == arc.a.parameter or _mirrored(begin, arc.b):
                    break
                watch(Progress("fold line", name, reached, n, count))
                half.extend(_inside(arc, reached, options))
                if reached != arc.b.parameter:
                    break
            else:
                problems.append(f"not finished after {options.max_points} points")
        except (Stalled, InvalidInput) as stop:
            if not _at_tip(p, name, half or line):
                problems.append(str(stop))
        line = line + half if direction > 0 else half[::-1] + line
    return line, problems


def _inside(arc: Arc, reached: float, options: Options) -> list[tuple[float, float]]:
    """The end of an arc of the line of folds, or where it leaves the values at `reached`."""
    point = arc.b if reached == arc.b.parameter else at_value(arc, reached, options)
    return [] if point is None else [(reached, float(point.x[-1]))]


def _mirrored(begin: Point, point: Point) -> bool:
    """Whether a line of folds has passed its tip, to the mirror images of its states."""
    a, b = (_asymmetry_at_fold(q) for q in (begin, point))
    size = min(a.size, b.size)
    return float(a[:size] @ b[:size]) < 0


def _asymmetry_at_fold(point: Point) -> Array:
    folds: Any = point.system
    size = (point.x.size - 1) // 2
    return asymmetry(Point(folds.system, point.x[:size], float(point.x[-1]), np.zeros(size), 1.0))


def _at_tip(p: Parameters, name: str, line: list[tuple[float, float]]) -> bool:
    """Whether the line of folds has come to the threshold."""
    value, speed = line[-1]
    threshold = onset_speed(p.replace(**{name: value}))
    return threshold is not None and abs(speed - threshold) < AT_TIP * threshold


def diagram_of_columns(
    p: Parameters,
    name: str,
    values: Array,
    speeds: Array,
    columns: tuple[Column, ...],
    watch: Watch = unwatched,
) -> DiagramSolution:
    """The diagram of finished columns, with its fold line and the tips of the bistable region."""
    lines: list[tuple[tuple[float, float], ...]] = []
    problems = [f"branch at {name} = {c.value:.6g}: {c.problem}" for c in columns if c.problem]
    for column in sorted((c for c in columns if c.folds), key=_depth, reverse=True):
        for fold in column.folds:
            if any(_on_line(line, column.value, fold.parameter) for line in lines):
                continue
            line, stops = fold_line(p, name, values, replace(column, folds=(fold,)), watch)
            problems += [f"line of folds: {stop}" for stop in stops]
            if line:
                lines.append(tuple(line))
    problems = list(dict.fromkeys(problems))
    tips = []
    for value in critical_values(p, name, list(np.linspace(values[0], values[-1], 9))):
        threshold = onset_speed(p.replace(**{name: value}))
        if threshold is not None:
            tips.append((value, threshold))
    return DiagramSolution(
        name, values, speeds, columns, tuple(lines), tuple(tips), tuple(problems)
    )


def _on_line(line: tuple[tuple[float, float], ...], value: float, speed: float) -> bool:
    """Whether a line of folds passes through (value, speed)."""
    for (a, f), (b, g) in pairwise(line):
        if min(a, b) <= value <= max(a, b):
            share = (value - a) / (b - a) if b != a else 0.0
            if abs(f + share * (g - f) - speed) <= ON_LINE * speed:
                return True
    return any(a == value and abs(f - speed) <= ON_LINE * speed for a, f in line)


def _depth(column: Column) -> float:
    """How far the fold lies below the threshold: the deepest is the safest to start from."""
    return (column.threshold or 0.0) - column.folds[0].parameter
