"""Cells that polarize and migrate by actin polymerization alone: simulation and theory.

The public names below are imported when first used, so that `import amoeboid` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from amoeboid import figures
    from amoeboid.closed_forms.branch import prediction
    from amoeboid.closed_forms.linear import growth_rate, thresholds
    from amoeboid.closed_forms.points import points
    from amoeboid.closed_forms.response import polarization_by_cue
    from amoeboid.config import Config, config_from_toml, config_to_toml
    from amoeboid.explorer.notebook import explore
    from amoeboid.fitting.fit import fit
    from amoeboid.fitting.measurements import Measurements, measurements
    from amoeboid.fitting.result import Fit
    from amoeboid.fitting.synthetic import synthetic
    from amoeboid.meshes.cells import InitialCell
    from amoeboid.model.changes import Change, ramp, smooth, steps
    from amoeboid.model.cues import Cue
    from amoeboid.model.parameters import Parameters, parameters_from_toml, parameters_to_toml
    from amoeboid.model.polymerization import Custom, Exponential, Inverse, Law
    from amoeboid.model.stress import Stress
    from amoeboid.motility.cells import MeasuredCell
    from amoeboid.motility.contacts import Channel, Patch, Plates
    from amoeboid.motility.environments import (
        CortexDrag,
        Environment,
        Fluid,
        Matrix,
        Mixed,
    )
    from amoeboid.observables import OBSERVABLES, Cell, Observable, observable, observed
    from amoeboid.runs.analysis import Kymograph, Spectrum
    from amoeboid.runs.branches import branch
    from amoeboid.runs.meshes import Icosphere, Surface
    from amoeboid.runs.persistence import Persistence, persistence
    from amoeboid.runs.snapshot import Snapshot
    from amoeboid.runs.solution import Solution, simulate
    from amoeboid.runs.steady_cell import SteadyCell, steady_state
    from amoeboid.runs.stored import StoredRun, load
    from amoeboid.sections import Initial, Mesh, Noise, Output, Time
    from amoeboid.simulation.events import steady, time, when
    from amoeboid.simulation.loop import evolve, start
    from amoeboid.simulation.step import Step
    from amoeboid.simulation.step_length import Diverged
    from amoeboid.studies.branch import Branch, SpecialPoint
    from amoeboid.studies.many import ManySteadyStates, many_steady_states
    from amoeboid.studies.migration import Migration, migrate
    from amoeboid.studies.phase_diagram import PhaseDiagram, phase_diagram
    from amoeboid.studies.states import SteadyState, SteadyStates, steady_states
    from amoeboid.studies.theory import Theory, theory
    from amoeboid.surface.model import Model
    from amoeboid.surface.state import Flow, State
    from amoeboid.sweeps.points import Points, grid, paired, sobol
    from amoeboid.sweeps.refinement import Refinement, refine
    from amoeboid.sweeps.result import Sweep, load_sweep
    from amoeboid.sweeps.sweep import sweep
    from amoeboid.validation import InvalidInput

_HOMES = {
    "Branch": "studies.branch",
    "Cell": "observables",
    "Change": "model.changes",
    "Channel": "motility.contacts",
    "Config": "config",
    "CortexDrag": "motility.environments",
    "Cue": "model.cues",
    "Custom": "model.polymerization",
    "Diverged": "simulation.step_length",
    "Environment": "motility.environments",
    "Exponential": "model.polymerization",
    "Fit": "fitting.result",
    "Flow": "surface.state",
    "Fluid": "motility.environments",
    "Icosphere": "runs.meshes",
    "Initial": "sections",
    "InitialCell": "meshes.cells",
    "InvalidInput": "validation",
    "Inverse": "model.polymerization",
    "Kymograph": "runs.analysis",
    "Law": "model.polymerization",
    "Matrix": "motility.environments",
    "MeasuredCell": "motility.cells",
    "ManySteadyStates": "studies.many",
    "Measurements": "fitting.measurements",
    "Mesh": "sections",
    "Migration": "studies.migration",
    "Mixed": "motility.environments",
    "Model": "surface.model",
    "Noise": "sections",
    "OBSERVABLES": "observables",
    "Observable": "observables",
    "Output": "sections",
    "Parameters": "model.parameters",
    "Patch": "motility.contacts",
    "Persistence": "runs.persistence",
    "PhaseDiagram": "studies.phase_diagram",
    "Plates": "motility.contacts",
    "Points": "sweeps.points",
    "Refinement": "sweeps.refinement",
    "Snapshot": "runs.snapshot",
    "Solution": "runs.solution",
    "SpecialPoint": "studies.branch",
    "Spectrum": "runs.analysis",
    "State": "surface.state",
    "SteadyCell": "runs.steady_cell",
    "SteadyState": "studies.states",
    "SteadyStates": "studies.states",
    "Step": "simulation.step",
    "StoredRun": "runs.stored",
    "Stress": "model.stress",
    "Surface": "runs.meshes",
    "Sweep": "sweeps.result",
    "Theory": "studies.theory",
    "Time": "sections",
    "branch": "runs.branches",
    "config_from_toml": "config",
    "config_to_toml": "config",
    "evolve": "simulation.loop",
    "explore": "explorer.notebook",
    "figures": "figures",
    "fit": "fitting.fit",
    "grid": "sweeps.points",
    "growth_rate": "closed_forms.linear",
    "load": "runs.stored",
    "load_sweep": "sweeps.result",
    "measurements": "fitting.measurements",
    "migrate": "studies.migration",
    "many_steady_states": "studies.many",
    "observable": "observables",
    "observed": "observables",
    "paired": "sweeps.points",
    "parameters_from_toml": "model.parameters",
    "parameters_to_toml": "model.parameters",
    "persistence": "runs.persistence",
    "phase_diagram": "studies.phase_diagram",
    "points": "closed_forms.points",
    "polarization_by_cue": "closed_forms.response",
    "prediction": "closed_forms.branch",
    "ramp": "model.changes",
    "refine": "sweeps.refinement",
    "simulate": "runs.solution",
    "smooth": "model.changes",
    "sobol": "sweeps.points",
    "start": "simulation.loop",
    "steady": "simulation.events",
    "steady_state": "runs.steady_cell",
    "steady_states": "studies.states",
    "steps": "model.changes",
    "sweep": "sweeps.sweep",
    "synthetic": "fitting.synthetic",
    "theory": "studies.theory",
    "thresholds": "closed_forms.linear",
    "time": "simulation.events",
    "when": "simulation.events",
}

__all__ = [
    "OBSERVABLES",
    "Branch",
    "Cell",
    "Change",
    "Channel",
    "Config",
    "CortexDrag",
    "Cue",
    "Custom",
    "Diverged",
    "Environment",
    "Exponential",
    "Fit",
    "Flow",
    "Fluid",
    "Icosphere",
    "Initial",
    "InitialCell",
    "InvalidInput",
    "Inverse",
    "Kymograph",
    "Law",
    "ManySteadyStates",
    "Matrix",
    "MeasuredCell",
    "Measurements",
    "Mesh",
    "Migration",
    "Mixed",
    "Model",
    "Noise",
    "Observable",
    "Output",
    "Parameters",
    "Patch",
    "Persistence",
    "PhaseDiagram",
    "Plates",
    "Points",
    "Refinement",
    "Snapshot",
    "Solution",
    "SpecialPoint",
    "Spectrum",
    "State",
    "SteadyCell",
    "SteadyState",
    "SteadyStates",
    "Step",
    "StoredRun",
    "Stress",
    "Surface",
    "Sweep",
    "Theory",
    "Time",
    "branch",
    "config_from_toml",
    "config_to_toml",
    "evolve",
    "explore",
    "figures",
    "fit",
    "grid",
    "growth_rate",
    "load",
    "load_sweep",
    "many_steady_states",
    "measurements",
    "migrate",
    "observable",
    "observed",
    "paired",
    "parameters_from_toml",
    "parameters_to_toml",
    "persistence",
    "phase_diagram",
    "points",
    "polarization_by_cue",
    "prediction",
    "ramp",
    "refine",
    "simulate",
    "smooth",
    "sobol",
    "start",
    "steady",
    "steady_state",
    "steady_states",
    "steps",
    "sweep",
    "synthetic",
    "theory",
    "thresholds",
    "time",
    "when",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'amoeboid' has no attribute {name!r}")
    home = import_module(f"amoeboid.{_HOMES[name]}")
    return home if _HOMES[name] == name else getattr(home, name)


def __dir__() -> list[str]:
    return sorted(__all__)
