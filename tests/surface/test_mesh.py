import numpy as np
import pytest

from amoeboid.meshes.connectivity import connectivity, icosphere
from amoeboid.meshes.geometry import geometry, volume
from amoeboid.meshes.relaxation import _relaxed, relaxation, uniform_icosphere
from amoeboid.validation import InvalidInput
from surface.shapes import sphere

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.mark.parametrize("subdivisions", [1, 2, 3, 4])
def test_icosphere_is_a_closed_sphere(subdivisions):
    r, faces = icosphere(subdivisions)
    mesh = connectivity(faces)
    nodes, edges = len(r), (len(mesh.columns) - len(r)) // 2
    assert nodes == mesh.n_nodes == 10 * 4**subdivisions + 2
    assert nodes - edges + len(faces) == 2  # Euler characteristic
    assert volume(r, faces) > 0  # oriented outward
    np.testing.assert_allclose(np.linalg.norm(r, axis=1), 1, rtol=1e-14)
    assert np.sum(mesh.valence == 5) == 12
    assert np.sum(mesh.valence == 6) == nodes - 12
    poles = np.flatnonzero(np.abs(r[:, 2]) > 1 - 1e-12)
    assert list(mesh.valence[poles]) == [6, 6]


def test_numbering_keeps_the_band_narrow():
    # a sphere of V nodes can be cut by rings of about 2 sqrt(V) nodes
    for subdivisions in (2, 3, 4):
        mesh = connectivity(icosphere(subdivisions)[1])
        assert np.max(np.abs(mesh.rows - mesh.columns)) < 2 * np.sqrt(mesh.n_nodes)


def test_pattern_and_slots_agree():
    mesh = connectivity(TETRAHEDRON)
    assert np.array_equal(mesh.columns, np.tile(np.arange(4), 4))
    for f, corners in enumerate(mesh.faces):
        for a in range(3):
            for b in range(3):
                slot = mesh.slots[f, a, b]
                assert (mesh.rows[slot], mesh.columns[slot]) == (corners[a], corners[b])


@pytest.mark.parametrize(
    ("faces", "says"),
    [
        (TETRAHEDRON[:3], "F >= 4"),
        (TETRAHEDRON[:, :2], r"shape \(F, 3\)"),
        (np.vstack([TETRAHEDRON[:3], [[4, 0, 3]]]), "closed"),
        (np.vstack([TETRAHEDRON[:3], TETRAHEDRON[3:, ::-1]]), "oriented"),
        (np.vstack([TETRAHEDRON, TETRAHEDRON]), "closed"),
        (np.vstack([TETRAHEDRON, TETRAHEDRON + 4]), "one connected piece"),
        (TETRAHEDRON + 1, "unused node"),
    ],
)
def test_surfaces_that_are_not_closed_are_rejected(faces, says):
    with pytest.raises(InvalidInput, match=says):
        connectivity(faces)


@pytest.mark.parametrize("subdivisions", [2, 3, 4])
def test_uniform_icosphere_is_relaxed_and_well_shaped(subdivisions):
    r, mesh = sphere(subdivisions)
    g = geometry(r, mesh.faces)
    assert np.abs(relaxation(r, g, mesh)).max() < 1e-9
    np.testing.assert_allclose(np.linalg.norm(r, axis=1), 1, rtol=1e-14)
    assert g.face_areas.min() > 0.5 * g.face_areas.max()


@pytest.mark.parametrize("subdivisions", [0, 1, 3, 4])
def test_uniform_icosphere_is_the_relaxed_icosphere(subdivisions):
    """The way over coarser meshes leads where the icosphere itself goes, node by node."""
    r, faces = uniform_icosphere(subdivisions)
    start, expected_faces = icosphere(subdivisions)
    assert np.array_equal(faces, expected_faces)
    expected = _relaxed(start, faces, 1e-12)
    np.testing.assert_allclose(r, expected, atol=2e-9)
    again, _ = uniform_icosphere(subdivisions)
    assert np.array_equal(r, again)


def test_faces_are_listed_along_the_nodes():
    for subdivisions in (1, 3, 4):
        first = icosphere(subdivisions)[1].min(axis=1)
        assert np.all(np.diff(first) >= 0)


def test_relaxation_is_tangential_and_makes_triangles_uniform():
    r, mesh = sphere(2)
    rng = np.random.default_rng(1)
    r = r + 0.03 * rng.normal(size=r.shape)
    r /= np.linalg.norm(r, axis=1, keepdims=True)
    g = geometry(r, mesh.faces)
    drift = relaxation(r, g, mesh)
    np.testing.assert_allclose(np.einsum("vi,vi->v", drift, g.normals), 0, atol=1e-15)
    spread_before = np.ptp(g.face_areas)
    for _ in range(20):
        r = r + 0.5 * relaxation(r, geometry(r, mesh.faces), mesh)
    assert np.ptp(geometry(r, mesh.faces).face_areas) < 0.5 * spread_before
