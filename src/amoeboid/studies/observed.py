"""The observables of axisymmetric states, by name.

A cell with friction has one more, `friction_speed`: its speed U towards the front, which follows
from its force balance.
"""

from __future__ import annotations

from collections.abc import Iterable

from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.forces import friction
from amoeboid.model.parameters import Parameters
from amoeboid.motility.cells import surface_of
from amoeboid.observables import OBSERVABLES, Cell
from amoeboid.validation import refuse_unknown

OF_FRICTION = {"friction_speed": "L/T"}


def names() -> tuple[str, ...]:
    """The observables that an axisymmetric state has, those that a user registered included."""
    return tuple(n for n, known in OBSERVABLES.items() if not known.on_meshes and not known.vector)


def names_of(p: Parameters) -> tuple[str, ...]:
    """Those of a cell with these parameters."""
    return (*names(), *OF_FRICTION) if p.has_friction else names()


def checked(wanted: Iterable[str]) -> tuple[str, ...]:
    """Names of observables. Raises InvalidInput for one that no axisymmetric state has."""
    found = tuple(wanted)
    refuse_unknown(found, names(), "observable", "of an axisymmetric state")
    return found


def dimension(name: str) -> str | None:
    """The dimension of an observable; None where none is stated."""
    return OF_FRICTION[name] if name in OF_FRICTION else OBSERVABLES[name].dimension


def observed(solution: SteadySolution, name: str) -> float:
    """An observable of a state, in the units of its parameters."""
    return of_cell(solution.cell, name)


def of_cell(cell: Cell, name: str) -> float:
    """The same of any cell."""
    if name in OF_FRICTION:
        return float(friction.velocity(cell) @ surface_of(cell).front)
    return OBSERVABLES[name].values(name, cell)[0]
