"""One semi-implicit time step: geometry, v_p(c), force balance, shape, concentration.

Second order in time, with steps of any length: backward differences (numerics/multistep.py) for
shape and concentration. A simplified Newton iteration solves the implicit equations. It starts from
the extrapolated past and takes Anderson steps (numerics/iterations.py). The viscous operator is
factorized once per step, on the extrapolated shape. If the iteration converges slowly, as on shapes
whose viscous resistance changes as they move, the operator is factorized again. The iteration is
implicit in viscosity, tension (for the normal motion), advection, diffusion and turnover. The area
is exact after every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import (
    MIN_QUALITY,
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
from amoeboid.numerics.iterations import Iteration, anderson_step, remaining_error
from amoeboid.numerics.multistep import backward_difference, error_share, extrapolated
from amoeboid.surface.force_balance import TensionFlow, factorized_cortex, force_balance
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import angular_velocity, rotated, rotation
from amoeboid.surface.state import Flow, State
from amoeboid.surface.transport import transported

AREA_TOLERANCE = 1e-13
ROUNDING = 1e-12
# Nodes relax towards the mean center of their triangles at this rate, in units of model.rate, but
# by no more than half of the distance in one step.
MESH_RELAXATION = 1.0
# The implicit equations have converged when the remaining error is below this share of the largest
# change by an iteration, ...
CONVERGED = 0.1
# ... and below this share of the error of the step, or of the tolerance for it.
SHARE_OF_ERROR, SHARE_OF_TOLERANCE = 0.3, 0.03
NO_CHANGE = 1e-9
MAX_ITERATIONS = 15
# Iterations with one factorization; each later iteration factorizes again, on its own shape.
MAX_REUSES = 6


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

    `history`: the present state and up to two earlier ones. The step uses two of them; from the
    present state alone it is of first order. `before`: the flow of the last step, on the
    same mesh, which makes the iteration converge faster. `tolerance`: the error allowed in the
    step; the iteration may take a small share of it. Parameters and cue are those at the end of the
    step, where the equations hold. Raises StepFailed, SingularMatrix.
    """
    t = history[0].t + dt
    model = model.at(t, since=history[0].t)
    omega = _predicted_angular_velocity(model, history, t, before)
    past = _past(model, history, omega, t)
    now, r_ahead, c_ahead = history[0], past.ahead.r, np.maximum(past.ahead.c, 0.0)
    r_known, implicit = past.known[0].r, past.known[0].dt
    g = geometry(r_ahead, model.mesh.faces)
    v_c = None if before is None else rotated(before.v_c, omega, dt)
    factorized = factorized_cortex(model, r_ahead, c_ahead, g, implicit, now.zeta0, v_c)
    drift = min(MESH_RELAXATION * model.rate, 0.5 / dt) * relaxation(r_ahead, g, model.mesh)

    scaled = _Scaling(1.0 / (model.parameters.c0 + c_ahead), g.normals / model.parameters.R0)
    r, c, zeta0, v_c = r_ahead, c_ahead, now.zeta0, None
    r_before, c_before = r, c
    x = scaled.unknowns(r, c)
    iterations: list[Iteration] = []
    while True:
        if len(iterations) >= MAX_REUSES:
            factorized = factorized_cortex(model, r, c, g, implicit, zeta0, v_c)
        solution = force_balance(model, factorized, r, g, c, zeta0, r - r_known, v_c, omega)
        start = r_known + implicit * drift
        r_new, zeta0 = area_preserving_move(model, start, g, solution, implicit, zeta0)
        v = solution.v(zeta0)
        v_c = v - solution.v_p
        rigid = rotation(omega, r - volume_centroid(r, model.mesh.faces))
        flow = Flow(v_c + rigid, solution.v_p, zeta0, g.normals, g.node_areas)
        g = geometry(r_new, model.mesh.faces)
        c_new, order = _concentration(model, past.known, r_new, g, v, c)
        iterations.append(Iteration(x, scaled.unknowns(r_new, c_new)))
        of_order = past.expected if order == len(past.states) else past.ahead
        error = local_error(model, of_order, (r_new, c_new), flow.normals)
        if _converged(iterations, max(SHARE_OF_ERROR * error, SHARE_OF_TOLERANCE * tolerance)):
            break
        r, c = r_new, c_new
        if len(iterations) > 1:
            factor = anderson_step(*iterations[-2:])
            r = r_new + factor * (r_new - r_before)
            c = np.maximum(c_new + factor * (c_new - c_before), 0.0)
            g = geometry(r, model.mesh.faces)
        x, r_before, c_before = scaled.unknowns(r, c), r_new, c_new
    position = _position(model, past.states, t, r_new, flow)
    omega = angular_velocity(model, r_new, c_new, g, flow.v)
    new = State(t, r_new, c_new, zeta0, position, omega)
    check_step(model, past.states[0], new)
    return new, flow, error


def starting_step(
    model: Model,
    now: State,
    dt: float,
    before: Flow | None,
    tolerance: float,
) -> tuple[State, Flow, float]:
    """The state after dt from a state without a past, the flow there, and the error of the step.

    The result is that of two implicit Euler steps of half the length. Its difference from one step
    of the whole length is the error. The method damps the imbalance of a new mesh, which
    extrapolation from the past cannot predict.
    """
    now = replace(
        now, angular_velocity=_predicted_angular_velocity(model, (now,), now.t + dt, before)
    )
    whole, _, _ = semi_implicit_step(model, (now,), dt, before, tolerance)
    # the one predicted is from axes at rest, and its error does not fall with dt
    now = replace(now, angular_velocity=whole.angular_velocity)
    half, flow, _ = semi_implicit_step(model, (now,), 0.5 * dt, before, tolerance)
    new, flow, _ = semi_implicit_step(model, (half,), 0.5 * dt, flow, tolerance)
    return new, flow, difference(model, (new.r, new.c), (whole.r, whole.c), flow.normals)


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Nodes `r` (V, 3) and `c` (V,) at a time, extrapolated from past states.

    `share`: the error of a step to that time as a share of its distance from the extrapolation.
    """

    share: float
    r: Array
    c: Array


def extrapolation(history: Sequence[State], t: float) -> Extrapolation:
    """Extrapolate `history` to time t.

    Three states give the error of a second-order step, two that of a first-order step. A single
    state gives no error estimate: its share is 0.
    """
    times = [state.t for state in history]
    r = extrapolated(times, [state.r for state in history], t)
    c = extrapolated(times, [state.c for state in history], t)
    return Extrapolation(error_share(times, t) if len(times) > 1 else 0.0, r, c)


def local_error(
    model: Model, expected: Extrapolation, new: tuple[Array, Array], normals: Array
) -> float:
    """Local error of a step to `new` (r, c), relative to R0 and c0 + |c|.

    It is estimated from the distance to the prediction. Displacements within the surface do not
    count.
    """
    return expected.share * difference(model, new, (expected.r, expected.c), normals)


@dataclass(frozen=True, eq=False)
class _Known:
    """The known part of nodes `r` (V, 3) and `filaments` (V,) of an implicit step of length dt and
    this order."""

    r: Array
    filaments: Array
    dt: float
    order: int


@dataclass(frozen=True, eq=False)
class _Past:
    """The past of a step: the `states` that it uses, their extrapolation `ahead`, the extrapolation
    `expected` of all states, and the `known` parts of the step, highest order first."""

    states: Sequence[State]
    ahead: Extrapolation
    expected: Extrapolation
    known: list[_Known]


def _predicted_angular_velocity(
    model: Model, history: Sequence[State], t: float, before: Flow | None
) -> Array:
    """Angular velocity (3,) of the nodes in a step to time t, extrapolated from that of the cell.

    Any value gives a consistent step, because the equations are the same in all axes. This one
    changes smoothly from step to step, and a cell that rotates rigidly stays at rest relative to
    its nodes. If no angular velocity is known, a preliminary step without rotation gives it.
    """
    known = [s for s in history[:2] if s.angular_velocity is not None]
    if not known:
        now = replace(history[0], angular_velocity=np.zeros(3))
        known = [semi_implicit_step(model, (now,), t - now.t, before)[0]]
    return extrapolated(
        [s.t for s in known],
        [s.angular_velocity for s in known if s.angular_velocity is not None],
        t,
    )


def _past(model: Model, history: Sequence[State], omega: Array, t: float) -> _Past:
    """The past in axes with angular velocity `omega` (3,) that are those of the nodes at time t."""
    rotated_states = []
    for state in history:
        center = volume_centroid(state.r, model.mesh.faces)
        r = center + rotated(state.r - center, omega, t - state.t)
        rotated_states.append(replace(state, r=r))
    states = rotated_states[:2]
    ahead, expected = extrapolation(states, t), extrapolation(rotated_states, t)
    return _Past(states, ahead, expected, _known(model, states, t))


def _known(model: Model, past: Sequence[State], t: float) -> list[_Known]:
    """Known parts of a step to time t: of second order if there are two states, and of first."""
    numbers = [state.c * node_areas(state.r, model.mesh.faces) for state in past]
    known = []
    for order in range(len(past), 0, -1):
        scheme = backward_difference([state.t for state in past[:order]], t)
        r = scheme.combined([state.r for state in past])
        known.append(_Known(r, scheme.combined(numbers), scheme.dt, order))
    return known


@dataclass(frozen=True, eq=False)
class _Scaling:
    """Factors that scale the unknowns of a step to about 1: `c` (V,), `r` (V, 3) along normals."""

    c: Array
    r: Array

    def unknowns(self, r: Array, c: Array) -> Array:
        """Relative concentration and normal position (2V,)."""
        return np.concatenate([c * self.c, np.einsum("vi,vi->v", r, self.r)])


def _converged(iterations: Sequence[Iteration], allowed: float) -> bool:
    """Whether the remaining error is below `allowed`. Raises StepFailed."""
    last = iterations[-1].change
    if not np.isfinite(last):
        raise StepFailed("a node position or concentration is not finite")
    if len(iterations) < 2:
        return False
    if last <= min(NO_CHANGE, allowed):
        return True
    largest = max(one.change for one in iterations)
    solved = remaining_error(*iterations[-2:]) <= min(CONVERGED * largest, allowed)
    if not solved and len(iterations) >= MAX_ITERATIONS:
        raise StepFailed("the implicit equations of the step do not converge")
    return solved


def difference(
    model: Model, a: tuple[Array, Array], b: tuple[Array, Array], normals: Array
) -> float:
    """Largest difference of two pairs (r, c), relative to R0 and c0 + c, of r along the normals."""
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
    """The filament balance: c (V,) on the new nodes r (V, 3) with filaments of velocity v (V, 3).

    Also returns the order in time: 1 if second order would make c negative.
    """
    for before in known:
        if before.filaments.min() >= 0:
            relative = v - (r - before.r) / before.dt
            c = transported(model, before.filaments, g, relative, before.dt, c_ahead)
            if c.min() >= -ROUNDING * c.max():
                return np.maximum(c, 0.0), before.order
    raise StepFailed("the concentration would become negative, or is not finite")


def _position(model: Model, past: Sequence[State], t: float, r: Array, flow: Flow) -> Array:
    """Position of the cell in the frame in which the mean cortex velocity vanishes."""
    faces, scheme = model.mesh.faces, backward_difference([state.t for state in past], t)
    frames = [state.position - volume_centroid(state.r, faces) for state in past]
    mean_v_c = flow.node_areas @ flow.v_c / flow.node_areas.sum()
    frame = scheme.combined(frames) - scheme.dt * mean_v_c
    return np.asarray(frame + volume_centroid(r, faces))


def area_preserving_move(
    model: Model, start: Array, g: Geometry, solution: TensionFlow, dt: float, zeta0: float
) -> tuple[Array, float]:
    """Nodes moved by the normal velocity, with the tension for which the area is A0 (Newton)."""
    r_at_zero_tension = start + dt * normal_part(solution.v_at_zero_tension, g.normals)
    dr_dzeta0 = dt * normal_part(solution.dv_dzeta0, g.normals)
    return tension_for_area(model, r_at_zero_tension, dr_dzeta0, zeta0)


def tension_for_area(
    model: Model, r_at_zero_tension: Array, dr_dzeta0: Array, zeta0: float
) -> tuple[Array, float]:
    """The tension for which nodes r_at_zero_tension + zeta0 dr_dzeta0 have the area A0, and those.

    By Newton's method from an estimate `zeta0`. Raises StepFailed.
    """
    faces, A0 = model.mesh.faces, model.A0
    for _ in range(30):
        r = r_at_zero_tension + zeta0 * dr_dzeta0
        found, dA_dzeta0 = area_along(r, faces, dr_dzeta0)
        excess = found - A0
        if abs(excess) < AREA_TOLERANCE * A0:
            return r, zeta0
        if not (np.isfinite(excess) and dA_dzeta0 < 0):
            break
        zeta0 -= excess / dA_dzeta0
    raise StepFailed("no tension conserves the area over this step")


def check_step(model: Model, old: State, new: State) -> None:
    """Raise StepFailed unless the new state is finite and its mesh is valid."""
    if not (np.all(np.isfinite(new.r)) and np.all(np.isfinite(new.c)) and np.isfinite(new.zeta0)):
        raise StepFailed("a node position, concentration or tension is not finite")
    before, after = (face_vectors(state.r, model.mesh.faces) for state in (old, new))
    if mesh_quality(new.r, model.mesh.faces) < MIN_QUALITY:
        raise StepFailed(
            f"a triangle has degenerated (quality below {MIN_QUALITY:g}): the mesh cannot follow "
            "the deformation; increase mesh.subdivisions or delta_P"
        )
    if np.einsum("fi,fi->f", before, after).min() <= 0:
        raise StepFailed("a triangle has inverted: the surface folds, or its mesh is too coarse")
    if not embedded(new.r, model.mesh.faces):
        raise StepFailed("the surface self-intersects; this model has no contact forces")
