"""The sparse Cholesky factorization and its order, on meshes of every kind."""

import copy
import gc
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import bsr_array
from scipy.sparse.linalg import splu

from amoeboid.meshes.geometry import geometry
from amoeboid.meshes.operators import normal_blocks, stiffness
from amoeboid.numerics.sparse import SingularMatrix, SparseCholesky, cholesky
from amoeboid.numerics.sparse.dissection import dissected
from amoeboid.surface.dissipation import dissipation_blocks
from surface.shapes import (
    dumbbell,
    irregular,
    lumpy,
    octahedron,
    shuffled,
    sphere,
    tetrahedron,
)

MESHES = {
    "tetrahedron": tetrahedron,
    "octahedron": octahedron,
    "icosahedron": lambda: lumpy(0),
    "42 nodes": lambda: lumpy(1),
    "sphere": lambda: sphere(3),
    "2562 nodes": lambda: lumpy(4),
    "dumbbell": lambda: dumbbell(3),
    "irregular": irregular,
    "shuffled": shuffled,
}
EVERY = pytest.mark.parametrize("shape", MESHES.values(), ids=MESHES)


def force_balance(r, mesh):
    """Blocks (P, 3, 3): viscous cortex with implicit tension, as in a step."""
    g = geometry(r, mesh.faces)
    blocks = dissipation_blocks(g, mesh, 1.0, 1.0)
    blocks += 15.0 * normal_blocks(stiffness(g, mesh), g.normals, mesh)
    blocks[mesh.rows == mesh.columns] += 1e-3 * np.eye(3)
    return blocks


def random_matrix(mesh, seed=0):
    """Blocks (P, 3, 3) of a symmetric matrix without any structure, dominated by its diagonal."""
    blocks = np.random.default_rng(seed).normal(size=(len(mesh.columns), 3, 3))
    pattern = np.arange(len(mesh.columns))
    back = np.empty_like(pattern)
    back[np.lexsort((mesh.rows, mesh.columns))] = pattern
    blocks = blocks + blocks[back].transpose(0, 2, 1)
    blocks[mesh.rows == mesh.columns] += 60 * np.eye(3)
    return blocks


def sparse(mesh, blocks):
    return bsr_array((blocks, mesh.columns, mesh.row_start)).tocsc()


def solver(mesh):
    return SparseCholesky(mesh.row_start, mesh.columns)


@EVERY
@pytest.mark.parametrize("matrix", [force_balance, lambda r, mesh: random_matrix(mesh)])
def test_solutions_are_those_of_superlu(shape, matrix):
    r, mesh = shape()
    blocks = matrix(r, mesh)
    b = np.random.default_rng(0).normal(size=(3 * len(r), 7))
    b[:, 3] = 0.0
    b[::2, 5] = 0.0
    exact = splu(sparse(mesh, blocks)).solve(b)
    x = solver(mesh).factor(blocks).solve(b)
    np.testing.assert_allclose(x, exact, atol=1e-10 * np.abs(exact).max())
    assert np.array_equal(x[:, 3], 0 * x[:, 3])
    # backward stable: the residual is that of rounding
    residual = np.abs(sparse(mesh, blocks) @ x - b)
    assert np.all(residual < 1e-13 * (abs(sparse(mesh, blocks)) @ np.abs(x) + np.abs(b)).max())


@pytest.mark.parametrize("most", [1, 3, 8, 20, 1000])
def test_the_solution_does_not_depend_on_the_size_of_pieces(most, monkeypatch):
    r, mesh = lumpy(2)
    blocks = random_matrix(mesh)
    b = np.random.default_rng(0).normal(size=3 * len(r))
    exact = solver(mesh).factor(blocks).solve(b)
    monkeypatch.setattr(cholesky, "MAX_UNDIVIDED", most)
    x = solver(mesh).factor(blocks).solve(b)
    np.testing.assert_allclose(x, exact, atol=1e-14 * np.abs(exact).max() * len(r))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
def test_several_right_hand_sides_are_solved_as_one_by_one(count):
    r, mesh = lumpy(2)
    factor = solver(mesh).factor(force_balance(r, mesh))
    b = np.random.default_rng(0).normal(size=(3 * len(r), count))
    x = factor.solve(b)
    assert x.shape == b.shape
    for j in range(count):
        one = factor.solve(b[:, j])
        assert one.shape == (3 * len(r),)
        assert np.array_equal(one, x[:, j])
    # whatever the memory looks like
    assert np.array_equal(factor.solve(np.asfortranarray(b)), x)
    assert np.array_equal(factor.solve(np.repeat(b, 2, axis=0)[::2]), x)


def test_factors_are_independent_and_repeat_bit_for_bit():
    r, mesh = lumpy(2)
    entries = force_balance(r, mesh)
    b = np.random.default_rng(0).normal(size=(3 * len(r), 2))
    structure = solver(mesh)
    first = structure.factor(entries)
    x = first.solve(b)
    second = structure.factor(4.0 * entries)
    assert np.array_equal(first.solve(b), x)
    assert np.array_equal(second.solve(b), x / 4.0)
    del first
    gc.collect()
    third = structure.factor(entries)
    assert np.array_equal(third.solve(b), x)
    assert np.array_equal(second.solve(b), x / 4.0)
    assert np.array_equal(solver(mesh).factor(entries).solve(b), x)


def test_memory_of_factors_no_longer_in_use_is_used_again():
    r, mesh = lumpy(1)
    structure, entries = solver(mesh), force_balance(r, mesh)
    kept = [structure.factor(entries) for _ in range(3)]
    del kept
    gc.collect()
    assert len(structure._unused) == 3
    factor = structure.factor(entries)
    assert len(structure._unused) == 2
    with pytest.raises(SingularMatrix):
        structure.factor(-entries)
    assert len(structure._unused) == 2
    del factor


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_factor_whose_memory_would_be_used_again_is_not_copied(copied):
    r, mesh = lumpy(1)
    factor = solver(mesh).factor(force_balance(r, mesh))
    with pytest.raises(TypeError, match="cannot be copied"):
        copied(factor)
    assert np.all(np.isfinite(factor.solve(np.ones(3 * len(r)))))


@pytest.mark.parametrize("node", [0, 17, 161])
@pytest.mark.parametrize("spoiled", [-1.0, 0.0, np.nan, np.inf])
def test_matrices_that_are_not_positive_definite_are_rejected(node, spoiled):
    r, mesh = lumpy(2)
    entries = force_balance(r, mesh)
    structure = solver(mesh)
    x = structure.factor(entries).solve(np.ones(3 * len(r)))
    for axis in range(3):
        wrong = entries.copy()
        place = np.flatnonzero((mesh.rows == node) & (mesh.columns == node))[0]
        wrong[place, axis, axis] = spoiled
        with pytest.raises(SingularMatrix, match="positive definite"):
            structure.factor(wrong)
    # a refusal leaves nothing behind
    assert np.array_equal(structure.factor(entries).solve(np.ones(3 * len(r))), x)


def test_an_off_diagonal_entry_that_is_not_finite_is_rejected():
    r, mesh = lumpy(1)
    structure = solver(mesh)
    for i, j in [(0, 1), (20, 21), (41, 40)]:
        for value in (np.nan, np.inf):
            wrong = force_balance(r, mesh)
            neighbor = mesh.columns[mesh.row_start[i] :][:2]
            j = neighbor[neighbor != i][0]
            for a, b in ((i, j), (j, i)):
                wrong[np.flatnonzero((mesh.rows == a) & (mesh.columns == b))[0]] = value
            with pytest.raises(SingularMatrix, match="positive definite"):
                structure.factor(wrong)


@EVERY
@pytest.mark.parametrize("most", [1, 8])
def test_pieces_touch_only_their_ancestors_and_each_other_nowhere(shape, most):
    _, mesh = shape()
    order, first, parent = dissected(mesh.row_start, mesh.columns, most)
    assert sorted(order) == list(range(mesh.n_nodes))
    assert first[0] == 0
    assert first[-1] == mesh.n_nodes
    assert np.all(np.diff(first) > 0)
    assert np.all((parent > np.arange(len(parent))) | (parent == -1))
    piece = np.empty(mesh.n_nodes, dtype=int)
    piece[order] = np.repeat(np.arange(len(parent)), np.diff(first))
    ancestors = [{f} for f in range(len(parent))]
    for f in range(len(parent) - 1, -1, -1):
        if parent[f] >= 0:
            ancestors[f] |= ancestors[parent[f]]
    for i, j in zip(piece[mesh.rows], piece[mesh.columns], strict=True):
        assert i in ancestors[j] or j in ancestors[i]
    again = dissected(mesh.row_start.copy(), mesh.columns.copy(), most)
    assert all(map(np.array_equal, (order, first, parent), again))


def test_the_first_separator_is_short_and_balanced():
    """A hexagonal mesh on a sphere of V nodes: a great circle meets about sqrt(pi V) = 0.9 more."""
    for subdivisions in (3, 4):
        _, mesh = sphere(subdivisions)
        _, first, parent = dissected(mesh.row_start, mesh.columns, 8)
        assert first[-1] - first[-2] <= 0.95 * np.sqrt(np.pi * mesh.n_nodes)
        halves = np.flatnonzero(parent == len(parent) - 1)
        assert len(halves) == 2
        assert 0.4 * mesh.n_nodes < first[halves[0] + 1] < 0.6 * mesh.n_nodes


PROGRAM = """
import warnings
warnings.simplefilter("error")
from amoeboid.numerics.sparse import cholesky, dissection
from amoeboid.meshes.connectivity import connectivity, icosphere
import numpy as np
mesh = connectivity(icosphere(1)[1])
blocks = np.einsum("p,ij->pij", 20.0 * (mesh.rows == mesh.columns) - 1.0, np.eye(3))
factor = cholesky.SparseCholesky(mesh.row_start, mesh.columns).factor(blocks)
x = factor.solve(np.ones(3 * mesh.n_nodes))
assert np.allclose(factor.solve(np.ones((3 * mesh.n_nodes, 2)))[:, 1], x, rtol=0, atol=0)
stats = [k.stats for k in (cholesky._factorized, cholesky._forward, dissection._dissected)]
print(sum(sum(s.cache_hits.values()) for s in stats), repr(x.tobytes()))
"""


@pytest.mark.slow
def test_kernels_are_compiled_once_for_all_programs(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    hits, numbers = [], []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            capture_output=True,
            text=True,
            check=False,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""
        found, x = done.stdout.split(maxsplit=1)
        hits.append(int(found))
        numbers.append(x)
    assert hits == [0, 3]
    assert numbers[0] == numbers[1]
