"""A branch of 3D cells as users see it, and the bifurcations on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.observables import OBSERVABLES
from amoeboid.runs.steady_cell import PATH
from amoeboid.studies import observed
from amoeboid.studies.branch import HOPF, Branch, SpecialPoint
from amoeboid.studies.columns import Column, column, physical_number, quantity, text, titled

PLURALS = {"straight": "straight cells", "circle": "circles", "helix": "helices"}
"""What cells of a path are called."""


@dataclass(frozen=True, eq=False, repr=False)
class CellBifurcation(SpecialPoint):
    """A point of a branch of 3D cells where a mode (2V,) is neutral: other cells meet it there.

    `leads_to`: the path of those, "circle", "helix", or "straight" with another shape. At a Hopf
    bifurcation it is "wobble": cells that oscillate about their path with the angular `frequency`,
    in the plane of a circle or out of it (`in_plane`, None where the cell is on no circle).

    `branch(..., through=point)` follows those that are steady.
    """

    mode: Array
    leads_to: str
    in_plane: bool | None
    plain_frequency: float

    @property
    def frequency(self) -> Any:
        """Angular frequency [1/T] of the neutral mode, 0 unless this is a Hopf bifurcation."""
        return quantity(self.state.parameters, self.plain_frequency, "1/T")

    @property
    def what(self) -> str:
        """See `SpecialPoint.what`, and what the bifurcation leads to."""
        if self.kind != HOPF:
            to = "" if self.m is not None else f" to {PLURALS[self.leads_to]}"
            return f"{super().what}{to}"
        plane = {True: " in their plane", False: " out of their plane", None: ""}[self.in_plane]
        often = text(self.state.parameters, self.plain_frequency, "1/T", ".4g")
        cells = PLURALS[self.state.path]
        return f"{super().what} to {cells} that wobble{plane}, frequency {often},"


class CellBranch(Branch):
    """A branch of 3D cells: see `Branch`. Its states are `SteadyCell`s.

    `turning`, `radius_of_curvature` and `torsion` of the paths are arrays along it, too, and
    `growth_rate` and `frequency` of the fastest perturbations. Where `branch` was told to leave the
    stability out, that of a state is found when it is asked for, and there are no bifurcations.
    """

    def rows(
        self, states: Sequence[Any], names: Sequence[str]
    ) -> tuple[list[str], list[list[str]]]:
        """Titles and cells of a table of cells: observables, path, growth rate, stability."""
        p = self.parameters
        shown = (*names, "turning", "torsion", "growth_rate")
        columns = [
            column(p, [state.number(name) for state in states], self.dimension(name))
            for name in shown
        ]
        titles = [
            titled(name, "" if p.units is None else c.unit)
            for name, c in zip(shown, columns, strict=True)
        ]
        cells = zip(*(c.texts for c in columns), (s.stability for s in states), strict=True)
        return [*titles, "stability"], [list(row) for row in cells]

    def stability_of(self, state: Any, neutral: int | None = -1) -> dict[str, Any]:
        """What programs read of the stability of a cell, and of its path."""
        p = self.parameters

        def number(name: str) -> float | None:
            found = state.number(name)
            return physical_number(p, found, PATH[name]) if np.isfinite(found) else None

        return {
            "path": state.path,
            "turning": number("turning"),
            "torsion": number("torsion"),
            "stable": state.stable if neutral == -1 else None,
            "growth_rate": number("growth_rate"),
            "frequency": number("frequency"),
        }

    def _stable_count(self, piece: Sequence[Any]) -> str:
        unknown = sum(state.known_stability is None for state in piece)
        if unknown:
            return f", the stability of {unknown} not asked for"
        return super()._stable_count(piece)

    def observables(self) -> tuple[str, ...]:
        """The names of what every cell has a number for."""
        known = tuple(name for name, one in OBSERVABLES.items() if not one.vector)
        of_friction = observed.OF_FRICTION if self.parameters.has_friction else ()
        return (*known, *of_friction, *PATH)

    @staticmethod
    def dimension(name: str) -> str | None:
        """The dimension of such a number; None where none is stated."""
        return PATH[name] if name in PATH else observed.dimension(name)

    def _state_columns(self) -> dict[str, Column]:
        p, found = self.parameters, {}
        for name in self.observables():
            values = [state.number(name) for state in self.states]
            found[name] = column(p, values, self.dimension(name))
        found["stable"] = column(p, np.array([s.stable for s in self.states], dtype=bool))
        found["stability"] = column(p, np.array([s.stability for s in self.states]))
        found["path"] = column(p, np.array([s.path for s in self.states]))
        return found
