"""Repairs a user's surface on request: joins, orientation, slivers, a uniform mesh.

Every change is reported. Holes, handles, several pieces and self-intersections are not repaired,
because the intended surface is not known; `checks.check_surface` rejects them.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.checks import (
    MAX_NODES,
    MIN_NODES,
    Repairable,
    check_mesh,
    check_size,
    check_triangles,
    joined,
)
from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.geometry import (
    MIN_QUALITY,
    area,
    equilateral_edge_length,
    geometry,
    mesh_quality,
    triangle_quality,
    volume,
)
from amoeboid.meshes.graphs import components
from amoeboid.meshes.relaxation import relaxation
from amoeboid.meshes.remeshing import POOR_QUALITY, distortion, swept
from amoeboid.numerics.compiled import compiled, nested
from amoeboid.validation import InvalidInput

# Maximum number of rounds, and the distortion at which they end; a run accepts distortions up to 1.
MAX_ROUNDS, GOOD_DISTORTION = 12, 0.85
# Relaxation steps after each round; number of triangles among which the nearest point is searched.
RELAXATIONS, NEAREST = 3, 12
# A remeshed surface has more nodes by this factor than equilateral triangles of that edge length.
EXCESS = 1.27
# The number of nodes differs from the wanted one by less than this factor; measured: 1.21.
SPREAD = 1.3
# The repair of a surface with this many points takes minutes.
MAX_POINTS = 250_000


def repaired(
    r: Array, faces: Index, n_nodes: int, name: str
) -> tuple[Array, Index, tuple[str, ...]]:
    """The repaired surface: nodes, faces, and the changes in words.

    Points that coincide up to rounding are joined. Triangles that use a point twice, repeated
    triangles and unused points are removed. Triangles are oriented outward. A mesh with slivers or
    edges of very different lengths is remeshed to about `n_nodes` nodes. Raises InvalidInput, with
    a message that begins with `name`, for a surface that cannot be repaired.
    """
    size = check_size(r, name)
    r, faces, changes = joined(r, faces)
    r, faces, removed = _cleaned(r, faces)
    if len(r) > MAX_POINTS:
        raise InvalidInput(
            f"{name} must have at most {MAX_POINTS} points to be repaired, got {len(r)}; "
            "decimate it"
        )
    faces, turned = _oriented(r, faces)
    changes = (*changes, *removed, *turned)
    check_mesh(r, faces, name)
    # neither its place nor its size matter to what follows, but rounding and overflow would
    center, unit = r.mean(axis=0), 2.0 ** np.frexp(size)[1]
    x = (r - center) / unit
    if volume(x, faces) < 0:
        faces = faces[:, ::-1]
        changes = (*changes, "reversed all triangles, which were oriented inward")
    new, faces, remeshed = _uniform(x, np.ascontiguousarray(faces), n_nodes, name)
    return r if new is x else center + unit * new, faces, (*changes, *remeshed)


def _cleaned(r: Array, faces: Index) -> tuple[Array, Index, list[str]]:
    """Without triangles that use a point twice or are there twice, and without unused points."""
    changes = []
    corners = np.sort(faces, axis=1)
    proper = (corners[:, 0] < corners[:, 1]) & (corners[:, 1] < corners[:, 2])
    _, first = np.unique(corners, axis=0, return_index=True)
    once = np.zeros(len(faces), dtype=bool)
    once[first] = True
    kept = proper & once
    if not np.all(kept) and np.any(kept):
        changes.append(f"removed {np.sum(~kept)} triangles without area or listed twice")
        faces = faces[kept]
    used, which = np.unique(faces, return_inverse=True)
    if len(used) < len(r):
        changes.append(f"removed {len(r) - len(used)} points that no triangle uses")
    return r[used], which.reshape(-1, 3), changes


def _oriented(r: Array, faces: Index) -> tuple[Index, list[str]]:
    """Every triangle turned like its neighbors, if each edge has two and that is possible."""
    n, count = len(r), len(faces)
    tails, heads = faces.T.ravel(), np.roll(faces, -1, axis=1).T.ravel()
    face = np.tile(np.arange(count), 3)
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    order = np.argsort(low * n + high, kind="stable")
    pairs = order.reshape(-1, 2) if len(order) % 2 == 0 else order[:0].reshape(-1, 2)
    a, b = pairs.T
    if len(pairs) == 0 or np.any(low[a] != low[b]) or np.any(high[a] != high[b]):
        return faces, []
    # every triangle twice, as it is and turned; neighbors that agree are joined
    opposed = tails[a] == tails[b]
    here, there = face[a], face[b] + count * opposed
    mirrored_here, mirrored_there = here + count, face[b] + count * ~opposed
    begin, end = np.concatenate([here, mirrored_here]), np.concatenate([there, mirrored_there])
    label = components(2 * count, begin, end)[1]
    as_is, turned = label[:count], label[count:]
    if np.any(as_is == turned):
        return faces, []  # one-sided
    # of both ways of a piece the one that turns fewer triangles
    sizes = np.bincount(as_is, minlength=int(label.max()) + 1)
    turns = sizes[turned] > sizes[as_is]
    ties = (sizes[turned] == sizes[as_is]) & (turned < as_is)
    turns |= ties
    if not turns.any():
        return faces, []
    faces = np.where(turns[:, None], faces[:, ::-1], faces)
    return faces, [f"reversed {turns.sum()} triangles, to match the orientation of their neighbors"]


def _uniform(r: Array, faces: Index, n_nodes: int, name: str) -> tuple[Array, Index, list[str]]:
    """The surface on a uniform mesh of about `n_nodes`, if its own mesh is not acceptable."""
    own_length = equilateral_edge_length(area(r, faces), len(faces))
    in_order = distortion(r, faces, own_length) <= 1.0
    if in_order and MIN_NODES <= len(r) <= MAX_NODES:
        return r, faces, []
    if mesh_quality(r, faces) >= MIN_QUALITY:
        check_triangles(r, faces, name)
    # first as it is but for slivers, so that a crossing is seen; then coarser or finer
    fine, fine_faces = (r, faces) if in_order else _remeshed(r, faces, own_length, (r, faces))
    try:
        check_triangles(fine, fine_faces, name)
    except Repairable as problem:
        raise InvalidInput(
            f"{problem}: initial.repair cannot do this, as its triangles may cross or fold"
        ) from None
    n_nodes = int(min(max(n_nodes, MIN_NODES * SPREAD), MAX_NODES / SPREAD))
    wanted = equilateral_edge_length(area(fine, fine_faces), 2 * n_nodes - 4) * np.sqrt(EXCESS)
    new, new_faces = _remeshed(fine, fine_faces, float(wanted), (r, faces))
    volumes = volume(new, new_faces), volume(r, faces)
    slivers = int(np.sum(triangle_quality(r, faces) < POOR_QUALITY))
    told = (
        f"remeshed {len(r)} points as {len(new)} ({slivers} of {len(faces)} triangles had a "
        f"quality below {POOR_QUALITY:g}, the worst {mesh_quality(r, faces):.2g}, now "
        f"{mesh_quality(new, new_faces):.2g}), which changes its volume by "
        f"{volumes[0] / volumes[1] - 1.0:+.1%}"
    )
    return new, new_faces, [told]


def _remeshed(
    r: Array, faces: Index, edge_length: float, onto: tuple[Array, Index]
) -> tuple[Array, Index]:
    """The surface with edges of about this length, its nodes on the surface `onto`."""
    from scipy.spatial import cKDTree  # not for every run that imports this

    tree = cKDTree(onto[0][onto[1]].mean(axis=1))
    for _ in range(MAX_ROUNDS):
        before = faces
        r, _, faces = swept(r, np.ones(len(r)), faces, edge_length)
        mesh = connectivity(faces)
        for _ in range(RELAXATIONS):
            g = geometry(r, faces)
            r = r + 0.5 * relaxation(r, g, mesh)
            near = tree.query(r, k=min(NEAREST, tree.n))[1]
            r = np.asarray(_nearest_points(r, *onto, near))
        if faces is before or distortion(r, faces, edge_length) < GOOD_DISTORTION:
            break
    return r, faces


@compiled
def _nearest_points(points, r, faces, near):  # type: ignore[no-untyped-def]
    """The nearest point on the triangles `near` (N, K) to each of `points` (N, 3)."""
    found = np.empty(points.shape)
    for p in range(len(points)):
        least = np.inf
        for f in near[p]:
            x, y, z = _nearest_point(points[p], r, faces[f, 0], faces[f, 1], faces[f, 2])
            dx, dy, dz = points[p, 0] - x, points[p, 1] - y, points[p, 2] - z
            square = dx * dx + dy * dy + dz * dz
            if square < least:
                least = square
                found[p, 0], found[p, 1], found[p, 2] = x, y, z
    return found


@nested
def _nearest_point(p, r, i, j, k):  # type: ignore[no-untyped-def]
    """The nearest point of a triangle (C. Ericson, Real-Time Collision Detection, 2005, 5.1.5)."""
    uu, vv, uv, up, vp = 0.0, 0.0, 0.0, 0.0, 0.0
    for d in range(3):
        ab, ac, ap = r[j, d] - r[i, d], r[k, d] - r[i, d], p[d] - r[i, d]
        uu, vv, uv = uu + ab * ab, vv + ac * ac, uv + ab * ac
        up, vp = up + ab * ap, vp + ac * ap
    # shares s, t of the edges from i to j and to k
    s, t = 0.0, 0.0
    square = uu * vv - uv * uv
    if square > 0.0:
        s, t = (vv * up - uv * vp) / square, (uu * vp - uv * up) / square
    if not square > 0.0 or s < 0.0 or t < 0.0 or s + t > 1.0:
        least = np.inf
        ww = uu + vv - 2.0 * uv
        on_ab = min(1.0, max(0.0, up / uu)) if uu > 0.0 else 0.0
        on_ac = min(1.0, max(0.0, vp / vv)) if vv > 0.0 else 0.0
        on_bc = min(1.0, max(0.0, (vp - up + uu - uv) / ww)) if ww > 0.0 else 0.0
        for a, b in ((on_ab, 0.0), (0.0, on_ac), (1.0 - on_bc, on_bc)):
            # square of the distance, but for what is the same of all
            distance = a * a * uu + b * b * vv + 2.0 * (a * b * uv - a * up - b * vp)
            if distance < least:
                least, s, t = distance, a, b
    rest = 1.0 - s - t
    return (
        rest * r[i, 0] + s * r[j, 0] + t * r[k, 0],
        rest * r[i, 1] + s * r[j, 1] + t * r[k, 1],
        rest * r[i, 2] + s * r[j, 2] + t * r[k, 2],
    )
