"""The observables of axisymmetric states, by name."""

from __future__ import annotations

from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.observables import OBSERVABLES, UNITS


def names() -> tuple[str, ...]:
    """The observables that an axisymmetric state has."""
    return tuple(name for name in OBSERVABLES if hasattr(SteadySolution, name))


def dimension(name: str) -> str | None:
    """The dimension of an observable; None where none is stated."""
    return UNITS.get(name)


def observed(solution: SteadySolution, name: str) -> float:
    """An observable of a state, in the units of its parameters."""
    return float(getattr(solution, name))
