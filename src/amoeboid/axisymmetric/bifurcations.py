"""Points of a branch with their growth rates, and where the number of unstable modes changes."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

from amoeboid.arrays import Array
from amoeboid.axisymmetric.linearization import slow_rate
from amoeboid.axisymmetric.paths import steady_state_at
from amoeboid.axisymmetric.progress import Progress, Watch
from amoeboid.axisymmetric.stability import (
    AZIMUTHAL_NUMBERS,
    count_unstable,
    growth_rates,
    growth_rates_of,
    neutral_rate,
)
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import Arc, on_one_system
from amoeboid.numerics.branch_points import Options, Point, Stalled
from amoeboid.numerics.locating import located


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A steady state on a branch and the value of the parameter there.

    `rates` are the growth rates for m = 0, 1, 2, 3, fastest first [1/time].
    """

    point: Point
    state: SteadySolution
    value: float
    rates: dict[int, Array]

    @cached_property
    def unstable(self) -> dict[int, int]:
        """Number of unstable modes for m = 0, 1, 2, 3."""
        slow = slow_rate(self.state.parameters)
        return {m: count_unstable(rates, slow) for m, rates in self.rates.items()}

    @property
    def stable(self) -> bool:
        """Whether every perturbation with m = 0, 1, 2, 3 decays."""
        return not any(self.unstable.values())


@dataclass(frozen=True, eq=False)
class Bifurcation:
    """A point where a mode of azimuthal number m becomes neutral; `oscillating` at a Hopf point.

    `piece` is the index of the stretch of the branch that it lies on.
    """

    m: int
    oscillating: bool
    at: BranchPoint
    piece: int = 0


def branch_points(points: Sequence[Point], p: Parameters, name: str) -> tuple[BranchPoint, ...]:
    """The steady states of points of a branch in `name`, with their growth rates."""
    states = [steady_state_at(p, name, point) for point in points]
    return tuple(
        BranchPoint(point, state, point.parameter, rates)
        for point, state, rates in zip(points, states, growth_rates_of(states), strict=True)
    )


def located_bifurcations(
    p: Parameters,
    name: str,
    pieces: Sequence[Sequence[BranchPoint]],
    options: Options,
    watch: Watch,
) -> tuple[tuple[Bifurcation, ...], list[str]]:
    """Where modes become neutral, and what could not be located."""
    found: list[Bifurcation] = []
    missed: list[str] = []
    count = 0
    for number, piece in enumerate(pieces):
        folds = [b for b in piece if b.point.fold]
        for a, b in pairwise([b for b in piece if not b.point.fold]):
            count += 1
            watch(Progress("stability", name, b.value, b.state.n, count))
            between = [f for f in folds if a.point.length <= f.point.length <= b.point.length]
            for m in AZIMUTHAL_NUMBERS:
                bifurcations, lost = _bifurcations_between(p, name, a, b, m, between, options)
                found += [replace(bifurcation, piece=number) for bifurcation in bifurcations]
                if lost:
                    missed.append(
                        f"the number of unstable modes m = {m} changes between {name} = "
                        f"{a.value:.6g} and {b.value:.6g}; the exact location was not found"
                    )
    return tuple(found), missed


def _bifurcations_between(
    p: Parameters,
    name: str,
    a: BranchPoint,
    b: BranchPoint,
    m: int,
    folds: Sequence[BranchPoint],
    options: Options,
) -> tuple[list[Bifurcation], bool]:
    """The bifurcations of m between neighbors, folds left out; whether one is missing."""
    found: list[Bifurcation] = []
    lost = False
    for k in range(*sorted((a.unstable[m], b.unstable[m]))):
        bifurcation = _bifurcation(p, name, a, b, m, k, options)
        if bifurcation is None:
            lost = True
            continue
        at = bifurcation.at
        if found and _near(at, found[-1].at, options):
            continue  # the other one of a pair
        if m > 0 or not any(_near(at, fold, options) for fold in folds):
            found.append(bifurcation)
    return found, lost


def _near(a: BranchPoint, b: BranchPoint, options: Options) -> bool:
    return abs(a.point.length - b.point.length) <= 1e-4 * options.max_step


def _bifurcation(
    p: Parameters, name: str, a: BranchPoint, b: BranchPoint, m: int, k: int, options: Options
) -> Bifurcation | None:
    """Where the real part of the k-th fastest rate passes zero between neighbors a and b."""

    def rate(point: Point) -> float:
        known = [q.rates[m] for q in (a, b) if q.point is point]
        [rates] = known or [growth_rates(steady_state_at(p, name, point), m)]
        return float(rates[k].real) if k < rates.size else -1.0

    arc = on_one_system(Arc(a.point, a.point, b.point), options)
    start, end = arc.a, arc.b
    if rate(start) * rate(end) >= 0:
        return None
    with suppress(Stalled):
        [at] = branch_points([located(start, end, rate, options)], p, name)
        still = neutral_rate(at.rates[m], slow_rate(at.state.parameters))
        return Bifurcation(m, bool(abs(at.rates[m][k].imag) > still), at)
    return None
