"""A branch of steady states in one parameter: its states, folds, bifurcations and stability."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any

from amoeboid.axisymmetric.bifurcations import BranchPoint
from amoeboid.axisymmetric.branches import polarized_branch
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.progress import Watch, unwatched
from amoeboid.axisymmetric.tracing import BranchSolution
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.numerics.branch_points import Options
from amoeboid.studies.branch_result import BIFURCATION, FOLD, HOPF, Branch, SpecialPoint
from amoeboid.studies.columns import (
    text,
    value_of,
    with_units,
)
from amoeboid.studies.states import SteadyState
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

__all__ = [
    "BIFURCATION",
    "FOLD",
    "HOPF",
    "MAX_POINTS",
    "MAX_STEP",
    "Branch",
    "SpecialPoint",
    "branch",
    "checked_options",
    "checked_window",
    "shown_branch",
]

MAX_STEP, MAX_POINTS = 0.1, 400


@one_thread
def branch(
    p: Parameters,
    name: str = "v_p0",
    start: Any = None,
    end: Any = None,
    *,
    max_step: float = MAX_STEP,
    max_points: int = MAX_POINTS,
    watch: Watch = unwatched,
) -> Branch:
    """The branch of polarized steady states between two values of the parameter `name`.

    In v_p0 it starts where the homogeneous sphere loses stability to l = 1; in any other parameter
    at the polarized states at `start`, and where the sphere loses stability inside the window. It
    is followed through its folds outside the window too; what lies inside is the answer. With
    physical parameters, the ends are quantities such as "2 um/s"; `start` is 0 for v_p0 if left
    out, else the value in p. `max_step` is the longest step along the branch (a smaller one gives
    more points), `max_points` the largest number of points; `watch` is called with every step.

    Raises InvalidInput for a parameter or a window that cannot be, and where there is no polarized
    state.

    >>> import amoeboid as am
    >>> print(am.branch(am.Parameters(D=0.4), "v_p0", 0, 6.5, max_step=0.4))
    Branch in v_p0: threshold 6.02566, fold 5.20960, complete
    12 states from v_p0 = 6.02056 to 6.50000, 6 of them stable
    """
    refuse_no_parameters(p)
    first, last = checked_window(p, name, start, end)
    checked_options(max_step, max_points)
    scale = (onset_speed(p) if name == "v_p0" else None) or max(abs(first), abs(last))
    options = Options(
        parameter_scale=scale,
        max_step=max_step,
        first_step=min(0.05, max_step),
        max_points=max_points,
    )
    found = polarized_branch(p, name, first, last, options, watch)
    if found is None:
        low, high = (text(p, v, p.dimension(name)) for v in sorted((first, last)))
        raise InvalidInput(
            f"no polarized state was found for {name} between {low} and {high}; set v_p0 above "
            "its threshold (see amoeboid steady)"
        )
    if not found.points and found.complete:
        raise InvalidInput(f"{found.message}; choose a window that the branch enters")
    return shown_branch(p, found)


def checked_options(max_step: Any, max_points: Any) -> None:
    """Raise InvalidInput for a step or a number of points that cannot be."""
    if not (_is(Real, max_step) and math.isfinite(max_step) and max_step > 0):
        raise InvalidInput(f"max_step must be > 0 and finite, got {max_step!r}")
    if not (_is(Integral, max_points) and max_points >= 1):
        raise InvalidInput(f"max_points must be a whole number >= 1, got {max_points!r}")


def _is(kind: type, value: Any) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


def checked_window(
    p: Parameters,
    name: str,
    start: Any,
    end: Any,
    labels: tuple[str, str, str] = ("name", "start", "end"),
) -> tuple[float, float]:
    """The two ends of a window of the parameter `name`, in the units of p. Raises InvalidInput."""
    if name not in p.names:
        raise InvalidInput(f"{labels[0]} must be one of {', '.join(p.names)}, got {name!r}")
    if end is None:
        raise InvalidInput(f"{labels[2]} must be given: the end of the window of {name}")
    if start is None:
        first = 0.0 if name == "v_p0" else p.value(name)
    else:
        first = value_of(p, name, start, labels[1])
    last = value_of(p, name, end, labels[2])
    if first == last:
        both = text(p, first, p.dimension(name))
        raise InvalidInput(f"{labels[1]} and {labels[2]} must differ, both are {both}")
    return first, last


def shown_branch(p: Parameters, found: BranchSolution) -> Branch:
    """A branch of the solver as users see it."""
    points = [[b for b in piece if not b.point.fold] for piece in found.pieces]
    folds = [
        _special(FOLD, found.name, 0, b, k)
        for k, piece in enumerate(found.pieces)
        for b in piece
        if b.point.fold
    ]
    bifurcations = [
        _special(HOPF if b.oscillating else BIFURCATION, found.name, b.m, b.at, b.piece)
        for b in found.bifurcations
    ]
    return Branch(
        parameters=p,
        name=found.name,
        pieces=tuple(tuple(_state(b) for b in piece) for piece in points),
        lengths=tuple(tuple(b.point.length for b in piece) for piece in points),
        folds=tuple(folds),
        bifurcations=tuple(bifurcations),
        origins=found.origins,
        complete=found.complete,
        problems=with_units(p, found.problems, found.name),
    )


def _special(kind: str, name: str, m: int, b: BranchPoint, piece: int) -> SpecialPoint:
    return SpecialPoint(kind, name, m, _state(b, m), piece, b.point.length)


def _state(b: BranchPoint, neutral: int | None = None) -> SteadyState:
    """The state of a point, with the growth rates that are known already."""
    state = SteadyState(b.state, neutral)
    state._known_rates.update(b.rates)
    return state
