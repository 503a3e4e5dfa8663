"""A branch of steady states in one parameter: its states, folds, bifurcations and stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral, Real
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.bifurcations import BranchPoint
from amoeboid.axisymmetric.branches import polarized_branch
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.progress import Watch, unwatched
from amoeboid.axisymmetric.tracing import BranchSolution
from amoeboid.display import html_picture, plotted
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.numerics.continuation import Options
from amoeboid.studies import observed
from amoeboid.studies.columns import (
    Column,
    column,
    dataset,
    frame,
    html,
    physical_number,
    quantity,
    shortened,
    text,
    value_of,
    with_units,
)
from amoeboid.studies.recorded import Recorded, along, optional, single
from amoeboid.studies.states import SHOWN, SteadyState, states_columns, states_rows
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

FOLD, HOPF, BIFURCATION = "fold", "Hopf bifurcation", "bifurcation"
MAX_LISTED = 3
MAX_STEP, MAX_POINTS = 0.1, 400


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint:
    """A point of a branch at which a mode of azimuthal number m is neutral.

    `kind` is "fold", "bifurcation" or "Hopf bifurcation"; `piece` the stretch that it lies on and
    `length` its place there. `state` is the state there, `name` the parameter. m is None where the
    cell has no axis.
    """

    kind: str
    name: str
    m: int | None
    state: Any
    piece: int
    length: float

    @property
    def number(self) -> float:
        """The value of the parameter in the units of the solver."""
        return self.state.parameters.value(self.name)

    @property
    def value(self) -> Any:
        """The value of the parameter, with its unit if the cell has physical ones."""
        return quantity(
            self.state.parameters, self.number, self.state.parameters.dimension(self.name)
        )

    def __repr__(self) -> str:
        at = text(
            self.state.parameters, self.number, self.state.parameters.dimension(self.name), "#.9g"
        )
        return f"{self.what} at {self.name} = {at}"

    @property
    def what(self) -> str:
        """What the point is, in words."""
        mode = "" if self.kind == FOLD or self.m is None else f" of m = {self.m}"
        return f"{self.kind}{mode}"


@dataclass(frozen=True, eq=False, repr=False)
class Branch:
    """A branch of steady states in the parameter `name`, inside the window that was asked for.

    The values of the parameter are `values`, also under its own name (`branch.v_p0`); every
    observable is an array along the branch (`branch.max_retrograde_speed`). With physical
    parameters they are quantities with units. Folds are not among the points.

    `states`: the states, piece after piece; `piece` (points,) the number of the stretch that each
    lies on. `folds` and `bifurcations` are located exactly. `thresholds` are the values at which
    the branch leaves or meets the homogeneous sphere. `complete` says that it was followed to its
    ends; `problems` says what may be missing, and why. In the units of the solver: `pieces` are the
    states by stretch, `lengths` their places there, `origins` the numbers of `thresholds`.
    """

    parameters: Parameters
    name: str
    pieces: tuple[tuple[Any, ...], ...]
    lengths: tuple[tuple[float, ...], ...]
    folds: tuple[SpecialPoint, ...]
    bifurcations: tuple[SpecialPoint, ...]
    origins: tuple[float, ...]
    complete: bool
    problems: tuple[str, ...]

    @cached_property
    def states(self) -> tuple[Any, ...]:
        """All states, piece after piece."""
        return tuple(state for piece in self.pieces for state in piece)

    @cached_property
    def piece(self) -> Array:
        """The number of the stretch that each state lies on (points,), from 0 [1]."""
        return np.repeat(np.arange(len(self.pieces)), [len(piece) for piece in self.pieces])

    @property
    def numbers(self) -> Array:
        """The values of the parameter (points,) in the units of the solver."""
        return np.array([state.parameters.value(self.name) for state in self.states])

    @property
    def values(self) -> Any:
        """The values of the parameter (points,)."""
        return quantity(self.parameters, self.numbers, self.parameters.dimension(self.name))

    @property
    def thresholds(self) -> Any:
        """Values of the parameter at which the branch leaves or reaches the sphere, an array."""
        return quantity(
            self.parameters, np.array(self.origins), self.parameters.dimension(self.name)
        )

    @property
    def stable(self) -> Array:
        """Whether each state is stable (points,)."""
        return np.array([state.stable for state in self.states], dtype=bool)

    def observables(self) -> tuple[str, ...]:
        """The names of what every state has a number for."""
        return observed.names_of(self.parameters)

    @staticmethod
    def dimension(name: str) -> str | None:
        """The dimension of what `name` of `recorded` or `columns` is; None where none is stated."""
        return observed.dimension(name)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in (*self.parameters.names, *self.observables()):
            raise AttributeError(f"a branch has no attribute {name!r}")
        if name == self.name:
            return self.values
        if name in self.parameters.names:
            raise AttributeError(
                f"the branch varies {self.name!r}; {name} is constant along it: "
                f"branch.parameters.{name}"
            )
        found = np.array([state.number(name) for state in self.states])
        return quantity(self.parameters, found, self.dimension(name))

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), self.name, *self.observables()})

    def __len__(self) -> int:
        return len(self.states)

    @property
    def columns(self) -> dict[str, Column]:
        """The parameter, the observables and the stability along the branch."""
        along = column(self.parameters, self.numbers, self.parameters.dimension(self.name))
        piece = column(self.parameters, self.piece)
        return {self.name: along, **self._state_columns(), "piece": piece}

    def _state_columns(self) -> dict[str, Column]:
        return states_columns(self.parameters, self.states)

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row a state; its `attrs["units"]` holds the units."""
        return frame(self.columns, "point")

    def to_xarray(self) -> Any:
        """An xarray.Dataset along the dimension `point`, the parameter a coordinate."""
        return dataset(
            self.columns,
            "point",
            (self.name, "piece"),
            complete=int(self.complete),
            problems=list(self.problems),
        )

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: thresholds, folds and bifurcations, and the branch point by point.

        Values of the parameter at a fold are under `fold_v_p0`, those along the branch under its
        own name.
        """
        p, dimension = self.parameters, self.parameters.dimension(self.name)
        special = {
            f"threshold_{self.name}": ("threshold_number", self.origins),
            f"fold_{self.name}": ("fold_number", [s.number for s in self.folds]),
            f"bifurcation_{self.name}": (
                "bifurcation_number",
                [s.number for s in self.bifurcations],
            ),
        }
        found = single(p, {"n_folds": (len(self.folds), None)})
        for name, (dim, numbers) in special.items():
            found |= along(dim, {name: column(p, np.array(numbers, dtype=float), dimension)})
        modes = [-1 if s.m is None else s.m for s in self.bifurcations]
        found |= optional(
            along("bifurcation_number", {"bifurcation_m": Column(np.array(modes), "")})
        )
        return found | along("branch_point", self.columns)

    def plot(self, ax: Any = None, observable: str = "max_retrograde_speed") -> Any:
        """Draw an observable along the branch, solid where stable. Takes and returns axes.

        Folds, bifurcations and thresholds are marked. Raises InvalidInput for an unknown
        observable.
        """
        if observable not in self.observables():
            raise InvalidInput(
                f"observable must be one of {', '.join(self.observables())}, got {observable!r}"
            )
        return plotted(self, "branches.draw_branch", ax, observable=observable)

    def plain(self, number: float) -> float:
        """A `number` of the parameter as programs read it, in its customary unit if it has one."""
        return physical_number(self.parameters, number, self.parameters.dimension(self.name))

    def _at(self, number: float) -> str:
        return text(self.parameters, number, self.parameters.dimension(self.name), "#.6g")

    def _events(self) -> list[str]:
        found = []
        groups = (
            ("threshold", self.origins),
            ("fold", [p.number for p in self.folds]),
            ("Hopf bifurcation", [p.number for p in self.bifurcations if p.kind == HOPF]),
            ("bifurcation", [p.number for p in self.bifurcations if p.kind == BIFURCATION]),
        )
        for noun, numbers in groups:
            if numbers:
                plural = noun if len(numbers) == 1 else f"{noun}s"
                found.append(f"{plural} {_listed([self._at(number) for number in numbers])}")
        return found

    @property
    def _heading(self) -> str:
        found = "complete" if self.complete else "incomplete"
        return f"Branch in {self.name}: {', '.join([*self._events(), found])}"

    def __repr__(self) -> str:
        lines = [self._heading]
        for piece in self.pieces[:MAX_LISTED]:
            ends = (self._at(s.parameters.value(self.name)) for s in (piece[0], piece[-1]))
            counted = self._stable_count(piece)
            lines.append(f"{len(piece)} states from {self.name} = {' to '.join(ends)}{counted}")
        if len(self.pieces) > MAX_LISTED:
            lines.append(f"... and {len(self.pieces) - MAX_LISTED} more pieces")
        return "\n".join([*lines, *(f"- {t}" for t in shortened(self.problems, 2, "problems"))])

    def rows(
        self, states: Sequence[Any], names: Sequence[str]
    ) -> tuple[list[str], list[list[str]]]:
        """Titles and cells of a table of states: the observables `names`, and their stability."""
        return states_rows(states, names)

    def stability_of(self, state: Any, neutral: int | None = -1) -> dict[str, Any]:
        """What programs read of the stability of a state.

        Where it is a special point, `neutral` is its m: of that mode nothing is said.
        """
        counts = state.unstable_modes.items()
        return {
            "stable": state.stable if neutral == -1 else None,
            "unstable_modes": {str(m): None if m == neutral else count for m, count in counts},
        }

    def _stable_count(self, piece: Sequence[Any]) -> str:
        return f", {sum(state.stable for state in piece)} of them stable"

    def _repr_html_(self) -> str:
        notes = shortened(self.problems, 20, "problems", 500)
        columns = {name: self.columns[name] for name in (self.name, *SHOWN, "stable")}
        return html(self._heading, columns, notes) + html_picture(self, "branches.draw_branch")


def _listed(texts: Sequence[str]) -> str:
    left_out = len(texts) - MAX_LISTED
    more = f" and {left_out} more" if left_out > 0 else ""
    return f"{', '.join(texts[:MAX_LISTED])}{more}"


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
