"""What a 3D cell is measured by; docs/notation.md lists the definitions, the same for every solver.

`axisymmetric.observables` has those of the axisymmetric solver. To add an observable of 3D runs,
write a function of (model, state, flow) and list it: a number that does not depend on the
orientation of the cell in `OBSERVABLES`, a vector in `VECTORS`, its dimension in `UNITS`. It
appears in the time series, a vector in three columns name_x, name_y, name_z.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes import geometry
from amoeboid.meshes.extrema import SEARCHED, fitted_maxima, largest, refined_extremum
from amoeboid.meshes.geometry import area, node_areas, smooth_area, volume, volume_centroid
from amoeboid.surface.model import Model
from amoeboid.surface.state import Flow, State
from amoeboid.validation import InvalidInput

# Slower than this, in units of rate R0, a cell has no heading.
MIN_SPEED_WITH_HEADING = 1e-6


def retrograde_flow(model: Model, state: State, flow: Flow) -> Array:
    """Tangential full velocity (V, 3) in the frame in which the cell rests [L/T].

    That frame follows the center of the enclosed volume.
    """
    relative = flow.v - center_velocity(model, state, flow)
    return relative - geometry.normal_part(relative, flow.normals)


def center_velocity(model: Model, state: State, flow: Flow) -> Array:
    """Velocity (3,) of the center of the enclosed volume in the frame of the nodes [L/T]."""
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    v_n = np.einsum("vi,vi->v", flow.v, flow.normals)
    return np.asarray((flow.node_areas * v_n) @ x / volume(state.r, model.mesh.faces))


def cortex_drag_velocity(model: Model, state: State, flow: Flow) -> Array:
    """Velocity (3,) of the center of volume if all drag is on the cortex, uniformly [L/T].

    Surroundings that hold the cortex back with a force -k v_c per area, and nothing else, let the
    cell go where the area mean of v_c vanishes. The paper leaves open how a cell pushes itself off;
    other surroundings give other velocities.
    """
    mean_v_c = flow.node_areas @ flow.v_c / flow.node_areas.sum()
    return np.asarray(center_velocity(model, state, flow) - mean_v_c)


def cortex_drag_speed(model: Model, state: State, flow: Flow) -> float:
    """Magnitude of `cortex_drag_velocity` [L/T]."""
    return float(np.linalg.norm(cortex_drag_velocity(model, state, flow)))


def cortex_drag_heading(model: Model, state: State, flow: Flow) -> Array:
    """Unit vector (3,) along `cortex_drag_velocity`; zero for a cell that rests."""
    velocity = cortex_drag_velocity(model, state, flow)
    speed = np.linalg.norm(velocity)
    moves = speed > MIN_SPEED_WITH_HEADING * model.rate * model.parameters.R0
    return np.asarray(velocity / speed if moves else np.zeros(3))


def max_retrograde_speed(model: Model, state: State, flow: Flow) -> float:
    """Maximum over the surface of the retrograde speed, the paper's v_0 [L/T].

    The squared speed is fitted by a polynomial of fourth degree around each of the fastest nodes,
    and its maximum counts: it lies between the nodes, and single nodes do not decide.
    """
    v = retrograde_flow(model, state, flow)
    squares = np.einsum("vi,vi->v", v, v)
    fastest = largest(squares, SEARCHED)
    mesh, r = model.mesh, state.r
    maxima = fitted_maxima(fastest, mesh.row_start, mesh.columns, r, flow.normals, squares)
    return float(np.sqrt(max(0.0, maxima.max())))


def c_front(model: Model, state: State, flow: Flow) -> float:
    """Concentration at the front, its minimum over the surface [N/L^2]."""
    lowest = int(np.argmin(state.c))
    refined = refined_extremum(model.mesh, state.r, flow.normals, state.c, lowest, -1.0)
    return refined if refined >= 0.0 else float(state.c[lowest])


def c_rear(model: Model, state: State, flow: Flow) -> float:
    """Concentration at the rear, its maximum over the surface [N/L^2]."""
    highest = int(np.argmax(state.c))
    return refined_extremum(model.mesh, state.r, flow.normals, state.c, highest, 1.0)


def zeta0(model: Model, state: State, flow: Flow) -> float:
    """Membrane tension [M/T^2]."""
    return state.zeta0


def area_error(model: Model, state: State, flow: Flow) -> float:
    """|A/A0 - 1|."""
    return abs(area(state.r, model.mesh.faces) / model.A0 - 1.0)


def filament_number(model: Model, state: State, flow: Flow) -> float:
    """Total number of filaments, the integral of c over the surface [N]."""
    return float(node_areas(state.r, model.mesh.faces) @ state.c)


def polarity(model: Model, state: State, flow: Flow) -> float:
    """|integral of c r dA| / (R0 integral of c dA), about the volume center; 0 if homogeneous."""
    return float(np.linalg.norm(polarization(model, state)))


def polarization(model: Model, state: State) -> Array:
    """The vector of `polarity` (3,): from the front to the rear."""
    weights = node_areas(state.r, model.mesh.faces) * state.c
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    return np.asarray(weights @ x / (weights.sum() * model.parameters.R0))


def deformation(model: Model, state: State, flow: Flow) -> float:
    """Largest deviation of the distance from the center of volume from R0, over R0 [1].

    R0 is the radius of the sphere that has the area of the surface. A polyhedron of that area has
    its nodes outside, so that the area of the smooth surface through the nodes is taken.
    """
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    R = np.sqrt(smooth_area(state.r, model.mesh.faces) / (4.0 * np.pi))
    change = np.linalg.norm(x, axis=1) / R - 1.0
    farthest, nearest = int(np.argmax(change)), int(np.argmin(change))
    normals = geometry.geometry(state.r, model.mesh.faces).normals
    return max(
        abs(refined_extremum(model.mesh, state.r, normals, change, i, sign))
        for i, sign in ((farthest, 1.0), (nearest, -1.0))
    )


def reduced_volume(model: Model, state: State, flow: Flow) -> float:
    """Volume over that of the sphere of equal area: 1 for a sphere, up to the mesh error."""
    sphere = model.A0**1.5 / (6.0 * np.sqrt(np.pi))
    return float(volume(state.r, model.mesh.faces) / sphere)


def mesh_quality(model: Model, state: State, flow: Flow) -> float:
    """Quality of the worst triangle: 1 is equilateral, 0 is degenerate."""
    return geometry.mesh_quality(state.r, model.mesh.faces)


Observable = Callable[[Model, State, Flow], float]

OBSERVABLES: dict[str, Observable] = {
    f.__name__: f
    for f in (
        max_retrograde_speed,
        c_front,
        c_rear,
        zeta0,
        area_error,
        polarity,
        deformation,
        reduced_volume,
        filament_number,
        mesh_quality,
        cortex_drag_speed,
    )
}

VECTORS: dict[str, Callable[[Model, State, Flow], Array]] = {
    f.__name__: f for f in (cortex_drag_heading,)
}

# Dimensions in L, T, M and N as in Parameters; "1" is none. A name that is missing has none stated.
UNITS: dict[str, str] = {
    "max_retrograde_speed": "L/T",
    "c_front": "N/L^2",
    "c_rear": "N/L^2",
    "zeta0": "M/T^2",
    "area_error": "1",
    "polarity": "1",
    "deformation": "1",
    "reduced_volume": "1",
    "filament_number": "N",
    "mesh_quality": "1",
    "cortex_drag_speed": "L/T",
    "cortex_drag_heading": "1",
}


def units() -> dict[str, str | None]:
    """Dimension of every observable as its columns are named, None where `UNITS` has none."""
    scalars = {name: UNITS.get(name) for name in OBSERVABLES}
    return scalars | {f"{name}_{axis}": UNITS.get(name) for name in VECTORS for axis in "xyz"}


def observed(model: Model, state: State, flow: Flow) -> dict[str, float]:
    """All observables of one state, by name.

    Raises InvalidInput, naming it, for an observable that fails or is no finite number.
    """
    return {name: _numbers(name, f, 1, model, state, flow)[0] for name, f in OBSERVABLES.items()}


def components(model: Model, state: State, flow: Flow) -> dict[str, float]:
    """Components of all vector observables of one state: name_x, name_y, name_z.

    Raises InvalidInput as `observed`.
    """
    return {
        f"{name}_{axis}": value
        for name, f in VECTORS.items()
        for axis, value in zip("xyz", _numbers(name, f, 3, model, state, flow), strict=True)
    }


def _numbers(
    name: str, f: Callable[..., Any], count: int, model: Model, state: State, flow: Flow
) -> list[float]:
    """The `count` numbers that an observable, perhaps a user's, gives."""
    try:
        found = np.asarray(f(model, state, flow), dtype=float)
    except Exception as error:  # a user's function may raise anything
        raise InvalidInput(
            f"the observable {name!r} must give {_wanted(count)}, it raised "
            f"{type(error).__name__}: {error}"
        ) from error
    if found.size != count or not np.isfinite(found).all():
        raise InvalidInput(f"the observable {name!r} must give {_wanted(count)}, got {found}")
    return [float(x) for x in found.ravel()]


def _wanted(count: int) -> str:
    return "a finite number" if count == 1 else f"{count} finite numbers"
