import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.meshes.checks import check_surface, merged, placed
from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.geometry import area, volume, volume_centroid
from amoeboid.validation import InvalidInput
from surface.written import BAD, crossing, ellipsoid, flat, two_spheres, unused


@pytest.mark.parametrize(
    ("make", "says"), [*BAD.items(), (unused, "1 of 163 points"), (flat, "degenerate")]
)
def test_a_surface_that_is_no_cell_is_rejected_with_its_reason(make, says):
    with pytest.raises(InvalidInput, match=rf"^this surface must .*{says}.*; "):
        check_surface(*make(), "this surface")


def test_nested_and_overlapping_spheres_are_rejected():
    r, faces = two_spheres((0.0, 0.0, 0.0))
    r[len(r) // 2 :] *= 0.5
    with pytest.raises(InvalidInput, match="one piece, got 2"):
        check_surface(r, faces, "x")
    with pytest.raises(InvalidInput, match="one piece, got 2"):
        check_surface(*two_spheres((0.5, 0.1, 0.2)), "x")


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_coordinates_must_be_usable_numbers(bad):
    r, faces = ellipsoid()
    r[5, 1] = bad
    with pytest.raises(InvalidInput, match="finite coordinates below 1e150"):
        check_surface(r, faces, "x")
    with pytest.raises(InvalidInput, match="must have a size > 0"):
        check_surface(0 * r[:1].repeat(len(r), axis=0) + 3.0, faces, "x")


def test_the_number_of_points_has_bounds():
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    with pytest.raises(InvalidInput, match="42 to 40962 different points, got 4"):
        check_surface(tetrahedron, faces, "x")
    check_surface(*icosphere(1), "x")
    check_surface(*icosphere(6), "x")
    with pytest.raises(InvalidInput, match="got 163842"):
        check_surface(*icosphere(7), "x")


def test_a_point_on_another_triangle_touches():
    """A pole pulled to lie exactly on a face of the other side, and to just above it."""
    r, faces = icosphere(2)
    r = np.round(r * 2**20) / 2**20  # on the grid of the predicates
    top = np.argmax(r[:, 2])
    below = faces[np.argmin(r[faces][:, :, 2].sum(axis=1))]
    touching, clear = r.copy(), r.copy()
    touching[top] = r[below[0]] / 2 + r[below[1]] / 2
    clear[top] = touching[top] + [0, 0, 1e-4]
    with pytest.raises(InvalidInput, match="must not intersect or touch"):
        check_surface(touching, faces, "x")
    check_surface(clear, faces, "x")


def star(seed, strength):
    r, faces = icosphere(2)
    waves = np.random.default_rng(seed).normal(size=(4, 3))
    radius = 1 + strength * np.prod(np.cos(2 * r @ waves.T + 0.7), axis=1)
    return r * radius[:, None], faces


SHAPES = st.tuples(st.integers(0, 2**32), st.floats(0, 0.5))


@given(
    SHAPES,
    st.floats(1e-6, 1e6),
    st.tuples(*3 * [st.floats(-100, 100)]),
    st.integers(0, 2**32),
)
def test_every_embedded_sphere_is_accepted_wherever_it_is_and_placed(shape, scale, at, seed):
    r, faces = star(*shape)
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    number = rng.permutation(len(r))
    moved = np.empty_like(r)
    moved[number] = scale * (r @ turn.T + at)
    check_surface(moved, number[faces], "x")
    start = placed(moved, number[faces], 12.5)
    assert area(start, number[faces]) == pytest.approx(12.5, rel=1e-14)
    np.testing.assert_allclose(volume_centroid(start, number[faces]), 0, atol=1e-12)
    assert volume(start, number[faces]) > 0
    # similar to what was given: distances keep their ratios
    before = np.linalg.norm(r[1:] - r[0], axis=1)
    after = np.linalg.norm(start[number[1:]] - start[number[0]], axis=1)
    np.testing.assert_allclose(after / before, after[0] / before[0], rtol=1e-9)


@given(SHAPES, st.integers(0, 319))
def test_any_missing_or_turned_triangle_is_noticed(shape, which):
    r, faces = star(*shape)
    with pytest.raises(InvalidInput, match="must be closed"):
        check_surface(r, np.delete(faces, which, axis=0), "x")
    faces[which] = faces[which, ::-1]
    with pytest.raises(InvalidInput, match="consistently oriented, at 3 edges"):
        check_surface(r, faces, "x")


def test_repeated_points_are_merged_and_only_those():
    r, faces = ellipsoid()
    r[np.abs(r) < 1e-15] = 0.0
    soup = r[faces].reshape(-1, 3)
    soup[::2] = np.where(soup[::2] == 0, -0.0, soup[::2])  # zeros of either sign are one point
    nodes, triangles = merged(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(nodes) == len(r)
    np.testing.assert_array_equal(nodes[triangles], r[faces])
    check_surface(nodes, triangles, "x")


def test_intersecting_triangles_are_named():
    r, faces = crossing()
    with pytest.raises(InvalidInput) as refusal:
        check_surface(r, faces, "x")
    first, second = (int(w) for w in str(refusal.value).split() if w.isdigit())
    pulled = np.argmin(np.linalg.norm(r - [0.1, 0.05, -1.5], axis=1))
    assert (pulled in faces[first]) != (pulled in faces[second])
