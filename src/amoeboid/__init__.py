"""Cells that polarize and migrate by actin polymerization alone: simulation and theory.

The public names below are imported when first used, so that `import amoeboid` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from amoeboid.axisymmetric.branches import branch_from_sphere, steady_states
    from amoeboid.axisymmetric.stability import unstable_modes
    from amoeboid.config import (
        Config,
        Initial,
        Mesh,
        Output,
        Time,
        config_from_toml,
        config_to_toml,
    )
    from amoeboid.observables import OBSERVABLES, observed
    from amoeboid.parameters import Parameters, parameters_from_toml, parameters_to_toml
    from amoeboid.polymerization import Custom, Exponential, Inverse, Law
    from amoeboid.simulation import Diverged, Step, evolve, start
    from amoeboid.surface.model import Flow, Model, State
    from amoeboid.theory.branch import prediction
    from amoeboid.theory.linear import growth_rate, thresholds
    from amoeboid.theory.points import points
    from amoeboid.validation import InvalidInput

_HOMES = {
    "Config": "config",
    "Custom": "polymerization",
    "Diverged": "simulation",
    "Exponential": "polymerization",
    "Flow": "surface.model",
    "Initial": "config",
    "InvalidInput": "validation",
    "Inverse": "polymerization",
    "Law": "polymerization",
    "Mesh": "config",
    "Model": "surface.model",
    "OBSERVABLES": "observables",
    "Output": "config",
    "Parameters": "parameters",
    "State": "surface.model",
    "Step": "simulation",
    "Time": "config",
    "branch_from_sphere": "axisymmetric.branches",
    "config_from_toml": "config",
    "config_to_toml": "config",
    "evolve": "simulation",
    "growth_rate": "theory.linear",
    "observed": "observables",
    "parameters_from_toml": "parameters",
    "parameters_to_toml": "parameters",
    "points": "theory.points",
    "prediction": "theory.branch",
    "start": "simulation",
    "steady_states": "axisymmetric.branches",
    "thresholds": "theory.linear",
    "unstable_modes": "axisymmetric.stability",
}

__all__ = [
    "OBSERVABLES",
    "Config",
    "Custom",
    "Diverged",
    "Exponential",
    "Flow",
    "Initial",
    "InvalidInput",
    "Inverse",
    "Law",
    "Mesh",
    "Model",
    "Output",
    "Parameters",
    "State",
    "Step",
    "Time",
    "branch_from_sphere",
    "config_from_toml",
    "config_to_toml",
    "evolve",
    "growth_rate",
    "observed",
    "parameters_from_toml",
    "parameters_to_toml",
    "points",
    "prediction",
    "start",
    "steady_states",
    "thresholds",
    "unstable_modes",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'amoeboid' has no attribute {name!r}")
    return getattr(import_module(f"amoeboid.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
