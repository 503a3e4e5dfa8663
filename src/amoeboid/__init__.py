"""Cells that polarize and migrate by actin polymerization alone: simulation and theory.

The public names below are imported when first used, so that `import amoeboid` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from amoeboid.axisymmetric.branches import branch_from_sphere, steady_states
    from amoeboid.axisymmetric.stability import unstable_modes
    from amoeboid.closed_forms.branch import prediction
    from amoeboid.closed_forms.linear import growth_rate, thresholds
    from amoeboid.closed_forms.points import points
    from amoeboid.closed_forms.response import polarization_by_cue
    from amoeboid.config import (
        Config,
        Initial,
        Mesh,
        Output,
        Time,
        config_from_toml,
        config_to_toml,
    )
    from amoeboid.model.changes import Change, ramp, smooth, steps
    from amoeboid.model.cues import Cue
    from amoeboid.model.parameters import Parameters, parameters_from_toml, parameters_to_toml
    from amoeboid.model.polymerization import Custom, Exponential, Inverse, Law
    from amoeboid.model.stress import Stress
    from amoeboid.observables import OBSERVABLES, observed
    from amoeboid.simulation.loop import Diverged, Step, evolve, start
    from amoeboid.surface.model import Model
    from amoeboid.surface.state import Flow, State
    from amoeboid.validation import InvalidInput

_HOMES = {
    "Change": "model.changes",
    "Config": "config",
    "Cue": "model.cues",
    "Custom": "model.polymerization",
    "Diverged": "simulation.loop",
    "Exponential": "model.polymerization",
    "Flow": "surface.state",
    "Initial": "config",
    "InvalidInput": "validation",
    "Inverse": "model.polymerization",
    "Law": "model.polymerization",
    "Mesh": "config",
    "Model": "surface.model",
    "OBSERVABLES": "observables",
    "Output": "config",
    "Parameters": "model.parameters",
    "State": "surface.state",
    "Step": "simulation.loop",
    "Stress": "model.stress",
    "Time": "config",
    "branch_from_sphere": "axisymmetric.branches",
    "config_from_toml": "config",
    "config_to_toml": "config",
    "evolve": "simulation.loop",
    "growth_rate": "closed_forms.linear",
    "observed": "observables",
    "parameters_from_toml": "model.parameters",
    "parameters_to_toml": "model.parameters",
    "points": "closed_forms.points",
    "polarization_by_cue": "closed_forms.response",
    "prediction": "closed_forms.branch",
    "ramp": "model.changes",
    "smooth": "model.changes",
    "start": "simulation.loop",
    "steady_states": "axisymmetric.branches",
    "steps": "model.changes",
    "thresholds": "closed_forms.linear",
    "unstable_modes": "axisymmetric.stability",
}

__all__ = [
    "OBSERVABLES",
    "Change",
    "Config",
    "Cue",
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
    "Stress",
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
    "polarization_by_cue",
    "prediction",
    "ramp",
    "smooth",
    "start",
    "steady_states",
    "steps",
    "thresholds",
    "unstable_modes",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'amoeboid' has no attribute {name!r}")
    return getattr(import_module(f"amoeboid.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
