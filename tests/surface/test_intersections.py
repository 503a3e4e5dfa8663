"""The integer predicates against separating axes: another method, exact on small whole numbers."""

from itertools import combinations, product

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.intersections import GRID, _side_of_plane, intersecting_pair
from amoeboid.numerics.compiled import compiled

SMALL = st.integers(0, 4)
POINT = st.tuples(SMALL, SMALL, SMALL)


@compiled
def side_of_plane(nodes, a, b, c, d):
    return _side_of_plane(nodes, a, b, c, d)


def edges(corners):
    return [b - a for a, b in combinations(corners, 2)]


def disjoint(first, second):
    """Whether a plane strictly separates two convex sets given by their corners."""
    normals = [np.cross(x, y) for s in (first, second) for x, y in combinations(edges(s), 2)]
    axes = [np.cross(x, y) for x, y in product(edges(first), edges(second))] + normals
    axes += [np.cross(n, e) for n in normals for e in edges(first) + edges(second)]
    axes += edges(first) + edges(second)
    for axis in axes:
        a, b = first @ axis, second @ axis
        if a.max() < b.min() or b.max() < a.min():
            return True
    return False


def is_triangle(corners):
    return np.any(np.cross(corners[1] - corners[0], corners[2] - corners[0]))


def meets(nodes, first, second):
    return intersecting_pair(np.array(nodes, float), np.array([first, second])) is not None


@given(st.lists(POINT, min_size=6, max_size=6))
def test_triangles_without_common_nodes(points):
    nodes = np.array(points)
    first, second = nodes[:3], nodes[3:]
    if is_triangle(first) and is_triangle(second):
        assert meets(nodes, [0, 1, 2], [3, 4, 5]) == (not disjoint(first, second))
        assert meets(nodes, [2, 0, 1], [4, 3, 5]) == (not disjoint(first, second))


FLAT = st.tuples(SMALL, SMALL)
PLANES = st.sampled_from([(0, 1, 2), (1, 0, 2), (3, 1, 1), (1, 2, 0), (0, 0, 1)])


def in_plane(points, normal):
    """Points of the plane grid, tilted and moved in space, whole numbers still."""
    first = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0]][int(np.argmin(normal))])
    axes = np.array([np.cross(normal, first), np.cross(normal, np.cross(normal, first))])
    return np.array(points) @ axes + [3, 5, 7]


# one within the other; edges on one line, apart, in overlapping boxes
NESTED = [(0, 0), (9, 0), (0, 9), (1, 1), (2, 1), (1, 2)]
IN_LINE = [(0, 4), (1, 5), (0, 8), (2, 6), (3, 7), (0, 0)]


@example(NESTED, (0, 0, 1))
@example(NESTED, (3, 1, 1))
@example(IN_LINE, (0, 0, 1))
@example(IN_LINE, (3, 1, 1))
@given(st.lists(FLAT, min_size=6, max_size=6), PLANES)
def test_triangles_in_one_plane(points, normal):
    nodes = in_plane(points, normal)
    first, second = nodes[:3], nodes[3:]
    if is_triangle(first) and is_triangle(second):
        assert meets(nodes, [0, 1, 2], [3, 4, 5]) == (not disjoint(first, second))


@given(st.lists(FLAT, min_size=5, max_size=5, unique=True), PLANES)
def test_triangles_in_one_plane_with_one_common_node(points, normal):
    nodes = in_plane(points, normal)
    first, second = nodes[[0, 1, 2]], nodes[[0, 3, 4]]
    if is_triangle(first) and is_triangle(second):
        cut = np.vstack([1000 * first[1:], 999 * nodes[0] + first[1:]])
        assert meets(nodes, [0, 1, 2], [0, 3, 4]) == (not disjoint(cut, 1000 * second))


@given(st.lists(POINT, min_size=5, max_size=5, unique=True))
def test_triangles_with_one_common_node(points):
    """They meet elsewhere if and only if what is left of one, cut off near the node, meets."""
    nodes = np.array(points)
    first, second = nodes[[0, 1, 2]], nodes[[0, 3, 4]]
    if is_triangle(first) and is_triangle(second):
        # a common segment from the node on is at least a 1/1000 of the triangle long
        cut = np.vstack([1000 * first[1:], 999 * nodes[0] + first[1:]])
        separate = disjoint(cut, 1000 * second)
        assert meets(nodes, [0, 1, 2], [0, 3, 4]) == (not separate)
        assert meets(nodes, [1, 2, 0], [4, 0, 3]) == (not separate)


@given(st.lists(POINT, min_size=4, max_size=4, unique=True))
def test_triangles_with_a_common_edge_meet_if_folded_flat(points):
    a, b, c, d = nodes = np.array(points)
    n, m = np.cross(b - a, c - a), np.cross(b - a, d - a)
    if np.any(n) and np.any(m):
        folded = not np.any(np.cross(n, m)) and n @ m > 0
        assert meets(nodes, [0, 1, 2], [1, 0, 3]) == folded


COORDINATE = st.integers(0, GRID)
FAR = st.tuples(COORDINATE, COORDINATE, COORDINATE)


@given(FAR, FAR, FAR, st.integers(-3, 3), st.integers(-3, 3), st.tuples(*3 * [st.integers(-1, 1)]))
def test_the_side_of_a_plane_is_exact_on_the_whole_grid(a, b, c, s, t, off):
    """Points in or next to the plane, where a rounded determinant has any sign."""
    a, b, c, off = (np.array(x, dtype=object) for x in (a, b, c, off))
    d = np.clip(a + s * (b - a) + t * (c - a) + off, 0, GRID)
    exact = determinant(b - a, c - a, d - a)
    nodes = np.array([a, b, c, d], dtype=np.int64)
    assert side_of_plane(nodes, 0, 1, 2, 3) == (exact > 0) - (exact < 0)


def determinant(x, y, z):
    """In Python's whole numbers, which do not round."""
    return sum(
        x[i] * (y[(i + 1) % 3] * z[(i + 2) % 3] - y[(i + 2) % 3] * z[(i + 1) % 3]) for i in range(3)
    )


def test_extreme_corners_do_not_overflow():
    corners = np.array(list(product((0, GRID), repeat=3)), dtype=np.int64)
    for four in combinations(range(8), 4):
        a, b, c, d = (corners[i].astype(object) for i in four)
        exact = determinant(b - a, c - a, d - a)
        assert side_of_plane(corners, *four) == (exact > 0) - (exact < 0)


def test_every_pair_is_found_that_a_search_of_all_pairs_finds():
    """Two spheres, one moved into the other: the sweep misses no candidate."""
    r, faces = icosphere(1)
    for shift in ([0.3, 0.1, 0.2], [1.9, 0.1, 0.0], [2.1, 0.0, 0.0], [0, 0, -1.95]):
        nodes = np.vstack([r, r + shift])
        pairs = product(faces, faces + len(r))
        crossing = any(meets(nodes, first, second) for first, second in pairs)
        both = np.vstack([faces, faces + len(r)])
        assert (intersecting_pair(nodes, both) is not None) == crossing
        assert crossing == (shift[0] != 2.1)
