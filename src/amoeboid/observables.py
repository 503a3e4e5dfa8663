"""What a cell is measured by; the same definitions for every solver.

To add an observable of 3D runs, write a function of (model, state, flow) and list it in
`OBSERVABLES`: it appears in the time series, the summary and the JSON.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from amoeboid.surface import geometry
from amoeboid.surface.geometry import area, volume, volume_centroid
from amoeboid.surface.mesh import Connectivity
from amoeboid.surface.model import Flow, Model, State

Array = NDArray[np.float64]

# Number of nodes, fastest first, whose neighborhood is searched for the maximal speed.
SEARCHED = 24


def retrograde_flow(model: Model, state: State, flow: Flow) -> Array:
    """Tangential full velocity (V, 3) in the frame in which the cell rests [L/T].

    That frame follows the center of the enclosed volume.
    """
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    v_n = np.einsum("vi,vi->v", flow.v, flow.normals)
    drift = (flow.node_areas * v_n) @ x / volume(state.r, model.mesh.faces)
    relative = flow.v - drift
    return relative - geometry.normal_part(relative, flow.normals)


def max_retrograde_speed(model: Model, state: State, flow: Flow) -> float:
    """Maximum over the surface of the retrograde speed, the paper's v_0 [L/T].

    At every candidate node the squared speed is the value there of a quadratic fitted to two
    rings of neighbors, so that single nodes (the twelve of valence five) do not decide.
    """
    speed = np.linalg.norm(retrograde_flow(model, state, flow), axis=1)
    fastest = np.argsort(-speed, kind="stable")[:SEARCHED]
    squares = [_fitted_value(model.mesh, state.r, flow.normals, speed**2, i) for i in fastest]
    return float(np.sqrt(max(0.0, *squares)))


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
    return float(geometry.geometry(state.r, model.mesh.faces).node_areas @ state.c)


def polarity(model: Model, state: State, flow: Flow) -> float:
    """|integral of c r dA| / (R0 integral of c dA), about the volume center; 0 if homogeneous."""
    return float(np.linalg.norm(polarization(model, state)))


def polarization(model: Model, state: State) -> Array:
    """The vector of `polarity` (3,): from the front to the rear."""
    weights = geometry.geometry(state.r, model.mesh.faces).node_areas * state.c
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
    )
}


def observed(model: Model, state: State, flow: Flow) -> dict[str, float]:
    """All observables of one state, by name."""
    return {name: f(model, state, flow) for name, f in OBSERVABLES.items()}


def _neighbors(mesh: Connectivity, i: int) -> NDArray[np.int64]:
    return mesh.columns[mesh.row_start[i] : mesh.row_start[i + 1]]


def _in_tangent_plane(r: Array, nodes: NDArray[np.int64], i: int, normal: Array) -> Array:
    """Coordinates (n, 2) of nodes in the tangent plane at node i, in units of their spread."""
    x = r[nodes] - r[i]
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    plane = x @ np.column_stack([first, np.cross(normal, first)])
    return np.asarray(plane / np.abs(plane).max())


def _monomials(plane: Array) -> Array:
    x, y = plane.T
    return np.column_stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y])


def _fitted_value(mesh: Connectivity, r: Array, normals: Array, values: Array, i: int) -> float:
    """Value at node i of the quadratic fitted to it and two rings of neighbors."""
    patch = np.unique(np.concatenate([_neighbors(mesh, j) for j in _neighbors(mesh, i)]))
    basis = _monomials(_in_tangent_plane(r, patch, i, normals[i]))
    basis = np.column_stack([np.ones(len(patch)), basis])
    return float(np.linalg.lstsq(basis, values[patch], rcond=None)[0][0])


def _refined_extremum(
    mesh: Connectivity, r: Array, normals: Array, values: Array, i: int, sign: float
) -> float:
    """Extremum near node i of the quadratic through it, fitted to its neighbors.

    Taken only within reach of the neighbors, and if it is no concentration below zero; else the
    value at the node. sign +1: a maximum.
    """
    ring = _neighbors(mesh, i)
    ring = ring[ring != i]
    if np.ptp(values[ring] - values[i]) == 0.0:
        return float(values[i])
    basis = _monomials(_in_tangent_plane(r, ring, i, normals[i]))
    gx, gy, xx, xy, yy = np.linalg.lstsq(basis, values[ring] - values[i], rcond=None)[0]
    hessian, gradient = np.array([[xx, xy], [xy, yy]]), np.array([gx, gy])
    if np.max(sign * np.linalg.eigvalsh(hessian)) >= 0:
        return float(values[i])
    step = -np.linalg.solve(hessian, gradient)
    if np.linalg.norm(step) > 1.0:
        return float(values[i])
    refined = float(values[i] + 0.5 * gradient @ step)
    return refined if refined >= 0.0 else float(values[i])
