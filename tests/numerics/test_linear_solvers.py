"""Solvers of the transport against direct solutions of the matrices that the surface gives."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from amoeboid.numerics import iterative
from amoeboid.numerics.banded import GeneralBand, SingularMatrix
from amoeboid.numerics.iterative import DominatedByDiagonal
from amoeboid.parameters import Parameters
from amoeboid.surface.geometry import geometry
from amoeboid.surface.model import Model
from amoeboid.surface.operators import advection, stiffness
from amoeboid.surface.transport import added_diffusion
from surface.shapes import lumpy


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


@pytest.mark.parametrize(("D", "dt", "speed"), TRANSPORT)
def test_iteration_agrees_with_the_direct_solution(D, dt, speed):
    mesh, entries, areas = transport_matrix(4, D, dt, speed)
    b = areas * np.random.default_rng(1).uniform(0, 5, len(areas))
    solver = DominatedByDiagonal(mesh.row_start, mesh.columns)
    x = solver.iterated(entries, b, b / areas)
    assert x is not None
    exact = GeneralBand(mesh.rows, mesh.columns, mesh.n_nodes).factor(entries).solve(b)
    np.testing.assert_allclose(x, exact, atol=1e-11 * exact.max())
    again = DominatedByDiagonal(mesh.row_start, mesh.columns).iterated(entries, b, b / areas)
    assert np.array_equal(x, again)
    # another guess, the same solution
    cold = solver.iterated(entries, b, np.zeros_like(b))
    np.testing.assert_allclose(cold, exact, atol=1e-11 * exact.max())


@pytest.mark.parametrize(("D", "dt", "speed"), TRANSPORT)
def test_iteration_keeps_filaments_and_their_sign_over_many_steps(D, dt, speed):
    mesh, entries, areas = transport_matrix(4, D, dt, speed)
    solver = DominatedByDiagonal(mesh.row_start, mesh.columns)
    rng = np.random.default_rng(2)
    c = rng.uniform(0, 5, len(areas)) * (rng.uniform(size=len(areas)) < 0.2)
    number = areas @ c
    for _ in range(60):
        c = solver.solve(entries, areas * c, c)
        assert c.min() >= -1e-13 * c.max()
    # LU, on the same matrices, loses up to 6e-12 by the rounding of large diffusive entries
    assert areas @ c == pytest.approx(number, rel=1e-13 if dt < 20 else 1e-12)


def test_where_the_iteration_does_not_settle_the_direct_solver_takes_over():
    mesh, entries, areas = transport_matrix(4, 0.4, 0.1, 2.0)
    solver = DominatedByDiagonal(mesh.row_start, mesh.columns)
    b = np.random.default_rng(3).normal(size=len(areas))
    wild = np.random.default_rng(4).normal(size=len(entries))
    assert solver.iterated(wild, b, 0 * b) is None
    exact = splu(sparse(mesh.rows, mesh.columns, wild, mesh.n_nodes)).solve(b)
    np.testing.assert_allclose(solver.solve(wild, b, 0 * b), exact, atol=1e-8 * np.abs(exact).max())
    with pytest.raises(SingularMatrix, match="regular"):
        solver.solve(0 * entries, b, b)


def test_small_systems_are_solved_directly(monkeypatch):
    mesh, entries, areas = transport_matrix(2, 0.4, 0.1, 2.0)
    monkeypatch.setattr(iterative, "_bicgstab", None)
    x = DominatedByDiagonal(mesh.row_start, mesh.columns).solve(entries, areas, 0 * areas)
    exact = splu(sparse(mesh.rows, mesh.columns, entries, mesh.n_nodes)).solve(areas)
    np.testing.assert_allclose(x, exact, rtol=1e-12)
