"""Every linear solver against dense solutions of the matrices that the surface gives it."""

import gc
import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from amoeboid.numerics import iterative
from amoeboid.numerics.banded import GeneralBand, SingularMatrix, SymmetricBand
from amoeboid.numerics.cholmod import SparseCholesky
from amoeboid.numerics.iterative import DominatedByDiagonal
from amoeboid.numerics.symmetric import advice, symmetric_solver
from amoeboid.parameters import Parameters
from amoeboid.surface.dissipation import dissipation_blocks
from amoeboid.surface.geometry import geometry
from amoeboid.surface.model import Model
from amoeboid.surface.operators import advection, normal_blocks, stiffness
from amoeboid.surface.transport import added_diffusion
from surface.shapes import lumpy


def force_balance_matrix(subdivisions):
    """Rows, columns, entries, size: viscous cortex with implicit tension, as in a step."""
    r, mesh = lumpy(subdivisions)
    g = geometry(r, mesh.faces)
    blocks = dissipation_blocks(g, mesh, 1.0, 1.0)
    blocks += 15.0 * normal_blocks(stiffness(g, mesh), g.normals, mesh)
    blocks[mesh.rows == mesh.columns] += 1e-3 * np.eye(3)
    axis = np.arange(3)
    rows = 3 * mesh.rows[:, None, None] + axis[:, None] + 0 * axis
    columns = 3 * mesh.columns[:, None, None] + 0 * axis[:, None] + axis
    return rows.ravel(), columns.ravel(), blocks.ravel(), 3 * mesh.n_nodes


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


@pytest.mark.parametrize("solver", [SymmetricBand, SparseCholesky])
@pytest.mark.parametrize("subdivisions", [1, 3])
def test_symmetric_solvers_agree_with_superlu(solver, subdivisions):
    rows, columns, entries, n = force_balance_matrix(subdivisions)
    b = np.random.default_rng(0).normal(size=(n, 8))
    b[:, 3] = 0.0
    b[::2, 5] = 0.0
    exact = splu(sparse(rows, columns, entries, n)).solve(b)
    factor = solver(rows, columns, n).factor(entries)
    np.testing.assert_allclose(factor.solve(b), exact, atol=1e-10 * np.abs(exact).max())
    one = factor.solve(b[:, 5])
    assert one.shape == (n,)
    np.testing.assert_allclose(one, exact[:, 5], atol=1e-10 * np.abs(exact).max())
    np.testing.assert_array_equal(factor.solve(b)[:, 3], 0.0)


@pytest.mark.parametrize("solver", [SymmetricBand, SparseCholesky])
def test_factors_do_not_disturb_each_other_and_repeat_bit_for_bit(solver):
    rows, columns, entries, n = force_balance_matrix(2)
    b = np.random.default_rng(0).normal(size=(n, 2))
    structure = solver(rows, columns, n)
    first = structure.factor(entries)
    x = first.solve(b)
    second = structure.factor(4.0 * entries)
    assert np.array_equal(first.solve(b), x)
    assert np.array_equal(second.solve(b), x / 4.0)
    del first
    gc.collect()
    assert np.array_equal(structure.factor(entries).solve(b), x)
    assert np.array_equal(second.solve(b), x / 4.0)
    assert np.array_equal(solver(rows, columns, n).factor(entries).solve(b), x)


@pytest.mark.parametrize("solver", [SymmetricBand, SparseCholesky])
def test_matrices_that_are_not_positive_definite_are_refused(solver):
    rows, columns, entries, n = force_balance_matrix(1)
    structure = solver(rows, columns, n)
    x = structure.factor(entries).solve(np.ones(n))
    spoiled = entries.copy()
    spoiled[np.flatnonzero(rows == columns)[n // 2]] = -1.0
    with pytest.raises(SingularMatrix, match="positive definite"):
        structure.factor(spoiled)
    spoiled[np.flatnonzero(rows == columns)[n // 2]] = np.nan
    with pytest.raises(SingularMatrix, match="positive definite"):
        structure.factor(spoiled)
    # a refusal leaves nothing behind
    assert np.array_equal(structure.factor(entries).solve(np.ones(n)), x)


def test_the_solver_is_chosen_by_size_and_presence(monkeypatch):
    small, large = force_balance_matrix(3), force_balance_matrix(4)
    for rows, columns, _, n in (small, large):
        expected = SparseCholesky if n == 7686 else SymmetricBand
        assert isinstance(symmetric_solver(rows, columns, n), expected)
    assert advice(10**6) is None
    # as if cvxopt were not installed
    monkeypatch.setitem(sys.modules, "cvxopt", None)
    monkeypatch.setitem(sys.modules, "cvxopt.cholmod", None)
    rows, columns, entries, n = large
    chosen = symmetric_solver(rows, columns, n)
    assert isinstance(chosen, SymmetricBand)
    assert np.all(np.isfinite(chosen.factor(entries).solve(np.ones(n))))
    assert "pip install 'amoeboid[fast]'" in advice(n)
    assert advice(small[3]) is None


def test_the_optional_package_is_imported_only_where_it_is_used():
    code = (
        "import sys\n"
        "from amoeboid.cli.main import main\n"
        "import amoeboid.surface.model, amoeboid.simulation\n"
        "assert not [m for m in sys.modules if m.startswith('cvxopt')]\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


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
