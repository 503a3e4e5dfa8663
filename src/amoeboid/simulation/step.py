"""An accepted step of a run: the state that it led to, and what the next one needs."""

from __future__ import annotations

from dataclasses import dataclass

from amoeboid.arrays import Array
from amoeboid.simulation.changes import awaited
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.initial import Adaptation
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.surface.steadiness import MAX_GROWTH_TIMES, UNSTABLE, Rest


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """An accepted step: the state it led to, the flow during it, and what the next one needs.

    `number` of the step, from 0 for an initial state; `next_dt` [T]: the length that the next one
    tries; `rejected`: attempts with a longer step that were too inaccurate. `model` may have
    another mesh than that of the step before, and has the parameters at the time of the state, at a
    jump those before it; `history`: the state and those before it that the next step needs, newest
    first; `rate` is the largest relative rate of change of shape and concentration in units of
    model.rate; `rest` is None as long as the cell or one of its parameters changes, and for an
    initial state; `ended`: why the run ends here, or None; `tried`: the nodes (V, 3)
    of the last attempt to make a better mesh, if it failed; `adapted`, of an initial state: what
    was done to a shape from a file; `solved`: the state is a steady one that was solved for from
    that of the step; `noise_kept`: the share of the shot noise of the step that its nodes had
    filaments enough for.
    """

    number: int
    model: Model
    history: tuple[State, ...]
    flow: Flow
    next_dt: float
    rejected: int
    rate: float
    rest: Rest | None = None
    ended: str | None = None
    tried: Array | None = None
    adapted: Adaptation | None = None
    solved: bool = False
    noise_kept: float = 1.0

    def __repr__(self) -> str:
        words = f"t = {self.state.t:.6g}, dt = {self.dt:.3g}, {len(self.state.r)} nodes"
        ended = "" if self.ended is None else f", {self.ended[:200]}"
        return f"Step({self.number}, {words}{ended})"

    @property
    def steady(self) -> bool:
        """Whether the cell does not change, and no small perturbation is known to grow.

        It need not be stable for that: see `stability`.
        """
        return self.rest is not None and not self.unstable

    @property
    def unstable(self) -> bool:
        """Whether the cell does not change, but a small perturbation grows."""
        return self._grows and not self.growth_not_seen

    @property
    def growth_not_seen(self) -> bool:
        """Whether a predicted growth has not appeared within MAX_GROWTH_TIMES growth times."""
        waited = 0.0 if self.rest is None else self.state.t - self.rest.since
        return self._grows and waited * (self.growth or 0.0) > MAX_GROWTH_TIMES

    @property
    def _grows(self) -> bool:
        least = max(UNSTABLE * self.model.rate, self.growth_error or 0.0)
        return (self.growth or 0.0) > least

    @property
    def growth(self) -> float | None:
        """Growth rate of the fastest growing perturbation [1/T] of a cell at rest, if known."""
        return None if self.rest is None else self.rest.growth.rate

    @property
    def growth_error(self) -> float | None:
        """Error of `growth` [1/T], without that of the mesh."""
        return None if self.rest is None or self.growth is None else self.rest.growth.error

    @property
    def stability(self) -> str:
        """ "stable" or "unstable", as far as the error of the growth rate tells, or "unknown"."""
        if self.stability_problem:
            return "unknown"
        return "stable" if (self.growth or 0.0) < 0.0 else "unstable"

    @property
    def stability_problem(self) -> str:
        """Why it is not known whether the state is stable; empty if it is."""
        if self.rest is None:
            pending = awaited(self.model, self.state.t)
            return pending or "the cell still changes"
        if self.growth is None or self.growth_error is None:
            return self.rest.growth.problem
        if self.growth_not_seen:
            return (
                f"a growth rate of {self.growth:.3g} per unit time is predicted, but no growth "
                "appeared; the mesh may be too coarse, or time.max_step too long for an "
                "oscillation"
            )
        if abs(self.growth) <= self.growth_error:
            return (
                f"the growth rate of the fastest perturbation, {self.growth:.3g} per unit time, "
                f"is known only to +- {self.growth_error:.2g}"
            )
        return ""

    @property
    def cell(self) -> SurfaceCell:
        """The cell that the step led to, as observables see it."""
        return SurfaceCell(self.model, self.state, self.flow)

    @property
    def state(self) -> State:
        """The state that the step led to."""
        return self.history[0]

    @property
    def dt(self) -> float:
        """Length of the step [T]; 0 for an initial state."""
        return 0.0 if len(self.history) == 1 else self.state.t - self.history[1].t
