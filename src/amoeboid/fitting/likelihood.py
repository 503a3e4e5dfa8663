"""Intervals of one unknown by profile likelihood: all others are fitted again at each value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from amoeboid.fitting.determination import Sensitivity
from amoeboid.fitting.problem import Point, Problem

MAX_TRIALS = 12
ENOUGH = 1e-3
"""Accuracy of chi2 of a profile."""

CLOSE = 0.02
"""Relative accuracy of the root of the rise of chi2 at an end."""

EDGE = 0.1
"""Relative accuracy to which the distance to the end of the polarized state is sought."""

NOTHING = 0.01
"""Share of the first step that is no distance to the end of the polarized state."""

STATE_ENDS = "the polarized state ends before chi2 has risen enough"

LONGEST = 1.0
"""Step in y, of the unknown whose interval is sought, that is tried first at the most."""

QUADRATIC = 0.2
"""Share of its quadratic estimate by which an end may be off and still be called quadratic."""

LOWER = 1e-2
"""Fall of chi2 below the minimum that is one: a lower minimum has been found."""


@dataclass(frozen=True)
class End:
    """One end of an interval in y; `value` is None where there is none, and `why` says why."""

    value: float | None
    why: str = ""


def profile_point(problem: Problem, near: Point, k: int, value: float) -> Point | None:
    """The minimum with y_k held at a value, from one nearby.

    None where no state leads there, or the minimum lies where the polarized state ends.
    """
    others = np.arange(near.y.size) != k
    jacobian = near.jacobian
    along = -np.linalg.lstsq(jacobian[:, others], jacobian[:, k], rcond=1e-7)[0]
    change = value - near.y[k]
    y = near.y.copy()
    y[k] = value
    moved = y.copy()
    moved[others] += np.clip(along * change, -3 * abs(change), 3 * abs(change))
    held = problem.with_fixed(k, value)
    bound = np.clip(moved, held.lower, held.upper)
    begin = problem.evaluated(bound, near) or problem.evaluated(y, near)
    if begin is None:
        return None
    found = held.minimum(begin, enough=ENOUGH)
    return None if found.edge else found.point


def end(
    problem: Problem,
    best: Point,
    k: int,
    rise: float,
    towards: float,
    tried: Callable[[int], None],
    edge: bool = False,
) -> End:
    """Where chi2 of the profile of y_k has risen by rise^2, in the direction of the sign given.

    `tried` is called before each value of y_k that is tried. `edge`: the best point lies where the
    polarized state ends, and chi2 falls beyond.
    """
    deviation = float(Sensitivity.of(best.jacobian).errors[k])
    bound = float((problem.upper if towards > 0 else problem.lower)[k])
    reach = abs(bound - best.y[k])
    if reach == 0.0:
        return End(None, "the best value lies at its bound")
    below, above = (0.0, 0.0), (np.inf, np.inf)  # distance, root of the rise
    distance, near = min(rise * deviation, LONGEST, reach), best
    least = NOTHING * distance
    for trial in range(MAX_TRIALS):
        tried(trial)
        point = profile_point(problem, near, k, best.y[k] + towards * distance)
        if point is None:
            above = (distance, np.inf)
        else:
            risen = point.chi2 - best.chi2
            if risen < -LOWER:
                lower = f"another minimum lies there, with a chi2 lower by {-risen:.3g}"
                return End(None, STATE_ENDS if edge else lower)
            root = float(np.sqrt(max(risen, 0.0)))
            if abs(root - rise) <= CLOSE * rise:
                return End(best.y[k] + towards * distance)
            if root < rise:
                below, near = (distance, root), point
                if distance >= reach:
                    return End(None, "chi2 has not risen enough at the bound")
            else:
                above = (distance, root)
        distance = min(_next(below, above, rise), reach)
        if above[1] == np.inf and above[0] - below[0] < max(EDGE * above[0], least):
            return End(None, STATE_ENDS)
    if np.isfinite(above[1]):
        return End(best.y[k] + towards * above[0], "to a few percent")
    if np.isfinite(above[0]):
        return End(None, STATE_ENDS)
    return End(None, "chi2 does not rise enough within reach")


def _next(below: tuple[float, float], above: tuple[float, float], rise: float) -> float:
    """The distance to try next, between one that is too short and one that is too long."""
    (a, f), (b, g) = below, above
    if np.isinf(b):
        return a * min(max(rise / f if f > 0 else 3.0, 1.3), 3.0)
    if np.isinf(g):
        return 0.5 * (a + b)
    share = min(max((rise - f) / (g - f), 0.1), 0.9)
    return a + share * (b - a)


def rises(problem: Problem, best: Point, k: int) -> list[float | None]:
    """How chi2 of the profile of y_k rises one standard error below and above; quadratic: 1, 1.

    None where no polarized state leads there; a side with a bound in between is left out.
    """
    deviation = float(Sensitivity.of(best.jacobian).errors[k])
    found: list[float | None] = []
    for value in (best.y[k] - deviation, best.y[k] + deviation):
        if problem.lower[k] < value < problem.upper[k]:
            point = profile_point(problem, best, k, value)
            found.append(None if point is None else point.chi2 - best.chi2)
    return found
