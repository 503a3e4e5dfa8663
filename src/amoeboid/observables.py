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
from numpy.typing import NDArray

from amoeboid.numerics.compiled import compiled, nested
from amoeboid.surface import geometry
from amoeboid.surface.geometry import area, node_areas, smooth_area, volume, volume_centroid
from amoeboid.surface.mesh import Connectivity
from amoeboid.surface.model import Flow, Model, State
from amoeboid.validation import InvalidInput

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Number of nodes, fastest first, whose neighborhood is searched for the maximal speed.
SEARCHED = 12
# There the squared speed is fitted by a polynomial of this degree, to so many rings of neighbors.
DEGREE, RINGS = 4, 3
# How far from a node its maximum is sought, in units of the farthest neighbor, and in how many
# steps; the share of the larger curvature that the smaller one counts for at least.
REACH, MOST_CLIMBS, FLATTEST = 0.5, 5, 1e-3
# Slower than this, in units of rate R0, a cell has no heading.
MIN_SPEED_WITH_HEADING = 1e-6
# Share of a power that must be left when lower ones are taken off, squared, to be fitted.
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
    fastest = _largest(squares, SEARCHED)
    mesh, r = model.mesh, state.r
    maxima = _fitted_maxima(fastest, mesh.row_start, mesh.columns, r, flow.normals, squares)
    return float(np.sqrt(max(0.0, maxima.max())))


def c_front(model: Model, state: State, flow: Flow) -> float:
    """Concentration at the front, its minimum over the surface [N/L^2]."""
    lowest = int(np.argmin(state.c))
    refined = _refined_extremum(model.mesh, state.r, flow.normals, state.c, lowest, -1.0)
    return refined if refined >= 0.0 else float(state.c[lowest])


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
        abs(_refined_extremum(model.mesh, state.r, normals, change, i, sign))
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


def _largest(values: Array, count: int) -> Index:
    """Nodes of the `count` largest values, largest first, equal ones in their order."""
    least = np.partition(values, -count)[-count] if count < len(values) else -np.inf
    nodes = np.flatnonzero(values >= least)
    return nodes[np.argsort(-values[nodes], kind="stable")][:count]


@nested
def _patch(rings, row_start, columns, found):  # type: ignore[no-untyped-def]
    """Append to the node found[0] `rings` rings of neighbors, nearest first; how many nodes."""
    begin, end = 0, 1
    for _ in range(rings):
        length = end
        for i in range(begin, end):
            for k in range(row_start[found[i]], row_start[found[i] + 1]):
                known = 0
                while known < length and found[known] != columns[k]:
                    known += 1
                if known == length:
                    found[length] = columns[k]
                    length += 1
        begin, end = end, length
    return end


@nested
def _plane(patch, size, r, normals, plane):  # type: ignore[no-untyped-def]
    """Coordinates (n, 2) of a patch in the tangent plane of its node, the farthest 1 away."""
    node, least = patch[0], 0
    for d in range(3):
        if abs(normals[node, d]) < abs(normals[node, least]):
            least = d
    # along the product of the normal and the axis that is farthest from it, and across
    up, p, q = normals[node, least], (least + 1) % 3, (least + 2) % 3
    length = np.sqrt(normals[node, p] ** 2 + normals[node, q] ** 2)
    first_p, first_q = normals[node, q] / length, -normals[node, p] / length
    second_p, second_q = -up * first_q, up * first_p
    second = normals[node, p] * first_q - normals[node, q] * first_p
    farthest = 0.0
    for i in range(size):
        a, b = r[patch[i], p] - r[node, p], r[patch[i], q] - r[node, q]
        c = r[patch[i], least] - r[node, least]
        plane[i, 0] = first_p * a + first_q * b
        plane[i, 1] = second * c + second_p * a + second_q * b
        farthest = max(farthest, plane[i, 0] ** 2 + plane[i, 1] ** 2)
    farthest = np.sqrt(farthest)
    for i in range(size):
        plane[i, 0], plane[i, 1] = plane[i, 0] / farthest, plane[i, 1] / farthest


@nested
def _polynomial(patch, n, plane, values):  # type: ignore[no-untyped-def]
    """Coefficients k[p, q] of sum k[p, q] x^p y^q of degree DEGREE, fitted with weights.

    Gram-Schmidt from low powers up; a power that the nodes do not tell from the lower ones is left
    out, so that few nodes give a fit of lower degree.
    """
    terms = (DEGREE + 1) * (DEGREE + 2) // 2
    basis, upper, share = np.zeros((terms, n)), np.zeros((terms, terms)), np.zeros(terms)
    powers = np.empty((terms, 2), np.int64)
    weights, rest, column = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        weights[i] = np.exp(-(plane[i, 0] ** 2) - plane[i, 1] ** 2)
        rest[i] = weights[i] * values[patch[i]]
    t = 0
    for degree in range(DEGREE + 1):
        for q in range(degree + 1):
            powers[t, 0], powers[t, 1] = degree - q, q
            size, left = 0.0, 0.0
            for i in range(n):
                column[i] = weights[i]
                for _ in range(degree - q):
                    column[i] *= plane[i, 0]
                for _ in range(q):
                    column[i] *= plane[i, 1]
                size += column[i] ** 2
            for s in range(t):
                for i in range(n):
                    upper[s, t] += basis[s, i] * column[i]
                for i in range(n):
                    column[i] -= upper[s, t] * basis[s, i]
            for i in range(n):
                left += column[i] ** 2
            if left > UNDETERMINED * size:
                upper[t, t] = np.sqrt(left)
                for i in range(n):
                    basis[t, i] = column[i] / upper[t, t]
                    share[t] += basis[t, i] * rest[i]
                for i in range(n):
                    rest[i] -= share[t] * basis[t, i]
            t += 1
    k = np.zeros((DEGREE + 1, DEGREE + 1))
    for t in range(terms - 1, -1, -1):
        if upper[t, t] > 0.0:
            coefficient = share[t] / upper[t, t]
            k[powers[t, 0], powers[t, 1]] = coefficient
            for s in range(t):
                share[s] -= upper[s, t] * coefficient
    return k


@nested
def _value_and_slopes(k, x, y):  # type: ignore[no-untyped-def]
    """Value, first and second derivatives of a polynomial of degree DEGREE."""
    f, fx, fy, fxx, fxy, fyy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(DEGREE, -1, -1):
        g, gy, gyy = 0.0, 0.0, 0.0
        for q in range(DEGREE - p, -1, -1):
            gyy = gyy * y + 2.0 * gy
            gy = gy * y + g
            g = g * y + k[p, q]
        fxx = fxx * x + 2.0 * fx
        fxy = fxy * x + fy
        fx = fx * x + f
        f, fy, fyy = f * x + g, fy * x + gy, fyy * x + gyy
    return f, fx, fy, fxx, fxy, fyy


@nested
def _climbed(k):  # type: ignore[no-untyped-def]
    """Largest value within REACH of the origin that Newton's method finds from there."""
    x, y = 0.0, 0.0
    best, fx, fy, fxx, fxy, fyy = _value_and_slopes(k, x, y)
    for _ in range(MOST_CLIMBS):
        # with curvatures of the sign of a maximum and not too small: a ring of maxima has one of 0
        mean, half = 0.5 * (fxx + fyy), 0.5 * (fxx - fyy)
        radius = np.sqrt(half * half + fxy * fxy)
        one, two = abs(mean + radius), abs(mean - radius)
        one, two = max(one, FLATTEST * two), max(two, FLATTEST * one)
        angle = 0.5 * np.arctan2(fxy, half)
        cos, sin = np.cos(angle), np.sin(angle)
        along, across = (cos * fx + sin * fy) / one, (cos * fy - sin * fx) / two
        to_x, to_y = x + cos * along - sin * across, y + sin * along + cos * across
        distance = np.sqrt(to_x * to_x + to_y * to_y)
        if distance > REACH:
            to_x, to_y = REACH / distance * to_x, REACH / distance * to_y
        f, gx, gy, gxx, gxy, gyy = _value_and_slopes(k, to_x, to_y)
        if not f > best:  # also without any curvature, where f is not a number
            break
        x, y, best, fx, fy, fxx, fxy, fyy = to_x, to_y, f, gx, gy, gxx, gxy, gyy
    return best


@compiled
def _fitted_maxima(nodes, row_start, columns, r, normals, values):  # type: ignore[no-untyped-def]
    """Maxima near `nodes` of the polynomials fitted to each and the rings around it.

    None is farther above all values of its patch than these differ from the node to its neighbors:
    on a rim that the mesh does not resolve a polynomial may swing beyond all measure.
    """
    maxima = np.empty(len(nodes))
    patch, plane = np.empty(len(values), np.int64), np.empty((len(values), 2))
    for n in range(len(nodes)):
        patch[0] = nodes[n]
        size = _patch(RINGS, row_start, columns, patch)
        _plane(patch, size, r, normals, plane)
        top, high, low = values[nodes[n]], values[nodes[n]], values[nodes[n]]
        for i in range(row_start[nodes[n]], row_start[nodes[n] + 1]):
            high, low = max(high, values[columns[i]]), min(low, values[columns[i]])
        for i in range(size):
            top = max(top, values[patch[i]])
        maxima[n] = min(_climbed(_polynomial(patch, size, plane, values)), top + high - low)
    return maxima


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


def _refined_extremum(
    mesh: Connectivity, r: Array, normals: Array, values: Array, i: int, sign: float
) -> float:
    """Extremum near node i of the quadratic through it, fitted to its neighbors.

    Taken only within reach of the neighbors, else the value at the node. sign +1: a maximum.
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
    return float(values[i] + 0.5 * gradient @ step)
