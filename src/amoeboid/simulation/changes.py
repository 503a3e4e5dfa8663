"""Parameters that change during a run: where steps end, when a run may end, what is written.

Steps end exactly at the breaks of the inputs (`model.inputs`) and start anew there with first
order, as on a new mesh: what was before a jump tells nothing of what comes. A run is not steady as
long as an input may still change.
"""

from __future__ import annotations

import math
from dataclasses import replace

from amoeboid.config import Config
from amoeboid.model.changes import CUE_STRENGTH
from amoeboid.surface.model import Model
from amoeboid.surface.state import State


def next_stop(model: Model, t: float, end: float) -> float:
    """The time beyond t that the next step must not cross: the next break, or `end`."""
    return end if model.inputs is None else min(end, model.inputs.next_break(t))


def after_break(model: Model, t: float) -> bool:
    """Whether an input has just stopped to be smooth at time t."""
    return t in model.breaks


def landed(state: State, stop: float, at_stop: bool) -> State:
    """`state` at exactly the time `stop` if its step was made to end there."""
    return replace(state, t=stop) if at_stop else state


def awaited(model: Model, t: float) -> str:
    """Why a cell that does not change at time t may change again; empty if nothing will."""
    if model.noise is not None:
        return "shot noise changes the cell until the end of the run"
    if model.inputs is None or model.inputs.until < t:
        return ""
    until = model.inputs.until
    if until == math.inf:
        return "a parameter or cue changes with time until the end of the run"
    shown = model.parameters.quantity(until, "T")
    return f"a parameter or cue changes until t = {shown:g}"


def input_units(config: Config) -> dict[str, str | None]:
    """Columns of the time series for what changes, and their dimensions (None: not stated).

    A dot in a name becomes an underscore: cue_strength.
    """
    of = config.parameters.dimension
    return {_column(name): "1" if name == CUE_STRENGTH else of(name) for name in config.changes}


def input_values(model: Model) -> dict[str, float]:
    """The values of these columns at the time of the model; at a jump those before it."""
    if model.inputs is None:
        return {}
    return {_column(name): _value(model, name) for name in model.inputs.changes}


def _column(name: str) -> str:
    return name.replace(".", "_")


def _value(model: Model, name: str) -> float:
    return float(model.cue.strength if name == CUE_STRENGTH else model.parameters.value(name))
