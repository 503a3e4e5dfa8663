import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.surface.dissipation import dissipation_blocks, viscous_forces
from amoeboid.surface.force_balance import rigid_motions
from amoeboid.surface.geometry import geometry
from amoeboid.surface.operators import block_matrix
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


def test_contracting_sphere_dissipates_what_the_stress_says():
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
