"""Cells that polarize and migrate by actin polymerization alone: simulation and theory.

The public names below are imported when first used, so that `import amoeboid` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from amoeboid.closed_forms.branch import prediction
    from amoeboid.closed_forms.linear import growth_rate, thresholds
    from amoeboid.closed_forms.points import points
    from amoeboid.config import (
        Config,
        Initial,
        Mesh,
        Output,
        Time,
        config_from_toml,
        config_to_toml,
    )
    from amoeboid.meshes.cells import InitialCell
    from amoeboid.model.parameters import Parameters, parameters_from_toml, parameters_to_toml
    from amoeboid.model.polymerization import Custom, Exponential, Inverse, Law
    from amoeboid.model.stress import Stress
    from amoeboid.observables import OBSERVABLES, observed
    from amoeboid.simulation.loop import Diverged, Step, evolve, start
    from amoeboid.studies.branch import Branch, SpecialPoint, branch
    from amoeboid.studies.phase_diagram import PhaseDiagram, phase_diagram
    from amoeboid.studies.states import SteadyState, SteadyStates, steady_states
    from amoeboid.studies.theory import Theory, theory
    from amoeboid.surface.model import Model
    from amoeboid.surface.state import Flow, State
    from amoeboid.validation import InvalidInput

_HOMES = {
    "Branch": "studies.branch",
    "Config": "config",
    "Custom": "model.polymerization",
    "Diverged": "simulation.loop",
    "Exponential": "model.polymerization",
    "Flow": "surface.state",
    "Initial": "config",
    "InitialCell": "meshes.cells",
    "InvalidInput": "validation",
    "Inverse": "model.polymerization",
    "Law": "model.polymerization",
    "Mesh": "config",
    "Model": "surface.model",
    "OBSERVABLES": "observables",
    "Output": "config",
    "Parameters": "model.parameters",
    "PhaseDiagram": "studies.phase_diagram",
    "SpecialPoint": "studies.branch",
    "State": "surface.state",
    "SteadyState": "studies.states",
    "SteadyStates": "studies.states",
    "Step": "simulation.loop",
    "Stress": "model.stress",
    "Theory": "studies.theory",
    "Time": "config",
    "branch": "studies.branch",
    "config_from_toml": "config",
    "config_to_toml": "config",
    "evolve": "simulation.loop",
    "growth_rate": "closed_forms.linear",
    "observed": "observables",
    "parameters_from_toml": "model.parameters",
    "parameters_to_toml": "model.parameters",
    "phase_diagram": "studies.phase_diagram",
    "points": "closed_forms.points",
    "prediction": "closed_forms.branch",
    "start": "simulation.loop",
    "steady_states": "studies.states",
    "theory": "studies.theory",
    "thresholds": "closed_forms.linear",
}

__all__ = [
    "OBSERVABLES",
    "Branch",
    "Config",
    "Custom",
    "Diverged",
    "Exponential",
    "Flow",
    "Initial",
    "InitialCell",
    "InvalidInput",
    "Inverse",
    "Law",
    "Mesh",
    "Model",
    "Output",
    "Parameters",
    "PhaseDiagram",
    "SpecialPoint",
    "State",
    "SteadyState",
    "SteadyStates",
    "Step",
    "Stress",
    "Theory",
    "Time",
    "branch",
    "config_from_toml",
    "config_to_toml",
    "evolve",
    "growth_rate",
    "observed",
    "parameters_from_toml",
    "parameters_to_toml",
    "phase_diagram",
    "points",
    "prediction",
    "start",
    "steady_states",
    "theory",
    "thresholds",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'amoeboid' has no attribute {name!r}")
    return getattr(import_module(f"amoeboid.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
