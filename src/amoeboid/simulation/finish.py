"""The end of a run that solves for its steady cell instead of waiting for it.

Whenever the rate of change of the cell, in axes that rotate with it, falls below another power of
ten from NEAR on, the steady cell next to it is sought by the iteration of `surface.steady`. It
replaces the state of the step if it is near, and if every perturbation of it is known to decay.
Otherwise the run continues unchanged. All of that follows from two steps, so that
a resumed run does the same.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from amoeboid.meshes.geometry import volume_centroid
from amoeboid.simulation.changes import awaited
from amoeboid.simulation.step import Step
from amoeboid.surface.relative_equilibrium import Moving
from amoeboid.surface.rigid import rotation, turns
from amoeboid.surface.stability import leading_growth_rate
from amoeboid.surface.steadiness import Rest, own_rate
from amoeboid.surface.steady import Found, NotSteady, steady_cell
from amoeboid.validation import InvalidInput

# A cell is near a steady one if it changes more slowly, in units of the rate, and if no unknown of
# it, c/(c0 + c) or the place of a node in units of R0, differs by more than the second.
NEAR, MAX_DISTANCE = 1e-2, 0.1


def solved_for(before: Step, step: Step) -> Step | None:
    """The step with the stable steady cell near its state; None if none is sought, or found.

    Raises InvalidInput for a cell under a cue: nodes that do not turn with it hold it at an angle
    to the cue, by the error of the mesh.
    """
    model, state = step.model, step.state
    if model.cue is not None:
        raise InvalidInput(
            'time.finish must be "wait" under a cue, got "solve", because the cell '
            "rotates until it is aligned; omit it"
        )
    if step.steady or awaited(model, state.t):
        return None
    rate, omega = own_rate(model, state, step.flow)
    if _decades(rate) <= _decades(own_rate(before.model, before.state, before.flow)[0]):
        return None
    if not turns(model, omega):
        omega = np.zeros(3)  # of a straight cell it is an error of the mesh
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    v_c = step.flow.v_c - rotation(omega, x)
    guess = Moving(state.r, state.c, state.zeta0, v_c, omega)
    try:
        found = steady_cell(model, guess)
    except NotSteady:
        return None
    if _distance(found, guess) > MAX_DISTANCE:
        return None
    return _ended(step, found)


def _decades(rate: float) -> int:
    """How many powers of ten a rate lies below NEAR, from 1 on."""
    return max(0, math.floor(math.log10(NEAR / max(rate, 1e-300))) + 1)


def _distance(found: Found, guess: Moving) -> float:
    p = found.model.parameters
    c, before = (cell.c / (p.c0 + cell.c) for cell in (found.cell, guess))
    moved = np.linalg.norm(found.cell.r - guess.r, axis=1)
    return float(max(np.abs(c - before).max(), moved.max() / p.R0))


def _ended(step: Step, found: Found) -> Step | None:
    """The step with a steady cell instead of its state, if that is stable."""
    t, cell = step.state.t, found.cell
    state = replace(found.state, t=t, position=step.state.position)
    relative = replace(found.flow, v_c=cell.v_c)
    growth = leading_growth_rate(step.model, state, relative, turning=cell.angular_velocity)
    if growth.rate is None or not growth.rate < -growth.error:
        return None
    history = (state, *step.history[1:])
    return replace(
        step, history=history, flow=found.flow, rate=found.rate, rest=Rest(t, growth), solved=True
    )
