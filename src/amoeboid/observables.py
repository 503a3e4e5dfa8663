"""What a cell is measured by; the same definitions for every solver.

To add an observable of 3D runs, write a function of (model, state, flow) and list it: a number that
does not depend on the orientation of the cell in `OBSERVABLES`, a vector in `VECTORS`. It appears
in the time series, a vector in three columns name_x, name_y, name_z.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled
from amoeboid.surface import geometry
from amoeboid.surface.geometry import area, node_areas, volume, volume_centroid
from amoeboid.surface.mesh import Connectivity
from amoeboid.surface.model import Flow, Model, State

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Number of nodes, fastest first, whose neighborhood is searched for the maximal speed.
SEARCHED = 24
# Slower than this, in units of rate R0, a cell has no heading.
SLOWEST_WITH_HEADING = 1e-6
# Share of the largest pivot below which a fit is taken for underdetermined.
UNDETERMINED = 1e-10


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


def migration(model: Model, state: State, flow: Flow) -> Array:
    """Velocity (3,) of the cell, that of the center of its volume, in the laboratory [L/T].

    The laboratory is the frame in which the cortex as a whole rests (area mean of v_c).
    """
    mean_v_c = flow.node_areas @ flow.v_c / flow.node_areas.sum()
    return np.asarray(center_velocity(model, state, flow) - mean_v_c)


def migration_speed(model: Model, state: State, flow: Flow) -> float:
    """Speed of the cell in the laboratory, see `migration` [L/T]."""
    return float(np.linalg.norm(migration(model, state, flow)))


def heading(model: Model, state: State, flow: Flow) -> Array:
    """Unit vector (3,) along `migration`; zero for a cell that rests."""
    velocity = migration(model, state, flow)
    speed = np.linalg.norm(velocity)
    moves = speed > SLOWEST_WITH_HEADING * model.rate * model.parameters.R0
    return np.asarray(velocity / speed if moves else np.zeros(3))


def max_retrograde_speed(model: Model, state: State, flow: Flow) -> float:
    """Maximum over the surface of the retrograde speed, the paper's v_0 [L/T].

    At every candidate node the squared speed is the value there of a quadratic fitted to two
    rings of neighbors, so that single nodes (the twelve of valence five) do not decide.
    """
    v = retrograde_flow(model, state, flow)
    squares = np.einsum("vi,vi->v", v, v)
    fastest = _largest(squares, SEARCHED)
    fitted = _fitted_values(model.mesh, state.r, flow.normals, squares, fastest)
    return float(np.sqrt(max(0.0, fitted.max())))


def c_front(model: Model, state: State, flow: Flow) -> float:
    """Concentration at the front, its minimum over the surface [N/L^2]."""
    lowest = int(np.argmin(state.c))
    return _refined_extremum(model.mesh, state.r, flow.normals, state.c, lowest, -1.0)


def c_rear(model: Model, state: State, flow: Flow) -> float:
    """Concentration at the rear, its maximum over the surface [N/L^2]."""
    highest = int(np.argmax(state.c))
    return _refined_extremum(model.mesh, state.r, flow.normals, state.c, highest, 1.0)


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
    """Largest minus smallest distance from the volume center, relative to their sum."""
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    distance = np.linalg.norm(x, axis=1)
    return float((distance.max() - distance.min()) / (distance.max() + distance.min()))


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
        migration_speed,
    )
}

VECTORS: dict[str, Callable[[Model, State, Flow], Array]] = {f.__name__: f for f in (heading,)}
COLUMNS = (*OBSERVABLES, *(f"{name}_{axis}" for name in VECTORS for axis in "xyz"))


def observed(model: Model, state: State, flow: Flow) -> dict[str, float]:
    """All observables of one state, by name."""
    return {name: f(model, state, flow) for name, f in OBSERVABLES.items()}


def components(model: Model, state: State, flow: Flow) -> dict[str, float]:
    """Components of all vector observables of one state: name_x, name_y, name_z."""
    return {
        f"{name}_{axis}": float(value)
        for name, f in VECTORS.items()
        for axis, value in zip("xyz", f(model, state, flow), strict=True)
    }


def _largest(values: Array, count: int) -> Index:
    """Nodes of the `count` largest values, largest first, equal ones in their order."""
    least = np.partition(values, -count)[-count] if count < len(values) else -np.inf
    nodes = np.flatnonzero(values >= least)
    return nodes[np.argsort(-values[nodes], kind="stable")][:count]


@compiled
def _two_rings(nodes, row_start, columns):  # type: ignore[no-untyped-def]
    """Each node, its neighbors and theirs, in no order; short lists end with -1."""
    most = 0
    for i in nodes:
        reached = 0
        for j in columns[row_start[i] : row_start[i + 1]]:
            reached += row_start[j + 1] - row_start[j]
        most = max(most, reached)
    patches = np.full((len(nodes), most), -1)
    longest = 0
    for n in range(len(nodes)):
        length = 0
        for j in columns[row_start[nodes[n]] : row_start[nodes[n] + 1]]:
            for k in columns[row_start[j] : row_start[j + 1]]:
                known = 0
                while known < length and patches[n, known] != k:
                    known += 1
                if known == length:
                    patches[n, length] = k
                    length += 1
        longest = max(longest, length)
    return patches[:, :longest]


def _in_tangent_plane(x: Array, normals: Array) -> Array:
    """Coordinates (n, m, 2) of x (n, m, 3) in the planes of n normals, in units of their spread."""
    first = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
    first /= np.sqrt(np.einsum("ni,ni->n", first, first))[:, None]
    axes = np.stack([first, np.cross(normals, first)], axis=2)
    plane = x @ axes
    return np.asarray(plane / np.abs(plane).max(axis=(1, 2), keepdims=True))


def _monomials(plane: Array) -> Array:
    x, y = plane[..., 0], plane[..., 1]
    return np.stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y], axis=-1)


def _fitted_values(
    mesh: Connectivity, r: Array, normals: Array, values: Array, nodes: Index
) -> Array:
    """Values at `nodes` of the quadratics fitted to each and two rings of its neighbors."""
    patches = _two_rings(nodes, mesh.row_start, mesh.columns)
    # lists are filled up with equations 0 = 0
    present = patches >= 0
    x = (r[patches] - r[nodes, None, :]) * present[..., None]
    basis = np.concatenate(
        [present[..., None], _monomials(_in_tangent_plane(x, normals[nodes]))], axis=-1
    )
    wanted = (values[patches] * present)[..., None]
    if basis.shape[1] >= basis.shape[2]:
        q, upper = np.linalg.qr(basis)
        size = np.abs(np.diagonal(upper, axis1=1, axis2=2))
        if np.all(size.min(axis=1) > UNDETERMINED * size.max(axis=1)):
            return np.linalg.solve(upper, q.transpose(0, 2, 1) @ wanted)[:, 0, 0]
    # too few neighbors for a quadratic: the smallest one that fits
    return np.array(
        [np.linalg.lstsq(a, b, rcond=None)[0][0, 0] for a, b in zip(basis, wanted, strict=True)]
    )


def _refined_extremum(
    mesh: Connectivity, r: Array, normals: Array, values: Array, i: int, sign: float
) -> float:
    """Extremum near node i of the quadratic through it, fitted to its neighbors.

    Taken only within reach of the neighbors, and if it is no concentration below zero; else the
    value at the node. sign +1: a maximum.
    """
    ring = mesh.columns[mesh.row_start[i] : mesh.row_start[i + 1]]
    ring = ring[ring != i]
    if np.ptp(values[ring] - values[i]) == 0.0:
        return float(values[i])
    basis = _monomials(_in_tangent_plane((r[ring] - r[i])[None], normals[i : i + 1])[0])
    gx, gy, xx, xy, yy = np.linalg.lstsq(basis, values[ring] - values[i], rcond=None)[0]
    hessian, gradient = np.array([[xx, xy], [xy, yy]]), np.array([gx, gy])
    if np.max(sign * np.linalg.eigvalsh(hessian)) >= 0:
        return float(values[i])
    step = -np.linalg.solve(hessian, gradient)
    if np.linalg.norm(step) > 1.0:
        return float(values[i])
    refined = float(values[i] + 0.5 * gradient @ step)
    return refined if refined >= 0.0 else float(values[i])
