"""The search for all steady states at one parameter point, and what may be missing."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from numbers import Integral
from typing import Any, overload

import numpy as np

from amoeboid.axisymmetric.evolution import evolve_to_steady, newton_refined, perturbed_sphere
from amoeboid.axisymmetric.linearization import MAX_GROWING, highest_growing
from amoeboid.axisymmetric.onset import branch_tangent, onset_speeds
from amoeboid.axisymmetric.paths import SAME, Path, modes_of, steady_state_at
from amoeboid.axisymmetric.progress import Watch, unwatched
from amoeboid.axisymmetric.steady import SteadySolution, homogeneous
from amoeboid.axisymmetric.unknowns import resampled, split
from amoeboid.closed_forms.linear import growth_rate
from amoeboid.closed_forms.points import points
from amoeboid.model.natural_units import natural_units
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import Arc, at_value
from amoeboid.numerics.branch_points import Options, Point, Stalled
from amoeboid.numerics.integrators import StepTooSmall
from amoeboid.validation import InvalidInput

MAX_FAR_MODES = 128
"""Modes beyond which the search leaves a branch that is still far from the requested v_p0."""

MAX_EXCURSION = 1.25
"""A branch is followed until it rises beyond this many times v_p0."""

MIN_EXCURSION = 1.05
"""Beyond this many times v_p0 a rising branch may stop at too many modes without a problem."""

MAX_RISING_MODES = 64
"""Modes beyond which a rising branch is left there."""

FAR = 0.25
"""Relative difference from v_p0 that is far."""


@dataclass(frozen=True, eq=False)
class SteadySolutions(Sequence[SteadySolution]):
    """The steady states found at one parameter point, slowest first: a sequence of them.

    `complete` says that every branch was followed to its end, so that no state which is connected
    to the sphere through them is missing. `problems` says what may be missing and why, and what
    else limits the answer.
    """

    parameters: Parameters
    states: tuple[SteadySolution, ...]
    complete: bool
    problems: tuple[str, ...]

    @overload
    def __getitem__(self, index: int) -> SteadySolution: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[SteadySolution, ...]: ...
    def __getitem__(self, index: int | slice) -> SteadySolution | tuple[SteadySolution, ...]:
        return self.states[index]

    def __len__(self) -> int:
        return len(self.states)

    def __repr__(self) -> str:
        lines = [f"{'v_0':>12} {'c_front':>12} {'c_rear':>12} {'zeta0':>12}  modes"]
        for s in self.states:
            numbers = (s.max_retrograde_speed, s.c_front, s.c_rear, s.zeta0)
            lines.append(" ".join(f"{v:12.6g}" for v in numbers) + f"  {s.n}")
        found = "complete" if self.complete else "states may be missing"
        count = f"{len(self.states)} steady state{'s' if len(self.states) != 1 else ''}"
        return "\n".join([f"{count}, {found}", *lines, *(f"- {text}" for text in self.problems)])


def _check_degrees(degrees: Any) -> None:
    """Raise InvalidInput unless each is the degree of a mode, and there is one."""
    many = isinstance(degrees, tuple | list) and len(degrees) > 0
    whole = many and all(isinstance(x, Integral) and not isinstance(x, bool) for x in degrees)
    if not (whole and min(degrees) >= 1):
        raise InvalidInput(
            f"degrees must be one or more whole numbers >= 1, such as (1, 2, 3), got {degrees!r}"
        )


def steady_solutions(
    p: Parameters,
    degrees: tuple[int, ...] = (1, 2, 3),
    watch: Watch = unwatched,
) -> SteadySolutions:
    """All steady states at one parameter point, the homogeneous one first.

    They lie where v_p0 = p.v_p0 on the branches that bifurcate from the homogeneous sphere in its
    modes l of `degrees` as v_p0 changes, mirror images left out. Each branch is followed through
    its folds until it rises beyond MAX_EXCURSION times p.v_p0, or ends; states without such a
    connection to the sphere are not found. Raises InvalidInput for degrees that no mode has.
    """
    _check_degrees(degrees)
    units = natural_units(p)
    for dimension in ("L^3", "M/T^2", "N/L^2"):  # of what is computed of every state
        units.of(dimension)
    found, problems = [homogeneous(p)], []
    without = _without_speed(p)
    if without:
        found.extend(_reached_by_evolution(p))
        problems.append(f"only states that a time evolution reaches are found: {without}")
    for l in degrees:  # noqa: E741
        for threshold in onset_speeds(p, l):
            for sign in (1.0, -1.0) if l % 2 == 0 else (1.0,):
                states, problem = _states_of_mode(p, l, threshold, sign, watch)
                found.extend(states)
                text = f"branch of l = {l}: {problem}"
                if problem and text not in problems:
                    problems.append(text)
    distinct: list[SteadySolution] = []
    for state in found:
        if not any(same_state(state, other) for other in distinct):
            distinct.append(state)
    ordered = sorted(distinct, key=lambda s: s.max_retrograde_speed)
    complete = not problems
    return SteadySolutions(p, tuple(ordered), complete, (*problems, *stability_problems(p)))


def stability_problems(p: Parameters) -> tuple[str, ...]:
    """What limits the counts of unstable modes at a parameter point."""
    if p.delta_P == 0:
        return (
            "at delta_P = 0 short waves are weakly damped, so the counts of unstable modes "
            "depend on the resolution; raise delta_P for reliable counts",
        )
    if highest_growing(p) == MAX_GROWING:
        return (
            f"modes of the sphere up to l = {MAX_GROWING}, the highest that is counted, grow, so "
            "the counts of unstable modes are lower bounds; raise D or beta",
        )
    return ()


def _without_speed(p: Parameters) -> str:
    """Why the polarized branch does not begin at a threshold in v_p0, or empty.

    v_p(c0) may be the same for all v_p0, or the sphere may polarize at v_p0 = 0 already.
    """
    other = p.replace(v_p0=2 * p.v_p0 or p.R0 * p.rate)
    here = float(p.v_p(p.c0))
    if here != float(other.v_p(p.c0)):
        with suppress(InvalidInput):
            if growth_rate(points(p).at_speed(0.0), 1) > 0:
                return "the sphere polarizes without polymerization, at every v_p0 >= 0"
        return ""
    with suppress(InvalidInput):
        elsewhere = p.c_r * np.array([0.5, 1.0, 2.0])
        if np.array_equal(p.v_p(elsewhere), other.v_p(elsewhere)):
            return "the law does not depend on v_p0"
    return f"v_p(c0) = {here:g} whatever v_p0; bring c0/c_r = {p.c0 / p.c_r:g} nearer to 1"


def _reached_by_evolution(p: Parameters) -> list[SteadySolution]:
    """The steady states at which time evolution from polarized spheres ends."""
    found = []
    for amplitude in (0.1, 0.9):
        with suppress(StepTooSmall, InvalidInput):
            start = perturbed_sphere(p, {1: amplitude * p.c0})
            found.append(newton_refined(evolve_to_steady(p, start, 1000.0 / p.rate, rate=1e-7)))
    return [state for state in found if state.converged]


def _states_of_mode(
    p: Parameters,
    l: int,  # noqa: E741
    threshold: float,
    sign: float,
    watch: Watch,
) -> tuple[list[SteadySolution], str]:
    """The states at p on the branch that bifurcates in mode l, and what stopped the search."""
    found: list[SteadySolution] = []
    problems: list[str] = []
    options = Options(parameter_scale=threshold, max_step=1.5, angle=0.2, max_points=120)
    rising = Rising(p.v_p0)
    path: Path | None = None
    try:
        start = branch_tangent(p, "v_p0", threshold, options, sign=sign)
        path = Path(p, "v_p0", start, options, watch, f"searching along l = {l}")
        for arc in path:
            try:
                found.extend(states_on(p, "v_p0", arc, p.v_p0, options))
            except Stalled as stop:
                problems.append(str(stop))
            if rising.for_good(arc.b):
                break
            if modes_of(arc.b) > MAX_FAR_MODES and abs(arc.b.parameter - p.v_p0) > FAR * p.v_p0:
                problems.append(f"it needs too many modes at v_p0 = {arc.b.parameter:.6g}")
                break
        else:
            if not path.end:
                problems.append(f"not finished after {options.max_points} points")
    except (Stalled, InvalidInput) as stop:
        beyond = path.unresolved if path is not None else None
        if beyond is not None:
            with suppress(Stalled):  # the value may lie on the way to the point that was too much
                found.extend(states_on(p, "v_p0", beyond, p.v_p0, options))
                rising.for_good(beyond.b)
        if not rising.already:
            problems.append(str(stop))
    return found, "; ".join(dict.fromkeys(problems))


@dataclass
class Rising:
    """Whether a branch in v_p0 has risen so far beyond a value that it is followed no further."""

    value: float
    already: bool = False

    def for_good(self, point: Point) -> bool:
        """Take the next point into account; `already` from MIN_EXCURSION on."""
        upwards = not point.fold and point.parameter_tangent > 0
        self.already = upwards and point.parameter > MIN_EXCURSION * self.value
        if self.already and modes_of(point) > MAX_RISING_MODES:
            return True
        return upwards and point.parameter > MAX_EXCURSION * self.value


def states_on(
    p: Parameters, name: str, arc: Arc, value: float, options: Options
) -> list[SteadySolution]:
    """The steady state on an arc of a branch in `name` at `value`, a list of no or one entry.

    Raises Stalled if the arc passes the value but the state cannot be found.
    """
    point = at_value(arc, value, options)
    return [] if point is None else [steady_state_at(p, name, point)]


def same_state(a: SteadySolution, b: SteadySolution) -> bool:
    """Whether two states agree, or mirror each other in the equator."""
    n = max(a.n, b.n)
    first, second = (split(resampled(s.x, s.n, n), n)[2] for s in (a, b))
    mirrored = second * (-1.0) ** np.arange(n)
    nearest = min(np.abs(first - second).max(), np.abs(first - mirrored).max())
    return bool(nearest < SAME * np.abs(first).max())
