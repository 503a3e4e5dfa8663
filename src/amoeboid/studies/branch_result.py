"""A branch of steady states and its special points, as users see them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.display import html_picture, plotted
from amoeboid.model.parameters import Parameters
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
)
from amoeboid.studies.recorded import Recorded, along, optional, single
from amoeboid.studies.states import SHOWN, states_columns, states_rows
from amoeboid.validation import InvalidInput

FOLD, HOPF, BIFURCATION = "fold", "Hopf bifurcation", "bifurcation"
MAX_LISTED = 3


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
