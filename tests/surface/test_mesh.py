import numpy as np
import pytest
from scipy.sparse import coo_array, csgraph

from amoeboid.meshes.connectivity import connectivity, icosphere
from amoeboid.meshes.geometry import geometry, volume
from amoeboid.meshes.graphs import components, reverse_cuthill_mckee
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


@pytest.mark.parametrize("subdivisions", [0, 2, 4])
def test_reverse_cuthill_mckee_is_that_of_scipy(subdivisions):
    nodes, faces = icosphere(subdivisions)
    mesh = connectivity(np.random.default_rng(0).permutation(len(nodes))[faces])
    graph = coo_array((np.ones(len(mesh.rows)), (mesh.rows, mesh.columns))).tocsr()
    # SciPy leaves open which of the nodes of least valence is the first
    first = np.argmin(mesh.valence)
    theirs = csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    ours = reverse_cuthill_mckee(mesh.row_start, mesh.columns)
    assert ours[-1] == first
    assert sorted(ours) == list(range(len(nodes)))

    def band(order):
        place = np.argsort(order)
        return np.abs(place[mesh.rows] - place[mesh.columns]).max()

    if theirs[-1] == first:
        np.testing.assert_array_equal(ours, theirs)
    assert band(ours) <= 1.1 * band(theirs)


def test_order_of_neighbors_is_by_valence_then_by_number():
    """A star whose arms 1 to 4 have 1, 3, 2 and 2 further nodes; 0 is the middle."""
    arms = {1: [5], 2: [6, 7, 8], 3: [9, 10], 4: [11, 12]}
    pairs = [(0, arm) for arm in arms] + [(arm, leaf) for arm in arms for leaf in arms[arm]]
    begin, end = np.array(pairs + [p[::-1] for p in pairs] + [(i, i) for i in range(13)]).T
    order = np.lexsort((end, begin))
    row_start = np.searchsorted(begin[order], np.arange(14))
    found = reverse_cuthill_mckee(row_start, end[order])
    assert found[::-1].tolist() == [5, 1, 0, 3, 4, 2, 9, 10, 11, 12, 6, 7, 8]


@pytest.mark.parametrize(("nodes", "links"), [(1, 0), (7, 3), (300, 200), (300, 290), (2000, 3000)])
def test_components_are_those_of_scipy(nodes, links):
    begin, end = np.random.default_rng(links).integers(0, nodes, (2, links))
    graph = coo_array((np.ones(links), (begin, end)), shape=(nodes, nodes))
    count, pieces = csgraph.connected_components(graph, directed=False)
    ours = components(nodes, begin, end)
    assert ours[0] == count
    np.testing.assert_array_equal(ours[1], pieces)


def test_a_long_chain_in_any_order_is_one_piece():
    chain = np.random.default_rng(3).permutation(5000)
    assert components(5000, chain[:-1], chain[1:])[0] == 1


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
