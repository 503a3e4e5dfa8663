"""Branches of steady states in any parameter, with their folds, bifurcations and stability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate

from amoeboid.axisymmetric.force_balance import refuse_cue
from amoeboid.axisymmetric.onset import branch_tangent, onsets, onsets_anywhere
from amoeboid.axisymmetric.paths import SAME
from amoeboid.axisymmetric.progress import Watch, unwatched
from amoeboid.axisymmetric.search import same_state, steady_solutions
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.system import MODES, SteadySystem
from amoeboid.axisymmetric.tracing import BranchSolution, Tracer
from amoeboid.axisymmetric.window import Window
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import Options, Stalled, through


def branch_from_sphere(
    p: Parameters,
    name: str,
    window: Window | tuple[float, float],
    l: int = 1,  # noqa: E741
    sign: float = 1.0,
    options: Options | None = None,
    n: int = MODES,
    watch: Watch = unwatched,
) -> BranchSolution | None:
    """The branch that bifurcates from the sphere in mode l, inside the window.

    In v_p0 its origins are sought at all values; in another parameter inside the window and, if
    there is none, outside it, the nearest first. The branch is followed through its folds outside
    the window too. None if the sphere is never neutral to mode l. Raises InvalidInput for a window
    that is no pair low < high.
    """
    window = Window.of(window)
    for value in (window.low, window.high):
        p.replace(**{name: value})
    inside = onsets(p, name, window.low, window.high, l) if name != "v_p0" else ()
    found: list[BranchSolution] = []
    for origin in inside or _nearest_first(onsets_anywhere(p, name, l), window):
        if any(_met(origin, branch) for branch in found):
            continue
        if found and found[-1].pieces and not inside and name != "v_p0":
            break
        found.append(_from_origin(p, name, window, origin, sign, options, n, watch))
    entered = [branch for branch in found if branch.pieces or not branch.complete]
    return joined(entered or found[:1]) if found else None


def _from_origin(
    p: Parameters,
    name: str,
    window: Window,
    origin: float,
    sign: float,
    options: Options | None,
    n: int,
    watch: Watch,
) -> BranchSolution:
    chosen = options or Options(parameter_scale=abs(origin) or 1.0)
    start = branch_tangent(p, name, origin, chosen, n, sign)
    return Tracer(p, name, window, chosen, watch).from_sphere(start)


def _met(value: float, branch: BranchSolution) -> bool:
    """Whether the branch leaves or reaches the sphere at this value."""
    return any(abs(value - other) <= SAME * abs(other) for other in branch.origins)


def _distinct(values: Sequence[float]) -> tuple[float, ...]:
    """The values in order, without those that differ from an earlier one by rounding."""
    kept: list[float] = []
    for value in values:
        if not any(abs(value - other) <= SAME * abs(other) for other in kept):
            kept.append(value)
    return tuple(kept)


def _nearest_first(origins: Sequence[float], window: Window) -> list[float]:
    def away(value: float) -> float:
        return max(window.low - value, value - window.high, 0.0)

    return sorted(origins, key=away)


def branch_from_state(
    state: SteadySolution,
    name: str,
    window: Window | tuple[float, float],
    direction: float,
    options: Options | None = None,
    watch: Watch = unwatched,
) -> BranchSolution:
    """The branch in the parameter `name` that passes through a steady state, inside the window.

    It is followed from the state in `direction` of the parameter and through its folds, outside the
    window too; the other side of the state is not followed. Raises InvalidInput for a state under a
    cue.
    """
    refuse_cue(state.cue, "a branch of steady states")
    window = Window.of(window)
    p, value = state.parameters, state.parameters.value(name)
    size = max(abs(value), window.high - window.low)
    chosen = options or Options(parameter_scale=size)
    system = SteadySystem(p, state.n, (name,))
    first = through(system, state.x, value, direction, chosen)
    return Tracer(p, name, window, chosen, watch).from_state(first)


def polarized_branch(
    p: Parameters,
    name: str,
    start: float,
    end: float,
    options: Options | None = None,
    watch: Watch = unwatched,
) -> BranchSolution | None:
    """The branches of l = 1 between the values `start` and `end` of the parameter `name`.

    In v_p0 that which leaves the sphere; in other parameters those through all polarized states at
    `start`, the fastest first, those through others at `end`, and those that leave the sphere on
    the way. None if there are none.
    """
    window = Window(min(start, end), max(start, end))
    if name == "v_p0":
        return branch_from_sphere(p, name, window, options=options, watch=watch)
    found: list[BranchSolution] = []
    problems: list[str] = []
    for edge, other in ((start, end), (end, start)):
        states = steady_solutions(p.replace(**{name: edge}), (1,), watch)
        if not states.complete:
            problems += [f"at {name} = {edge:g}: {problem}" for problem in states.problems]
        for state in reversed([s for s in states if s.max_retrograde_speed > 0]):
            known = [b.state for branch in found for b in branch.points if b.value == edge]
            if not any(same_state(state, one) for one in known):
                try:
                    branch = branch_from_state(state, name, window, other - edge, options, watch)
                except Stalled as stop:
                    problems.append(f"at {name} = {edge:g}: {stop}")
                else:
                    found.append(branch)
    for origin in onsets(p, name, window.low, window.high):
        if not any(_met(origin, branch) for branch in found):
            found.append(_from_origin(p, name, window, origin, 1.0, options, MODES, watch))
    if not found:
        outside = branch_from_sphere(p, name, window, options=options, watch=watch)
        found += [outside] if outside is not None else []
    if not found:
        return None
    branch = joined(found)
    complete = branch.complete and not problems
    return replace(branch, complete=complete, problems=(*branch.problems, *problems))


def joined(branches: Sequence[BranchSolution]) -> BranchSolution:
    """Several branches in one parameter as one."""
    offsets = accumulate((len(b.pieces) for b in branches), initial=0)
    return BranchSolution(
        branches[0].name,
        tuple(piece for b in branches for piece in b.pieces),
        tuple(
            replace(bifurcation, piece=bifurcation.piece + offset)
            for b, offset in zip(branches, offsets, strict=False)
            for bifurcation in b.bifurcations
        ),
        _distinct([value for b in branches for value in b.origins]),
        all(b.complete for b in branches),
        tuple(dict.fromkeys(text for b in branches for text in b.problems)),
    )
