"""Solvers of the transport against direct solutions of the matrices that the surface gives."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from amoeboid.meshes.geometry import geometry
from amoeboid.meshes.operators import advection, stiffness
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.sparse import MMatrixLU, SingularMatrix, m_matrix_lu
from amoeboid.surface.model import Model
from amoeboid.surface.transport import added_diffusion
from surface.shapes import irregular, lumpy, octahedron, shuffled, tetrahedron


def transport_matrix(subdivisions, D, dt, speed, seed=0):
    """Mesh, entries, node areas: implicit transport without turnover, as in a step."""
    r, mesh = lumpy(subdivisions, seed)
    g = geometry(r, mesh.faces)
    model = Model(Parameters(D=D, beta=0), mesh)
    u = speed * (np.array([0, 0, 1.0]) - g.normals[:, 2:] * g.normals)
    entries = dt * (D * stiffness(g, mesh) - advection(g, mesh, u))
    added = added_diffusion(entries, model)
    entries -= added
    entries[model.diagonal] += np.add.reduceat(added, mesh.row_start[:-1]) + g.node_areas
    return mesh, entries, g.node_areas


def sparse(rows, columns, entries, n):
    return csc_array((entries, (rows, columns)), shape=(n, n))


TRANSPORT = [
    # D, dt, speed: usual steps, long ones, sharp peaks, hardly any diffusion
    (0.4, 0.02, 2.0),
    (0.4, 0.5, 2.0),
    (0.4, 20.0, 2.0),
    (0.03, 0.5, 5.0),
    (0.001, 1.0, 10.0),
]


@pytest.mark.parametrize("subdivisions", [0, 1, 2, 4])
@pytest.mark.parametrize(("D", "dt", "speed"), TRANSPORT)
def test_solutions_are_those_of_superlu(D, dt, speed, subdivisions):
    mesh, entries, areas = transport_matrix(subdivisions, D, dt, speed)
    b = areas * np.random.default_rng(1).uniform(0, 5, len(areas))
    solver = MMatrixLU(mesh.row_start, mesh.columns)
    x = solver.solve(entries, b, b / areas)
    exact = splu(sparse(mesh.rows, mesh.columns, entries, mesh.n_nodes)).solve(b)
    np.testing.assert_allclose(x, exact, atol=1e-11 * exact.max())
    again = MMatrixLU(mesh.row_start, mesh.columns).solve(entries, b, b / areas)
    assert np.array_equal(x, again)
    # another guess, the same solution
    cold = solver.solve(entries, b, np.zeros_like(b))
    np.testing.assert_allclose(cold, exact, atol=1e-11 * exact.max())
    # a guess that is the solution stays
    np.testing.assert_allclose(solver.solve(entries, b, x), x, rtol=1e-11)


@pytest.mark.parametrize("shape", [tetrahedron, octahedron, irregular, shuffled])
@pytest.mark.parametrize("most", [1, 2, 5, 16, 1000])
def test_matrices_without_any_structure_but_domination_are_solved(shape, most, monkeypatch):
    monkeypatch.setattr(m_matrix_lu, "MAX_UNDIVIDED", most)
    _, mesh = shape()
    rng = np.random.default_rng(0)
    entries = -rng.uniform(size=len(mesh.columns))
    diagonal = mesh.rows == mesh.columns
    entries[diagonal] = 0.0
    sums = np.bincount(mesh.columns, entries)
    entries[diagonal] = rng.uniform(0.01, 1, mesh.n_nodes) - sums
    b = rng.normal(size=mesh.n_nodes)
    solver = MMatrixLU(mesh.row_start, mesh.columns)
    x = solver.solve(entries, b, 0 * b)
    assert "_direct" not in vars(solver)
    exact = splu(sparse(mesh.rows, mesh.columns, entries, mesh.n_nodes)).solve(b)
    np.testing.assert_allclose(x, exact, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize(("D", "dt", "speed"), TRANSPORT)
def test_filaments_and_their_sign_are_kept_over_many_steps(D, dt, speed):
    mesh, entries, areas = transport_matrix(4, D, dt, speed)
    solver = MMatrixLU(mesh.row_start, mesh.columns)
    rng = np.random.default_rng(2)
    c = rng.uniform(0, 5, len(areas)) * (rng.uniform(size=len(areas)) < 0.2)
    number = areas @ c
    for _ in range(60):
        c = solver.solve(entries, areas * c, c)
        assert c.min() >= -1e-13 * c.max()
    assert "_direct" not in vars(solver)
    # large diffusive entries round by more
    assert areas @ c == pytest.approx(number, rel=1e-13 if dt < 20 else 1e-12)


@pytest.mark.parametrize("tiny", [1e-14, 1e-7, 1e-6, 1e-5])
def test_elimination_that_loses_digits_is_not_accepted(tiny):
    """A tiny diagonal beside a skew matrix: pivots are positive, and useless without exchange."""
    _, mesh = lumpy(3)
    entries = np.random.default_rng(5).normal(size=len(mesh.columns))
    entries -= entries[np.lexsort((mesh.rows, mesh.columns))]
    entries[mesh.rows == mesh.columns] = tiny
    b = np.random.default_rng(3).normal(size=mesh.n_nodes)
    exact = splu(sparse(mesh.rows, mesh.columns, entries, mesh.n_nodes)).solve(b)
    x = MMatrixLU(mesh.row_start, mesh.columns).solve(entries, b, 0 * b)
    np.testing.assert_allclose(x, exact, rtol=0, atol=1e-12 * np.abs(exact).max())


def test_matrices_without_dominant_diagonal_are_solved_with_pivoting():
    mesh, entries, areas = transport_matrix(3, 0.4, 0.1, 2.0)
    solver = MMatrixLU(mesh.row_start, mesh.columns)
    b = np.random.default_rng(3).normal(size=len(areas))
    wild = np.random.default_rng(4).normal(size=len(entries))
    exact = splu(sparse(mesh.rows, mesh.columns, wild, mesh.n_nodes)).solve(b)
    np.testing.assert_allclose(solver.solve(wild, b, 0 * b), exact, atol=1e-8 * np.abs(exact).max())
    with pytest.raises(SingularMatrix, match="regular"):
        solver.solve(0 * entries, b, b)
    for spoiled in (np.nan, np.inf):
        wrong = entries.copy()
        wrong[40] = spoiled
        with pytest.raises(SingularMatrix, match="finite"):
            solver.solve(wrong, b, b)
    with pytest.raises(SingularMatrix, match="finite"):
        solver.solve(entries, np.nan * b, b)
