"""The observables of axisymmetric states, by name."""

from __future__ import annotations

from collections.abc import Iterable

from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.observables import OBSERVABLES
from amoeboid.validation import refuse_unknown


def names() -> tuple[str, ...]:
    """The observables that an axisymmetric state has, those that a user registered included."""
    return tuple(n for n, known in OBSERVABLES.items() if not known.on_meshes and not known.vector)


def checked(wanted: Iterable[str]) -> tuple[str, ...]:
    """Names of observables. Raises InvalidInput for one that no axisymmetric state has."""
    found = tuple(wanted)
    refuse_unknown(found, names(), "observable", "of an axisymmetric state")
    return found


def dimension(name: str) -> str | None:
    """The dimension of an observable; None where none is stated."""
    return OBSERVABLES[name].dimension


def observed(solution: SteadySolution, name: str) -> float:
    """An observable of a state, in the units of its parameters."""
    return OBSERVABLES[name].values(name, solution.cell)[0]
