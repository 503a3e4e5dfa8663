import numpy as np
import pytest

from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.geometry import (
    area,
    area_gradient,
    geometry,
    node_areas,
    smooth_area,
    volume,
    volume_centroid,
    weighted_area_gradient,
)
from amoeboid.meshes.operators import (
    block_matrix,
    block_product,
    mass,
    normal_blocks,
    normal_projection,
    product,
    scalar_matrix,
    stiffness,
)
from amoeboid.meshes.relaxation import uniform_icosphere
from surface.shapes import lumpy, observed_orders, sphere, volume_gradient


def directional_derivative(f, r, d, step=1e-5):
    """Fourth-order central difference."""
    return (8 * (f(r + step * d) - f(r - step * d)) - f(r + 2 * step * d) + f(r - 2 * step * d)) / (
        12 * step
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_gradients_of_area_and_volume_are_exact(seed):
    r, mesh = lumpy(seed=seed)
    g = geometry(r, mesh.faces)
    rng = np.random.default_rng(seed)
    d, weights = rng.normal(size=r.shape), rng.uniform(size=len(mesh.faces))

    def weighted_area(x):
        return weights @ geometry(x, mesh.faces).face_areas

    for f, gradient in (
        (lambda x: area(x, mesh.faces), area_gradient(g, mesh.faces)),
        (lambda x: volume(x, mesh.faces), volume_gradient(r, mesh.faces)),
        (weighted_area, weighted_area_gradient(g, mesh.faces, weights)),
    ):
        assert directional_derivative(f, r, d) == pytest.approx(np.sum(gradient * d), rel=1e-9)


def test_area_gradient_is_the_stiffness_applied_to_the_nodes():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    matrix = scalar_matrix(stiffness(g, mesh), mesh)
    np.testing.assert_allclose(matrix @ r, area_gradient(g, mesh.faces), atol=1e-14)


def test_energies_do_not_change_under_rigid_motion():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    for gradient in (area_gradient(g, mesh.faces), volume_gradient(r, mesh.faces)):
        np.testing.assert_allclose(gradient.sum(axis=0), 0, atol=1e-13)
        np.testing.assert_allclose(np.cross(r, gradient).sum(axis=0), 0, atol=1e-13)


def test_on_any_mesh_of_a_sphere_normals_and_curvature_are_exact():
    """dA/dr.n = (2/R) dual area, however uneven the mesh: tension and pressure balance."""
    r, mesh = sphere(2)
    r = r + 0.01 * np.random.default_rng(0).normal(size=r.shape)
    radius, center = 1.7, np.array([0.3, -0.2, 0.5])
    n = r / np.linalg.norm(r, axis=1, keepdims=True)
    r = center + radius * n
    g = geometry(r, mesh.faces)
    assert np.ptp(g.node_areas) > 0.4 * g.node_areas.mean()
    np.testing.assert_allclose(g.normals, n, atol=1e-12)
    curvature = np.einsum("vi,vi->v", area_gradient(g, mesh.faces), n) / g.dual_areas
    np.testing.assert_allclose(curvature, 2.0 / radius, rtol=1e-11)


def test_dual_areas_are_the_curvature_of_area_on_any_mesh_of_a_sphere():
    """dA/dr.n = 2/R dual area, obtuse triangles and all; areas sum to the area."""
    rng = np.random.default_rng(2)
    for radius in (1.0, 3.0):
        r, faces = uniform_icosphere(3)
        r = r + 0.6 * np.sqrt(4 * np.pi / len(r)) * rng.uniform(-0.5, 0.5, r.shape)
        r *= radius / np.linalg.norm(r, axis=1, keepdims=True)
        g = geometry(r, faces)
        corners = np.einsum("fai,fbi->fab", g.gradients, g.gradients)
        obtuse = np.max(corners * (1 - np.eye(3)), axis=(1, 2)) > 0
        assert obtuse.mean() > 0.1
        along = np.einsum("vi,vi->v", area_gradient(g, faces), g.normals)
        np.testing.assert_allclose(along, 2.0 / radius * g.dual_areas, rtol=1e-9, atol=1e-12)
        assert g.dual_areas.sum() == pytest.approx(g.area, rel=1e-13)


def test_mass_matrix_integrates_products_of_linear_functions():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    a, b = np.random.default_rng(0).normal(size=(2, len(r)))
    # the middles of the edges integrate a quadratic exactly
    middle = [0.5 * (x[mesh.faces] + np.roll(x[mesh.faces], 1, axis=1)) for x in (a, b)]
    exact = np.sum(g.face_areas / 3.0 * np.sum(middle[0] * middle[1], axis=1))
    assert a @ product(mass(g, mesh), mesh, b) == pytest.approx(exact, rel=1e-12)
    rows = product(mass(g, mesh), mesh, np.ones(len(r)))
    np.testing.assert_allclose(rows, g.node_areas, rtol=1e-13)


def test_node_areas_normals_and_hat_gradients():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    assert g.node_areas.sum() == pytest.approx(area(r, mesh.faces), rel=1e-14)
    np.testing.assert_allclose(np.linalg.norm(g.normals, axis=1), 1, rtol=1e-14)
    assert g.dual_areas.sum() == pytest.approx(area(r, mesh.faces), rel=1e-14)
    along = volume_gradient(r, mesh.faces)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    assert np.einsum("vi,vi->v", along, g.normals).min() > 0.999
    # hat functions sum to one, and reproduce linear functions on each triangle
    np.testing.assert_allclose(g.gradients.sum(axis=1), 0, atol=1e-13)
    slope = np.array([0.3, -1.2, 0.7])
    found = np.einsum("fai,fa->fi", g.gradients, (r @ slope)[mesh.faces])
    tangential = slope - (g.face_normals @ slope)[:, None] * g.face_normals
    np.testing.assert_allclose(found, tangential, atol=1e-12)


def test_sphere_area_volume_and_tension_converge_at_second_order():
    sizes, errors = [], []
    for subdivisions in (2, 3, 4):
        r, mesh = sphere(subdivisions)
        sizes.append(len(r))
        errors.append(
            (area(r, mesh.faces) / (4 * np.pi) - 1, volume(r, mesh.faces) / (4 * np.pi / 3) - 1)
        )
    for column in np.transpose(errors):
        assert np.all(np.abs(observed_orders(sizes, column) - 2) < 0.1)


def test_node_areas_are_those_of_the_geometry():
    r, mesh = lumpy()
    np.testing.assert_allclose(
        node_areas(r, mesh.faces), geometry(r, mesh.faces).node_areas, rtol=1e-13
    )


def test_volume_centroid_moves_with_the_shape():
    r, mesh = lumpy()
    center = volume_centroid(r, mesh.faces)
    shift = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(volume_centroid(r + shift, mesh.faces), center + shift, atol=1e-13)
    # of a half-stretched cube-like body: the centroid of a linear map is the mapped centroid
    stretched = volume_centroid(2 * r, mesh.faces)
    np.testing.assert_allclose(stretched, 2 * center, atol=1e-13)


def test_normal_blocks_of_a_projection_are_the_projected_matrix():
    r, mesh = lumpy(subdivisions=1)
    g = geometry(r, mesh.faces)
    entries = stiffness(g, mesh)
    dense = scalar_matrix(entries, mesh).toarray()
    projector = np.zeros((3 * len(r), 3 * len(r)))
    for i, n in enumerate(g.normals):
        projector[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = np.outer(n, n)
    expected = projector @ np.kron(dense, np.eye(3)) @ projector
    projected = normal_projection(entries, g.normals, mesh)
    blocks = normal_blocks(projected, g.normals, mesh)
    found = block_matrix(blocks, mesh).toarray()
    v = np.random.default_rng(5).normal(size=r.shape)
    np.testing.assert_allclose(
        block_product(blocks, mesh, v).ravel(), found @ v.ravel(), atol=1e-12
    )
    np.testing.assert_allclose(found, expected, atol=1e-13)
    u = np.random.default_rng(6).normal(size=len(r))
    np.testing.assert_allclose(
        product(projected, mesh, u),
        np.einsum("vi,vi->v", g.normals, dense @ (u[:, None] * g.normals)),
        atol=1e-12,
    )


def test_area_of_the_smooth_surface_is_of_fourth_order():
    """Of a sphere and a long ellipsoid, whose polyhedra are of second order."""
    e = np.sqrt(1 - 1 / 1.5**2)
    exact = {1.0: 4 * np.pi, 1.5: 2 * np.pi * (1 + 1.5 / e * np.arcsin(e))}
    for length, wanted in exact.items():
        errors = []
        for subdivisions in (2, 3, 4):
            r, faces = icosphere(subdivisions)
            errors.append(abs(smooth_area(r * [1, 1, length], faces) / wanted - 1))
        print(length, errors)
        assert np.log2(errors[1] / errors[2]) > 3.7
        assert errors[1] < 2e-5


def test_area_of_a_surface_that_is_not_resolved_is_positive():
    r, faces = icosphere(1)
    for seed in range(5):
        torn = r * np.random.default_rng(seed).uniform(0.1, 3.0, (len(r), 1))
        assert 0.5 * area(torn, faces) <= smooth_area(torn, faces) <= 1.5 * area(torn, faces)
