"""What a user's surface must be: one closed, embedded, outward sphere of sound triangles.

Every rule is checked here, on arrays; every message gives the rule, the value found and a remedy.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.geometry import MIN_QUALITY, area, mesh_quality, volume, volume_centroid
from amoeboid.meshes.graphs import components
from amoeboid.meshes.intersections import intersecting_pair
from amoeboid.validation import InvalidInput

# Those of mesh.subdivisions = 1 and 6.
MIN_NODES, MAX_NODES = 42, 40962
# Points differ by rounding if by no more than half this share of their largest coordinate (single
# precision, six digits), and by less than this share of an edge.
ROUNDING, SHARE_OF_EDGE = 2.0**-18, 0.01


class Repairable(InvalidInput):
    """A surface breaks a rule in a way that `repair.repaired` can repair."""


def merged(r: Array, faces: Index) -> tuple[Array, Index]:
    """The surface with nodes of equal coordinates made one; STL repeats them per triangle."""
    unique, which = np.unique(r, axis=0, return_inverse=True)
    return unique, which.reshape(-1)[faces]


def joined(r: Array, faces: Index) -> tuple[Array, Index, tuple[str, ...]]:
    """The surface with nodes joined that differ by rounding, if that closes a seam, and a report.

    In a file in single precision, or with six digits, the coordinates of a point may differ
    slightly between the triangles that share it.
    """
    r, faces = merged(r, faces)
    half_edges = _half_edges(faces)
    ends = np.sort(half_edges, axis=1)
    counts = np.unique(ends[:, 0] * len(r) + ends[:, 1], return_counts=True)[1]
    lengths = np.linalg.norm(r[half_edges[:, 0]] - r[half_edges[:, 1]], axis=1)
    spacing = min(ROUNDING * np.abs(r).max(), SHARE_OF_EDGE * np.median(lengths))
    if np.all(counts > 1) or not spacing > 0:
        return r, faces, ()
    which = _close(r, spacing)
    _, first = np.unique(which, return_index=True)
    gone = len(r) - len(first)
    if gone == 0:
        return r, faces, ()
    moved = np.abs(r[first][which] - r).max() / np.ptp(r, axis=0).max()
    told = f"joined {gone} points with others that differ by {moved:.1g} of the size, by rounding"
    return r[first], which[faces], (told,)


def _close(r: Array, spacing: float) -> Index:
    """Number of the group (V,) of each point: points less than spacing/2 apart are in one."""
    n = len(r)
    links = []
    # the cells of a grid and of those shifted by half a spacing: two close points share one of them
    for shift in product((0.0, 0.5), repeat=3):
        cell = np.unique(np.floor(r / spacing + shift), axis=0, return_inverse=True)[1].reshape(-1)
        first = np.full(int(cell.max()) + 1, n)
        np.minimum.at(first, cell, np.arange(n))
        links.append(first[cell])
    return components(n, np.tile(np.arange(n), 8), np.concatenate(links))[1]


def check_surface(r: Array, faces: Index, name: str) -> None:
    """Raise InvalidInput, beginning with `name`, unless a cell can start as this surface.

    The error is Repairable if `repair` can repair the surface. r (V, 3), V > 0, faces (F, 3) with
    entries in 0..V-1.
    """
    size = check_size(r, name)
    r = (r - r.min(axis=0)) / 2.0 ** np.frexp(size)[1]
    _check_numbers(r, faces, name)
    check_mesh(r, faces, name)
    check_triangles(r, faces, name)


def check_size(r: Array, name: str) -> float:
    """The size of the surface. Raises InvalidInput if its square would overflow or vanish."""
    largest = np.abs(r).max()
    if not largest < 1e150:
        raise InvalidInput(f"{name} must have finite coordinates below 1e150, got {largest:g}")
    size = float(np.ptp(r, axis=0).max())
    if not size > 1e-150:
        raise InvalidInput(f"{name} must have a size > 0, got {size:g}")
    return size


def check_mesh(r: Array, faces: Index, name: str) -> None:
    """Raise InvalidInput unless the triangles make one closed, oriented sphere."""
    _check_edges(faces, name)
    _check_nodes(r, faces, name)
    _check_topology(len(r), faces, name)


def placed(r: Array, faces: Index, membrane_area: float) -> Array:
    """The surface about its volume center, scaled to the area [nodes (V, 3)]."""
    r = r - r.mean(axis=0)  # first, so that the centroid of a far-off surface is accurate
    r = r / np.ptp(r)
    r = r - volume_centroid(r, faces)
    return np.asarray(r * np.sqrt(membrane_area / area(r, faces)))


def _check_numbers(r: Array, faces: Index, name: str) -> None:
    unused = len(r) - len(np.unique(faces))
    if unused:
        raise Repairable(
            f"{name} must use every point in a triangle, {unused} of {len(r)} points are in none; "
            "remove them"
        )
    if not MIN_NODES <= len(r) <= MAX_NODES:
        raise Repairable(
            f"{name} must have {MIN_NODES} to {MAX_NODES} different points, got {len(r)}; remesh it"
        )


def _check_edges(faces: Index, name: str) -> None:
    """Every edge in two triangles, which run along it in opposite directions."""
    n = int(faces.max()) + 1
    half_edges = _half_edges(faces)
    collapsed = int(np.sum(half_edges[:, 0] == half_edges[:, 1]))
    if collapsed:
        raise Repairable(
            f"{name} must not have degenerate triangles, {collapsed} edges have no length; "
            "remove those triangles or remesh"
        )
    ends = np.sort(half_edges, axis=1)
    counts = np.unique(ends[:, 0] * n + ends[:, 1], return_counts=True)[1]
    if np.any(counts > 2):
        raise InvalidInput(
            f"{name} must be a manifold: two triangles at every edge, {np.sum(counts > 2)} edges "
            "have more; remove inner walls and repeated triangles"
        )
    if np.any(counts < 2):
        raise InvalidInput(
            f"{name} must be closed: two triangles at every edge, {np.sum(counts < 2)} edges have "
            "one; fill the holes, and join seams and points that lie on an edge"
        )
    directed = np.unique(half_edges[:, 0] * n + half_edges[:, 1])
    if len(directed) < len(half_edges):
        raise Repairable(
            f"{name} must be consistently oriented, at {len(half_edges) - len(directed)} edges a "
            "triangle is oriented inward and its neighbor outward; reorient the triangles"
        )


def _check_nodes(r: Array, faces: Index, name: str) -> None:
    """The triangles around every node are one fan."""
    n = len(r)
    begin, end = _half_edges(faces).T
    corner = np.arange(len(begin)).reshape(3, -1)
    following = np.roll(corner, -1, axis=0).ravel()  # the next corner of the same triangle
    forward, backward = np.argsort(begin * n + end), np.argsort(end * n + begin)
    # the fan continues in the triangle across the edge, whose corner there follows the twin
    fans, _ = components(len(begin), forward, following[backward])
    if fans != n:
        raise InvalidInput(
            f"{name} must be a manifold: one fan of triangles around every point, got {fans - n} "
            "more fans than points; separate the parts that touch at a point"
        )


def _check_topology(n: int, faces: Index, name: str) -> None:
    begin, end = _half_edges(faces).T
    pieces, label = components(n, begin, end)
    if pieces != 1:
        sizes = np.sort(np.bincount(label[faces[:, 0]], minlength=pieces))[::-1].tolist()
        some = ", ".join(map(str, sizes[:3])) + (", ..." if pieces > 3 else "")
        raise InvalidInput(
            f"{name} must be one piece, got {pieces} (of {some} triangles); keep one of them"
        )
    characteristic = n - len(faces) // 2  # V - E + F with E = 3F/2
    if characteristic != 2:
        raise InvalidInput(
            f"{name} must be a deformed sphere (Euler characteristic 2), got {characteristic}, "
            f"handles like that of a torus: {(2 - characteristic) // 2}; close them"
        )


def check_triangles(r: Array, faces: Index, name: str) -> None:
    """Raise InvalidInput for triangles without area, that cross, or that look inward."""
    quality = mesh_quality(r, faces)
    if not quality >= MIN_QUALITY:
        raise Repairable(
            f"{name} must not have degenerate triangles (quality >= {MIN_QUALITY:g}, 1 is "
            f"equilateral), the worst has {quality:.3g}; remesh it"
        )
    pair = intersecting_pair(r, faces)
    if pair is not None:
        raise InvalidInput(
            f"{name} must not intersect or touch itself, triangles {pair[0]} and {pair[1]} do; "
            "repair it, for example by remeshing its outer hull"
        )
    enclosed = volume(r, faces)
    if not enclosed > 0:
        raise Repairable(
            f"{name} must be oriented outward (points of a triangle counter-clockwise seen from "
            "outside), it is oriented inward; reverse the order of the points in every triangle"
        )


def _half_edges(faces: Index) -> Index:
    """Directed edges (3F, 2): of corner 0 of all triangles, then of corner 1, then of corner 2."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
