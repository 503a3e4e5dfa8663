"""One semi-implicit time step: geometry, v_p(c), force balance, shape, concentration.

Second order in time, with steps of any length: backward differences (numerics/multistep.py) for
shape and concentration. The implicit equations are solved by a simplified Newton iteration from the
extrapolated past, accelerated (numerics/passes.py): the viscous operator is factorized once a step,
there, and anew only where that converges slowly, as on shapes whose resistance changes as they
move. Linearized are viscosity, tension (on the normal motion), advection, diffusion and turnover.
The area is exact after every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import (
    LEAST_QUALITY,
    Geometry,
    area_along,
    face_vectors,
    geometry,
    mesh_quality,
    node_areas,
    normal_part,
    volume_centroid,
)
from amoeboid.meshes.intersections import embedded
from amoeboid.meshes.relaxation import relaxation
from amoeboid.numerics.multistep import backward_difference, error_share, extrapolated
from amoeboid.numerics.passes import Pass, left_to_come, overshoot
from amoeboid.surface.force_balance import TensionFlow, cortex, force_balance
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import spin, turned, turning_rate
from amoeboid.surface.state import Flow, State
from amoeboid.surface.transport import transported

AREA_TOLERANCE = 1e-13
ROUNDING = 1e-12
# Share of the way to their resting place that nodes drift in a time 1/model.rate, at most half of
# it in one step.
MESH_RELAXATION = 1.0
# The implicit equations count as solved when what is still to come is no more than this share of
# the largest change by a pass, ...
CONVERGED = 0.1
# ... and no more than this share of the error of the step, or of the tolerance for it.
SHARE_OF_ERROR, SHARE_OF_TOLERANCE = 0.3, 0.03
NO_CHANGE = 1e-9
MOST_PASSES = 15
# So many passes are made with one factorization; every later one has its own, where the shape is.
PATIENCE = 6


class StepFailed(ArithmeticError):
    """The step could not be made; the message says why. A shorter one may succeed."""


def semi_implicit_step(
    model: Model,
    history: Sequence[State],
    dt: float,
    before: Flow | None = None,
    tolerance: float = np.inf,
) -> tuple[State, Flow, float]:
    """The state after dt, the flow that led there, and the error of the step.

    `history`: the present state and, if there are, those of the steps before. Two make the step;
    from the present state alone it is of first order. `before`: the flow of the last step, on the
    same mesh, which makes the passes converge faster. `tolerance`: the error allowed in the step;
    the passes may take a small share of it. Parameters and cue are those at the end of the step,
    where the equations hold. Raises StepFailed, SingularMatrix.
    """
    t = history[0].t + dt
    model = model.at(t, since=history[0].t)
    turns = _turning_foreseen(model, history, t, before)
    past = _past(model, history, turns, t)
    now, r_ahead, c_ahead = history[0], past.ahead.r, np.maximum(past.ahead.c, 0.0)
    r_known, implicit = past.known[0].r, past.known[0].dt
    g = geometry(r_ahead, model.mesh.faces)
    v_c = None if before is None else turned(before.v_c, turns, dt)
    near = cortex(model, r_ahead, g, implicit, now.zeta0, v_c)
    drift = min(MESH_RELAXATION * model.rate, 0.5 / dt) * relaxation(r_ahead, g, model.mesh)

    scaled = _Scales(1.0 / (model.parameters.c0 + c_ahead), g.normals / model.parameters.R0)
    r, c, zeta0, v_c = r_ahead, c_ahead, now.zeta0, None
    r_before, c_before = r, c
    x = scaled.unknowns(r, c)
    passes: list[Pass] = []
    while True:
        if len(passes) >= PATIENCE:
            near = cortex(model, r, g, implicit, zeta0, v_c)
        solution = force_balance(model, near, r, g, c, zeta0, r - r_known, v_c, turns)
        start = r_known + implicit * drift
        r_new, zeta0 = area_preserving_move(model, start, g, solution, implicit, zeta0)
        v = solution.v(zeta0)
        v_c = v - solution.v_p
        whole = spin(turns, r - volume_centroid(r, model.mesh.faces))
        flow = Flow(v_c + whole, solution.v_p, zeta0, g.normals, g.node_areas)
        g = geometry(r_new, model.mesh.faces)
        c_new, order = _concentration(model, past.known, r_new, g, v, c)
        passes.append(Pass(x, scaled.unknowns(r_new, c_new)))
        of_order = past.expected if order == len(past.states) else past.ahead
        error = local_error(model, of_order, (r_new, c_new), flow.normals)
        if _converged(passes, max(SHARE_OF_ERROR * error, SHARE_OF_TOLERANCE * tolerance)):
            break
        r, c = r_new, c_new
        if len(passes) > 1:
            further = overshoot(*passes[-2:])
            r = r_new + further * (r_new - r_before)
            c = np.maximum(c_new + further * (c_new - c_before), 0.0)
            g = geometry(r, model.mesh.faces)
        x, r_before, c_before = scaled.unknowns(r, c), r_new, c_new
    position = _position(model, past.states, t, r_new, flow)
    turning = turning_rate(model, r_new, c_new, g, flow.v)
    new = State(t, r_new, c_new, zeta0, position, turning)
    check_step(model, past.states[0], new)
    return new, flow, error


def starting_step(
    model: Model,
    now: State,
    dt: float,
    before: Flow | None,
    tolerance: float,
) -> tuple[State, Flow, float]:
    """The state after dt from one without a past, the flow there, and the error of the step.

    Two implicit Euler steps of half the length; how far one of the whole length ends from there is
    their error. Damps what a new mesh has put out of balance, which no past could foresee.
    """
    now = replace(now, turning=_turning_foreseen(model, (now,), now.t + dt, before))
    whole, _, _ = semi_implicit_step(model, (now,), dt, before, tolerance)
    half, flow, _ = semi_implicit_step(model, (now,), 0.5 * dt, before, tolerance)
    new, flow, _ = semi_implicit_step(model, (half,), 0.5 * dt, flow, tolerance)
    return new, flow, difference(model, (new.r, new.c), (whole.r, whole.c), flow.normals)


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Nodes `r` (V, 3) and `c` (V,) at a time, extrapolated from past states.

    `share`: how much of the distance from there is error of the step to that time.
    """

    share: float
    r: Array
    c: Array


def foreseen(history: Sequence[State], t: float) -> Foreseen:
    """What all of `history` foresees for time t. Two states know of the error of a first-order
    step, a single one of none."""
    times = [state.t for state in history]
    r = extrapolated(times, [state.r for state in history], t)
    c = extrapolated(times, [state.c for state in history], t)
    return Foreseen(error_share(times, t) if len(times) > 1 else 0.0, r, c)


def local_error(
    model: Model, expected: Foreseen, new: tuple[Array, Array], normals: Array
) -> float:
    """Local error of a step to `new` (r, c), relative to R0 and c0 + |c|.

    From the distance to what was foreseen; nodes that move within the surface make no error.
    """
    return expected.share * difference(model, new, (expected.r, expected.c), normals)


@dataclass(frozen=True, eq=False)
class _Known:
    """What is known of nodes `r` (V, 3) and `filaments` (V,) before an implicit step of dt and of
    this order."""

    r: Array
    filaments: Array
    dt: float
    order: int


@dataclass(frozen=True, eq=False)
class _Past:
    """What the past says of a step: its `states`, as many as the step is made from, what these and
    what all states foresee, and what is known before the step, by order."""

    states: Sequence[State]
    ahead: Foreseen
    expected: Foreseen
    known: list[_Known]


def _turning_foreseen(
    model: Model, history: Sequence[State], t: float, before: Flow | None
) -> Array:
    """The rate (3,) at which nodes turn in a step to time t: as fast as the cell, from the past.

    Any rate makes a consistent step: the equations are the same in all axes. This one changes
    smoothly from step to step, and leaves a cell that only turns at rest on its nodes. Where none
    is known a first step with resting nodes tells.
    """
    known = [s for s in history[:2] if s.turning is not None]
    if not known:
        now = replace(history[0], turning=np.zeros(3))
        known = [semi_implicit_step(model, (now,), t - now.t, before)[0]]
    return extrapolated(
        [s.t for s in known], [s.turning for s in known if s.turning is not None], t
    )


def _past(model: Model, history: Sequence[State], turning: Array, t: float) -> _Past:
    """The past in axes that turn at the rate `turning` (3,), and are those of the nodes at t."""
    turned_states = []
    for state in history:
        center = volume_centroid(state.r, model.mesh.faces)
        r = center + turned(state.r - center, turning, t - state.t)
        turned_states.append(replace(state, r=r))
    states = turned_states[:2]
    ahead, expected = foreseen(states, t), foreseen(turned_states, t)
    return _Past(states, ahead, expected, _known(model, states, t))


def _known(model: Model, past: Sequence[State], t: float) -> list[_Known]:
    """The known part of the step to time t, of second order if the past allows, and of first."""
    numbers = [state.c * node_areas(state.r, model.mesh.faces) for state in past]
    known = []
    for order in range(len(past), 0, -1):
        scheme = backward_difference([state.t for state in past[:order]], t)
        r = scheme.combined([state.r for state in past])
        known.append(_Known(r, scheme.combined(numbers), scheme.dt, order))
    return known


@dataclass(frozen=True, eq=False)
class _Scales:
    """Scales of the unknowns while a step is solved for: `c` (V,), `r` (V, 3) along the normals."""

    c: Array
    r: Array

    def unknowns(self, r: Array, c: Array) -> Array:
        """Relative concentration and normal position (2V,)."""
        return np.concatenate([c * self.c, np.einsum("vi,vi->v", r, self.r)])


def _converged(passes: Sequence[Pass], allowed: float) -> bool:
    """Whether the passes have solved the equations up to what is `allowed`. Raises StepFailed."""
    last = passes[-1].change
    if not np.isfinite(last):
        raise StepFailed("a node position or concentration is not finite")
    if len(passes) < 2:
        return False
    if last <= min(NO_CHANGE, allowed):
        return True
    largest = max(one.change for one in passes)
    solved = left_to_come(*passes[-2:]) <= min(CONVERGED * largest, allowed)
    if not solved and len(passes) >= MOST_PASSES:
        raise StepFailed("the implicit equations of the step do not converge")
    return solved


def difference(
    model: Model, a: tuple[Array, Array], b: tuple[Array, Array], normals: Array
) -> float:
    """Largest difference of two pairs (r, c), relative to R0 and c0 + c; nodes that move within
    the surface make none."""
    p = model.parameters
    c = np.abs(a[1] - b[1]) / (p.c0 + np.abs(a[1]))
    r = np.abs(np.einsum("vi,vi->v", a[0] - b[0], normals)) / p.R0
    return float(max(c.max(), r.max()))


def _concentration(
    model: Model,
    known: Sequence[_Known],
    r: Array,
    g: Geometry,
    v: Array,
    c_ahead: Array,
) -> tuple[Array, int]:
    """The filament balance: c (V,) on the nodes r (V, 3) that filaments of velocity v reach.

    And its order in time: the first, where the second would make c negative.
    """
    for before in known:
        if before.filaments.min() >= 0:
            relative = v - (r - before.r) / before.dt
            c = transported(model, before.filaments, g, relative, before.dt, c_ahead)
            if c.min() >= -ROUNDING * c.max():
                return np.maximum(c, 0.0), before.order
    raise StepFailed("the concentration would become negative, or is not finite")


def _position(model: Model, past: Sequence[State], t: float, r: Array, flow: Flow) -> Array:
    """Where the cell is in the frame in which the mean cortex velocity vanishes."""
    faces, scheme = model.mesh.faces, backward_difference([state.t for state in past], t)
    frames = [state.position - volume_centroid(state.r, faces) for state in past]
    mean_v_c = flow.node_areas @ flow.v_c / flow.node_areas.sum()
    frame = scheme.combined(frames) - scheme.dt * mean_v_c
    return np.asarray(frame + volume_centroid(r, faces))


def area_preserving_move(
    model: Model, start: Array, g: Geometry, solution: TensionFlow, dt: float, zeta0: float
) -> tuple[Array, float]:
    """Nodes moved by the normal velocity, with the tension that makes the area A0 (Newton)."""
    faces, A0 = model.mesh.faces, model.A0
    rest = start + dt * normal_part(solution.rest, g.normals)
    slope = dt * normal_part(solution.slope, g.normals)
    for _ in range(30):
        r = rest + zeta0 * slope
        found, growth = area_along(r, faces, slope)
        excess = found - A0
        if abs(excess) < AREA_TOLERANCE * A0:
            return r, zeta0
        if not (np.isfinite(excess) and growth < 0):
            break
        zeta0 -= excess / growth
    raise StepFailed("no tension keeps the area over this step")


def check_step(model: Model, old: State, new: State) -> None:
    """Raise StepFailed unless the new state is a cell on a mesh in order."""
    if not (np.all(np.isfinite(new.r)) and np.all(np.isfinite(new.c)) and np.isfinite(new.zeta0)):
        raise StepFailed("a node position, concentration or tension is not finite")
    before, after = (face_vectors(state.r, model.mesh.faces) for state in (old, new))
    if mesh_quality(new.r, model.mesh.faces) < LEAST_QUALITY:
        raise StepFailed(
            f"a triangle has degenerated (quality below {LEAST_QUALITY:g}): the cell deforms more "
            "than its mesh can follow; increase mesh.subdivisions or delta_P"
        )
    if np.einsum("fi,fi->f", before, after).min() <= 0:
        raise StepFailed("a triangle has turned over: the surface folds, or its mesh is too coarse")
    if not embedded(new.r, model.mesh.faces):
        raise StepFailed(
            "the surface crosses itself: parts of the cell have met; this model has no contact"
        )
