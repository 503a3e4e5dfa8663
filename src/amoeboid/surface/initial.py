"""Initial states: the cell at rest, a user's surface or a frame, and what is added to their c."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.closed_forms.linear import base_tension
from amoeboid.config import SHORTEST_STEP, Config
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.checks import Repairable, check_size, check_surface, joined, placed
from amoeboid.meshes.connectivity import connectivity, narrow_numbering
from amoeboid.meshes.files import surface_file
from amoeboid.meshes.geometry import area, volume_centroid
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.meshes.repair import repaired
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.sparse import SingularMatrix
from amoeboid.numerics.spherical_harmonics import real_harmonic
from amoeboid.sections import Initial
from amoeboid.surface.equilibrium import flow_of, relaxed
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.surface.stepping import StepFailed
from amoeboid.validation import InvalidInput

ROUNDING = 1e-12
# A surface scaled by a factor closer to 1 than single precision tells counts as not scaled.
UNSCALED = 1e-6
# Step, in units of 1/model.rate, for which the first flow and tension of a shape are sought, ...
FIRST_STEP = 1e-2
# ... and how much shorter the next one is that is tried where none is found.
SHORTER = 0.1


@dataclass(frozen=True)
class Adaptation:
    """What was done to a given shape before a cell could start as it, in words."""

    repairs: tuple[str, ...]
    scaling: str | None


@dataclass(frozen=True, eq=False)
class Start:
    """Model and state at t = 0, and what was done to the shape if it was given."""

    model: Model
    state: State
    adapted: Adaptation | None = None


def initial_state(config: Config) -> tuple[Model, State]:
    """Model and state of `initial_condition`."""
    begin = initial_condition(config)
    return begin.model, begin.state


def initial_condition(config: Config, cell: InitialCell | None = None) -> Start:
    """What a resolved configuration starts from; in place of its own shape, `cell` if given.

    The sphere is brought to rest on its mesh, without a cue, which acts from t = 0 on; a shape from
    a file is not, it is the initial condition, scaled to the membrane area and with its volume
    center at the origin. Raises
    InvalidInput, StepFailed, SingularMatrix.
    """
    inputs, initial = config.inputs, config.initial
    p = config.parameters if inputs is None else inputs.parameters_at(0.0, since=0.0)
    if cell is not None:
        begin = _as_given(p, cell.r, cell.faces, cell.c, cell.zeta0, cell.repairs)
    elif initial.from_frame is not None:
        begin = _from_frame(p, initial.from_frame)
    elif initial.surface is not None:
        begin = _from_surface(p, initial, 10 * 4**config.mesh.subdivisions + 2)
    else:
        begin = Start(*sphere(p, config.mesh.subdivisions))
    state = perturbed(begin.model, begin.state, initial)
    model = begin.model.driven(config.inputs).with_noise(config.noise)
    return replace(begin, model=model, state=state)


def sphere(p: Parameters, subdivisions: int) -> tuple[Model, State]:
    """The homogeneous cell (c = c0) at rest, in the discrete equilibrium of its mesh.

    The polyhedron has the area 4 pi R0^2 exactly. Raises InvalidInput where the law is not
    defined at c0.
    """
    _check_law(p)
    r, faces = uniform_icosphere(subdivisions)
    model = Model(p, connectivity(faces))
    r = r * np.sqrt(model.A0 / area(r, faces))
    state = State(0.0, r, np.full(len(r), p.c0), float(base_tension(p)), np.zeros(3))
    return model, relaxed(model, state)


def _from_surface(p: Parameters, initial: Initial, n_nodes: int) -> Start:
    r, faces, changes = _surface(initial, n_nodes)
    c, tension = np.full(len(r), p.c0), float(base_tension(p))
    return _as_given(p, _in_units_of(p, r), faces, c, tension, changes)


def _in_units_of(p: Parameters, r: Array) -> Array:
    """Points of a file in the unit of length of the cell; of a cell with units they are in um."""
    return r if p.units is None else r / float(p.quantity(1.0, "L").magnitude)


def _from_frame(p: Parameters, path: str) -> Start:
    return _as_given(p, *_frame(path))


def _as_given(
    p: Parameters,
    r: Array,
    faces: Index,
    c: Array,
    tension: float,
    repairs: tuple[str, ...] = (),
) -> Start:
    """A given shape with given c (V,), and the tension that goes with it; `tension` is a guess."""
    _check_law(p)
    model = Model(p, connectivity(faces))
    state = State(0.0, placed(r, faces, model.A0), c, tension, np.zeros(3))
    try:
        flow, _ = first_flow(model, state)
    except (StepFailed, SingularMatrix) as error:
        raise InvalidInput(
            f"the force balance of the initial shape has no solution: {error}; use a smoother "
            "shape or a finer mesh"
        ) from None
    adapted = Adaptation(repairs, _scaling(model, r, faces))
    return Start(model, replace(state, zeta0=flow.zeta0), adapted)


def _scaling(model: Model, r: Array, faces: Index) -> str | None:
    given = area(r / np.ptp(r), faces) * float(np.ptp(r)) ** 2
    factor = np.sqrt(model.A0 / given)
    if abs(factor - 1.0) < UNSCALED:
        return None
    p = model.parameters
    areas = [p.quantity(float(size), "L^2") for size in (given, model.A0)]
    return (
        f"scaled by {factor:.6g}: its area {areas[0]:.6g} must be that of the membrane, 4 pi R0^2 "
        f"= {areas[1]:.6g}"
    )


def first_flow(model: Model, state: State) -> tuple[Flow, float]:
    """The flow in a state without a past, and the length [T] of the step that it is good for.

    A shape far from rest is fast: over a long step no tension keeps its area, and shorter ones are
    tried, down to the shortest that a run makes. Raises StepFailed, SingularMatrix.
    """
    dt = FIRST_STEP / model.rate
    while True:
        try:
            return flow_of(model, state, dt), dt
        except (StepFailed, SingularMatrix, FloatingPointError):
            dt *= SHORTER
            if dt < SHORTEST_STEP / model.rate:
                raise


def _surface(initial: Initial, n_nodes: int) -> tuple[Array, Index, tuple[str, ...]]:
    """A user's surface, checked: nodes in the size of the file, narrow numbering, what was changed.

    Repaired on request, then with about `n_nodes` if it has to be remeshed.
    """
    path = str(initial.surface)
    name = f"initial.surface = {path!r}"
    file = surface_file(path, "initial.surface")
    try:
        if initial.repair:
            r, faces, changes = repaired(file.r, file.faces, n_nodes, name)
        else:
            check_size(file.r, name)
            r, faces, changes = joined(file.r, file.faces)
        check_surface(r, faces, name)
    except Repairable as problem:
        if initial.repair:
            raise
        raise InvalidInput(
            f"{problem}, or set initial.repair = true (in Python Surface(..., repair=True))"
        ) from None
    order, faces = narrow_numbering(faces)
    return r[order], faces, changes


def _frame(path: str) -> tuple[Array, Index, Array, float]:
    """Nodes, faces, c and tension of a stored frame, checked and in narrow numbering."""
    name = f"initial.from_frame = {path!r}"
    file = surface_file(path, "initial.from_frame", ("vtp",))
    missing = [field for field in ("t", "zeta0") if field not in file.fields]
    missing += ["c"] if file.c is None else []
    if file.c is None or missing:
        raise InvalidInput(
            f"{name} must be a frame that a run has written, it lacks {', '.join(missing)}; give "
            "a shape without them as initial.surface"
        )
    c, tension = file.c, file.fields["zeta0"]
    if c.shape != (len(file.r),) or not np.all(np.isfinite(c)) or c.min() < 0:
        raise InvalidInput(f"{name} must have a finite c >= 0 at every point")
    if not np.isfinite(tension):
        raise InvalidInput(f"{name} must have a finite tension zeta0, got {tension}")
    check_surface(file.r, file.faces, name)
    order, faces = narrow_numbering(file.faces)
    return file.r[order], faces, c[order], tension


def _check_law(p: Parameters) -> None:
    if p.v_p(p.c0) < 0:
        raise InvalidInput(
            f"the law must give v_p(c0) >= 0 (filaments push the membrane), got {p.v_p(p.c0):.4g}"
        )


def perturbed(model: Model, state: State, initial: Initial) -> State:
    """`state` with c + perturbation cos(theta) + harmonics + noise; `initial` is resolved.

    theta is the angle between the direction and r - r_cm; on the sphere this is
    c + perturbation (r - r_cm).direction/R0 (SI, numerical procedure). Harmonics: see
    `real_harmonic`. Raises InvalidInput if the sum is negative somewhere.
    """
    axis = np.array(initial.direction) / np.linalg.norm(initial.direction)
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    distance = np.linalg.norm(x, axis=1)
    cosine = np.divide(x @ axis, distance, out=np.zeros_like(distance), where=distance > 0)
    change = initial.perturbation * cosine
    for degree, order, amplitude in initial.harmonics:
        if (degree + 1) ** 2 > len(x):
            raise InvalidInput(
                f"initial.harmonics must have (l + 1)^2 <= {len(x)}, the number of nodes, got l = "
                f"{degree}; lower l or refine the mesh"
            )
        change = change + amplitude * real_harmonic(degree, order, x)
    change = change + initial.noise * np.random.default_rng(initial.seed).standard_normal(len(x))
    c = state.c + change
    if c.min() < -ROUNDING * np.abs(change).max():
        parts = [f"{f} = {getattr(initial, f):g}" for f in ("perturbation", "noise")]
        parts += [f"harmonics = {[list(h) for h in initial.harmonics]}"] * bool(initial.harmonics)
        raise InvalidInput(
            f"the initial concentration must be >= 0 everywhere, got {c.min():.4g}; keep "
            f"{' and '.join(f'initial.{part}' for part in parts)} well below c = "
            f"{state.c.min():g}"
        )
    return replace(state, c=np.maximum(c, 0.0))
