import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.meshes.geometry import geometry
from amoeboid.meshes.operators import block_matrix, scalar_matrix, stiffness, tensile_stiffness
from amoeboid.surface.dissipation import dissipation_blocks, viscous_forces, viscous_stress
from amoeboid.surface.frame import rigid_motions
from surface.shapes import lumpy, observed_orders, sphere

ETA_S, ETA_B = 1.3, 0.7


def dissipation_matrix(r, mesh, eta_s=ETA_S, eta_b=ETA_B):
    return block_matrix(dissipation_blocks(geometry(r, mesh.faces), mesh, eta_s, eta_b), mesh)


def dissipation_from_the_metric(r, v, faces):
    """SI `dissipation`, written with the metric of each triangle as the paper has it."""
    total = 0.0
    for i, j, k in faces:
        tangents = np.array([r[j] - r[i], r[k] - r[i]])
        rates = np.array([v[j] - v[i], v[k] - v[i]])
        metric = tangents @ tangents.T
        metric_rate = rates @ tangents.T + tangents @ rates.T
        mixed = np.linalg.solve(metric, metric_rate)
        density = ETA_B / 8 * np.trace(mixed) ** 2 + ETA_S / 4 * np.trace(mixed @ mixed)
        total += 0.5 * np.sqrt(np.linalg.det(metric)) * density
    return total


def test_dissipation_is_that_of_the_metric():
    r, mesh = lumpy()
    v = np.random.default_rng(3).normal(size=r.shape)
    found = 0.5 * v.ravel() @ (dissipation_matrix(r, mesh) @ v.ravel())
    assert found == pytest.approx(dissipation_from_the_metric(r, v, mesh.faces), rel=1e-13)


def test_viscous_forces_are_those_of_the_matrix():
    r, mesh = lumpy()
    v = np.random.default_rng(4).normal(size=r.shape)
    found = viscous_forces(geometry(r, mesh.faces), mesh, v, ETA_S, ETA_B)
    expected = -(dissipation_matrix(r, mesh) @ v.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())


@given(
    seed=st.integers(0, 10**6),
    translation=st.tuples(*[st.floats(-5, 5)] * 3),
    rotation=st.tuples(*[st.floats(-5, 5)] * 3),
)
def test_rigid_motion_dissipates_nothing(seed, translation, rotation):
    r, mesh = lumpy(subdivisions=1, seed=seed)
    v = np.array(translation) + np.cross(rotation, r)
    force = dissipation_matrix(r, mesh) @ v.ravel()
    scale = ETA_S * (np.abs(v).max() + 1e-300)
    assert np.abs(force).max() < 1e-12 * scale


def test_only_rigid_motion_dissipates_nothing():
    r, mesh = lumpy()
    matrix = dissipation_matrix(r, mesh).toarray()
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-13)
    eigenvalues = np.linalg.eigvalsh(matrix)
    assert np.all(np.abs(eigenvalues[:6]) < 1e-12)
    assert eigenvalues[6] > 1e-4
    rigid = rigid_motions(r, geometry(r, mesh.faces))
    assert np.linalg.matrix_rank(rigid) == 6
    np.testing.assert_allclose(matrix @ rigid, 0, atol=1e-12)


def test_dissipation_of_a_contracting_sphere_is_the_power_of_its_stress():
    # v = -n on the unit sphere: strain rate -I, dissipation 4 pi (eta_b/2 2^2 + eta_s 2)
    exact = 4 * np.pi * (2 * ETA_B + 2 * ETA_S)
    sizes, errors = [], []
    for subdivisions in (2, 3, 4):
        r, mesh = sphere(subdivisions)
        v = -r.ravel()
        sizes.append(len(r))
        errors.append(0.5 * v @ (dissipation_matrix(r, mesh) @ v) / exact - 1)
    assert np.all(np.abs(observed_orders(sizes, errors) - 2) < 0.1)


def test_power_scales_with_the_viscosities():
    r, mesh = lumpy()
    both = dissipation_matrix(r, mesh, 2.0, 3.0).toarray()
    parts = 2 * dissipation_matrix(r, mesh, 1.0, 0.0).toarray()
    parts += 3 * dissipation_matrix(r, mesh, 0.0, 1.0).toarray()
    np.testing.assert_allclose(both, parts, atol=1e-12)


def test_viscous_stress_is_the_derivative_of_the_dissipation():
    """v.K.w = integral of stress(v) : grad w, for any second velocity w."""
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    v, w = np.random.default_rng(3).normal(size=(2, *r.shape))
    for eta_s, eta_b in ((1.0, 0.0), (0.0, 1.0), (0.7, 2.0)):
        stress = viscous_stress(g, mesh, v, eta_s, eta_b)
        slopes = np.einsum("fap,faq->fpq", g.gradients, w[mesh.faces])
        power = np.einsum("f,fpq,fpq->", g.face_areas, stress, slopes)
        matrix = block_matrix(dissipation_blocks(g, mesh, eta_s, eta_b), mesh)
        assert power == pytest.approx(w.ravel() @ (matrix @ v.ravel()), rel=1e-10)
        # tangential and symmetric
        np.testing.assert_allclose(stress, np.swapaxes(stress, 1, 2), atol=1e-12)
        np.testing.assert_allclose(np.einsum("fpq,fq->fp", stress, g.face_normals), 0, atol=1e-10)


def test_tensile_stiffness_is_that_of_the_tensile_part_of_a_stress():
    r, mesh = lumpy(subdivisions=1)
    g = geometry(r, mesh.faces)
    v = np.random.default_rng(4).normal(size=r.shape)
    stress = viscous_stress(g, mesh, v, 1.0, 1.0)
    # from eigenvectors, as a check: keep what pulls, then grad phi_a . pull . grad phi_b
    values, vectors = np.linalg.eigh(stress)
    assert values.min() < 0 < values.max()
    pull = np.einsum("fpk,fk,fqk->fpq", vectors, np.maximum(values, 0), vectors)
    expected = np.zeros((len(r), len(r)))
    local = np.einsum("f,fap,fpq,fbq->fab", g.face_areas, g.gradients, pull, g.gradients)
    for f, corners in enumerate(mesh.faces):
        expected[np.ix_(corners, corners)] += local[f]
    found = scalar_matrix(tensile_stiffness(g, mesh, stress), mesh).toarray()
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    # an even tension gives the stiffness matrix itself, an even pressure nothing
    even = np.broadcast_to(2.5 * np.eye(3), stress.shape)
    np.testing.assert_allclose(
        tensile_stiffness(g, mesh, even), 2.5 * stiffness(g, mesh), atol=1e-12
    )
    assert np.all(tensile_stiffness(g, mesh, -even) == 0)
