"""Branches of steady states in any parameter, with their folds, bifurcations and stability."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.axisymmetric.evolution import perturbed_sphere, polished, settled
from amoeboid.axisymmetric.onset import departure, onset_speed, onsets
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.axisymmetric.stability import (
    AZIMUTHAL_NUMBERS,
    count_unstable,
    growth_rates,
    neutral_rate,
)
from amoeboid.axisymmetric.steady import (
    MODES,
    SteadyState,
    SteadySystem,
    homogeneous,
    steady_state,
)
from amoeboid.axisymmetric.unknowns import resampled, split
from amoeboid.numerics.continuation import (
    Options,
    Point,
    Stalled,
    at_parameter,
    follow,
    located,
    through,
)
from amoeboid.numerics.integrators import StepTooSmall
from amoeboid.parameters import Parameters
from amoeboid.validation import InvalidInput

Array = NDArray[Any]

FAR_SIZE = 3 * 128 + 3
"""Unknowns beyond which `search` gives up a branch that is still far from its goal."""


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A steady state on a branch, the value of the parameter there and the growth rates."""

    point: Point
    state: SteadyState
    value: float

    @cached_property
    def rates(self) -> dict[int, Array]:
        """Growth rates for m = 0, 1, 2, 3, fastest first [1/time]."""
        return {m: growth_rates(self.state, m) for m in AZIMUTHAL_NUMBERS}

    @cached_property
    def unstable(self) -> dict[int, int]:
        """Number of growing modes for m = 0, 1, 2, 3."""
        p = self.state.parameters
        return {m: count_unstable(rates, p) for m, rates in self.rates.items()}

    @property
    def stable(self) -> bool:
        """Whether every perturbation with m = 0, 1, 2, 3 decays."""
        return not any(self.unstable.values())


@dataclass(frozen=True, eq=False)
class Crossing:
    """A point where a mode of azimuthal number m becomes neutral; `oscillating` at a Hopf point."""

    m: int
    oscillating: bool
    at: BranchPoint


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch in the parameter `name`: its points in order, folds, crossings.

    `origin` is the value at which it leaves the homogeneous sphere, if it does; `message` is empty
    when the branch was followed to the end of its window and says what stopped it otherwise.
    """

    name: str
    points: tuple[BranchPoint, ...]
    folds: tuple[BranchPoint, ...]
    crossings: tuple[Crossing, ...]
    origin: float | None
    message: str


def branch_point(point: Point, p: Parameters, name: str) -> BranchPoint:
    """The steady state of a point of a branch in `name`."""
    at = p.replace(**{name: point.parameter})
    n = (point.x.size - 3) // 3
    return BranchPoint(point, SteadyState(at, n, point.x, True, ()), point.parameter)


@dataclass(frozen=True)
class Window:
    """The values low <= parameter <= high that are asked for."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InvalidInput(
                f"the window of the parameter must have low < high, got {self.low!r}, {self.high!r}"
            )

    def holds(self, value: float) -> bool:
        """Whether the value lies inside, ends included."""
        return self.low <= value <= self.high


def branch_from_sphere(
    p: Parameters,
    name: str,
    window: Window,
    l: int = 1,  # noqa: E741
    sign: float = 1.0,
    options: Options | None = None,
    n: int = MODES,
    watch: Watch = unwatched,
) -> Branch | None:
    """The branch that mode l of the homogeneous sphere sends out, inside the window.

    Its origin is sought at all v_p0 if that is the parameter (a subcritical branch may reach into
    the window from above), and inside the window otherwise; None if there is no origin.
    """
    origins: tuple[float, ...]
    if name == "v_p0":
        threshold = onset_speed(p, l)
        origins = () if threshold is None else (threshold,)
    else:
        origins = onsets(p, name, window.low, window.high, l)
    for origin in origins:
        chosen = options or Options(parameter_scale=abs(origin) or 1.0)
        start = departure(p, name, origin, chosen, n, sign)
        return trace(p, name, start, window, chosen, origin, watch)
    return None


def branch_from_state(
    state: SteadyState,
    name: str,
    window: Window,
    direction: float,
    options: Options | None = None,
    watch: Watch = unwatched,
) -> Branch:
    """The branch through a steady state in the parameter `name`, leaving it in `direction`."""
    p, value = state.parameters, float(getattr(state.parameters, name))
    size = max(abs(value), window.high - window.low)
    chosen = options or Options(parameter_scale=size)
    system = SteadySystem(p, state.n, (name,))
    first = through(system, state.x, value, direction, chosen)
    branch = trace(p, name, first, window, chosen, None, watch)
    points = (branch_point(first, p, name), *branch.points)
    return replace(branch, points=points)


def trace(
    p: Parameters,
    name: str,
    start: Point,
    window: Window,
    options: Options,
    origin: float | None,
    watch: Watch = unwatched,
) -> Branch:
    """Follow a branch until it leaves the window; locate its folds and crossings."""
    points: list[BranchPoint] = []
    folds: list[BranchPoint] = []
    message = f"stopped after {options.max_points} points; allow more, or longer steps"
    before = start
    try:
        for count, point in enumerate(follow(start, options), 1):
            watch(Progress("branch", name, point.parameter, (point.x.size - 3) // 3, count))
            if window.holds(point.parameter):
                found = branch_point(point, p, name)
                (folds if point.fold else points).append(found)
            elif points:
                points.extend(_at_edge(p, name, before, point, window))
                message = ""
                break
            elif _receding(point, window):
                message = ""
                break
            if not point.fold and points and polarity(before) * polarity(point) < 0:
                # through the sphere and on to mirror images of what is known already
                points = [b for b in points if b.point is not point]
                folds = [b for b in folds if b.point.length <= before.length]
                origin = _meeting(p, name, before, point)
                message = ""
                break
            before = before if point.fold else point
    except Stalled as stall:
        message = str(stall)
    crossings = _crossings(p, name, points, folds, options, watch)
    return Branch(name, tuple(points), tuple(folds), crossings, origin, message)


def _meeting(p: Parameters, name: str, a: Point, b: Point) -> float | None:
    """The threshold of the sphere between two points on mirrored halves of a branch.

    Guessed from parameter = threshold + k polarity^2, then found by its own root search.
    """
    f, g = polarity(a) ** 2, polarity(b) ** 2
    guess = a.parameter
    if abs(f - g) > 1e-3 * max(f, g):
        guess = (a.parameter * g - b.parameter * f) / (g - f)
    width = 2 * abs(guess - a.parameter) + 0.02 * abs(guess)
    found = onsets(p, name, max(guess - width, 0.0), guess + width)
    return min(found, key=lambda value: abs(value - guess), default=None)


def polarity(point: Point) -> float:
    """c at the pole x = 0 less c at the pole x = pi; zero on the sphere and on even states."""
    c = split(point.x, (point.x.size - 3) // 3)[2]
    difference = float(np.sum(c[1::2]))
    return difference if abs(difference) > 1e-9 * abs(c[0]) else 0.0


def _receding(point: Point, window: Window) -> bool:
    """Whether a point outside the window, not yet entered, moves away from it."""
    outward = 1.0 if point.parameter > window.high else -1.0
    return not point.fold and outward * point.parameter_tangent > 0.05


def _at_edge(
    p: Parameters, name: str, inside: Point, outside: Point, window: Window
) -> list[BranchPoint]:
    edge = window.high if outside.parameter > window.high else window.low
    if inside.parameter == edge:
        return []
    x = inside.x
    if x.size != outside.x.size:
        inside = Point(outside.system, inside.system.prolonged(x), inside.parameter, x, 0.0)
    share = (edge - inside.parameter) / (outside.parameter - inside.parameter)
    found = at_parameter(outside.system, inside.x + share * (outside.x - inside.x), edge)
    if found is None:
        return []
    length = inside.length + share * (outside.length - inside.length)
    tangent = (outside.x_tangent, outside.parameter_tangent)
    return [branch_point(Point(outside.system, found, edge, *tangent, length), p, name)]


def _crossings(
    p: Parameters,
    name: str,
    points: list[BranchPoint],
    folds: list[BranchPoint],
    options: Options,
    watch: Watch,
) -> tuple[Crossing, ...]:
    found: list[Crossing] = []
    for count, (a, b) in enumerate(pairwise(points), 1):
        watch(Progress("stability", name, b.value, b.state.n, count))
        for m in AZIMUTHAL_NUMBERS:
            counts = sorted((a.unstable[m], b.unstable[m]))
            previous: float | None = None
            for k in range(*counts):
                crossing = _crossing(p, name, a, b, m, k, options)
                if crossing is None or crossing.at.value == previous:
                    continue
                previous = crossing.at.value
                here = crossing.at.point.length
                near = [abs(f.point.length - here) for f in folds] if m == 0 else []
                if not near or min(near) > 1e-4 * options.max_step:
                    found.append(crossing)
    return tuple(found)


def _crossing(
    p: Parameters, name: str, a: BranchPoint, b: BranchPoint, m: int, k: int, options: Options
) -> Crossing | None:
    """Where the real part of the k-th fastest rate passes zero between neighbors a and b."""

    def rate(point: Point) -> float:
        rates = growth_rates(branch_point(point, p, name).state, m)
        return float(rates[k].real) if k < rates.size else -1.0

    start = a.point
    if start.x.size != b.point.x.size:
        return None
    if rate(start) * rate(b.point) >= 0:
        return None
    at = branch_point(located(start, b.point, rate, options), p, name)
    still = neutral_rate(at.rates[m], at.state.parameters)
    return Crossing(m, bool(abs(at.rates[m][k].imag) > still), at)


@dataclass(frozen=True)
class Search:
    """The states found at one parameter point, slowest first; `problems` says what got in the way.

    A problem means that a branch could not be followed to its end: states on it may be missing.
    """

    states: tuple[SteadyState, ...]
    problems: tuple[str, ...]


def steady_states(p: Parameters, degrees: tuple[int, ...] = (1, 2, 3)) -> tuple[SteadyState, ...]:
    """All steady states that `search` finds, the homogeneous one first."""
    return search(p, degrees).states


def search(p: Parameters, degrees: tuple[int, ...] = (1, 2, 3), watch: Watch = unwatched) -> Search:
    """Look for all steady states at one parameter point.

    They are the crossings of v_p0 = p.v_p0 with the branches that modes l of the homogeneous sphere
    send out in v_p0, each followed until it rises beyond p.v_p0, mirror images left out; states
    without such a connection to the sphere are not found.
    """
    found, problems = [homogeneous(p)], []
    without = _without_speed(p)
    if without:
        found.extend(_reached_in_time(p))
        problems.append(f"only states reached in time are found: {without}")
    for l in degrees:  # noqa: E741
        for sign in (1.0, -1.0) if l % 2 == 0 else (1.0,):
            states, problem = _crossed(p, l, sign, watch)
            found.extend(states)
            text = f"branch of l = {l}: {problem}"
            if problem and text not in problems:
                problems.append(text)
    distinct: list[SteadyState] = []
    for state in found:
        if not any(_same(state, other) for other in distinct):
            distinct.append(state)
    ordered = sorted(distinct, key=lambda s: s.max_retrograde_speed)
    return Search(tuple(ordered), tuple(problems))


def _without_speed(p: Parameters) -> str:
    """Why no branch in v_p0 can be followed because v_p(c0) is the same for all v_p0, or empty."""
    other = p.replace(v_p0=2 * p.v_p0 or p.R0 * p.rate)
    here = float(p.v_p(p.c0))
    if here != float(other.v_p(p.c0)):
        return ""
    with suppress(InvalidInput):
        elsewhere = p.c_r * np.array([0.5, 1.0, 2.0])
        if np.array_equal(p.v_p(elsewhere), other.v_p(elsewhere)):
            return "the law does not depend on v_p0"
    return f"v_p(c0) = {here:g} whatever v_p0; bring c0/c_r = {p.c0 / p.c_r:g} nearer to 1"


def _reached_in_time(p: Parameters) -> list[SteadyState]:
    """The steady states at which time evolution from polarized spheres ends."""
    found = []
    for amplitude in (0.1, 0.9):
        with suppress(StepTooSmall, InvalidInput):
            start = perturbed_sphere(p, {1: amplitude * p.c0})
            found.append(polished(settled(p, start, 1000.0 / p.rate, rate=1e-7)))
    return [state for state in found if state.converged]


def _crossed(
    p: Parameters,
    l: int,  # noqa: E741
    sign: float,
    watch: Watch,
) -> tuple[list[SteadyState], str]:
    """The states at p on the branch that mode l sends out in v_p0, and what stopped the search."""
    found: list[SteadyState] = []
    problem = ""
    threshold = onset_speed(p, l)
    if threshold is None:
        return found, problem
    options = Options(parameter_scale=threshold, max_step=1.5, angle=0.2, max_points=80)
    try:
        before = departure(p, "v_p0", threshold, options, sign=sign)
        for count, point in enumerate(follow(before, options), 1):
            task = f"searching along l = {l}"
            watch(Progress(task, "v_p0", point.parameter, (point.x.size - 3) // 3, count))
            if point.fold:
                continue
            low_, high_ = sorted((before.parameter, point.parameter))
            if low_ <= p.v_p0 <= high_ and before.parameter != p.v_p0:
                state = interpolated_state(p, before, point)
                if state.converged:
                    found.append(state)
                elif abs(p.v_p0 - threshold) > 1e-6 * threshold:
                    problem = state.message
            if point.x.size > FAR_SIZE and abs(point.parameter - p.v_p0) > 0.5 * p.v_p0:
                return found, f"it needs too many modes already at v_p0 = {point.parameter:.6g}"
            upwards = point.parameter_tangent > 0 and point.parameter > 1.05 * p.v_p0
            if upwards or point.parameter <= 0:
                return found, problem
            before = point
    except (Stalled, InvalidInput) as stop:
        return found, str(stop)
    return found, f"not finished after {options.max_points} points"


def interpolated_state(p: Parameters, a: Point, b: Point) -> SteadyState:
    """The steady state at p between neighbors a and b of a branch in v_p0, by Newton's method."""
    n = (b.x.size - 3) // 3
    x = resampled(a.x, (a.x.size - 3) // 3, n)
    share = (p.v_p0 - a.parameter) / (b.parameter - a.parameter)
    return steady_state(p, SteadyState(p, n, x + share * (b.x - x), False, ()))


def _same(a: SteadyState, b: SteadyState) -> bool:
    """Whether two states agree, or mirror each other in the equator."""
    n = max(a.n, b.n)
    first, second = (split(resampled(s.x, s.n, n), n)[2] for s in (a, b))
    mirrored = second * (-1.0) ** np.arange(n)
    nearest = min(np.abs(first - second).max(), np.abs(first - mirrored).max())
    return bool(nearest < 1e-6 * np.abs(first).max())
