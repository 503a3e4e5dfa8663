import numpy as np
import pytest

from amoeboid.numerics.conjugate_gradients import constrained_minimum

N = 8


def full_pattern(n):
    return np.tile(np.arange(n), n), np.arange(n + 1) * n


def blocks_of(matrix):
    n = len(matrix) // 3
    return np.ascontiguousarray(matrix.reshape(n, 3, n, 3).transpose(0, 2, 1, 3).reshape(-1, 3, 3))


def solve(matrix, b, a, start, tolerance=1e-11, most=500):
    n = len(matrix) // 3
    columns, row_start = full_pattern(n)
    shaped = (x.reshape(n, 3) for x in (b, a, start))
    return constrained_minimum(blocks_of(matrix), columns, row_start, *shaped, tolerance, most)


def test_solution_is_that_of_the_bordered_system():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(3 * N, 3 * N))
    matrix, b, a, start = half @ half.T, *rng.normal(size=(3, 3 * N))
    bordered = np.block([[matrix, a[:, None]], [a[None, :], np.zeros((1, 1))]])
    exact = np.linalg.solve(bordered, np.append(b, a @ start))
    found = solve(matrix, b, a, start, most=5000)
    np.testing.assert_allclose(found.x.ravel(), exact[:-1], rtol=1e-7, atol=1e-9)
    assert found.multiplier == pytest.approx(exact[-1], rel=1e-8)
    assert found.residual <= 1e-11
    assert np.linalg.norm(b - matrix @ found.x.ravel() - found.multiplier * a) < 1e-9


def test_null_space_of_a_singular_matrix_keeps_what_the_start_has():
    rng = np.random.default_rng(1)
    half = rng.normal(size=(3 * N, 3 * N - 2))
    matrix = half @ half.T
    null = np.linalg.svd(half.T)[2][-2:]
    b, a, start = rng.normal(size=(3, 3 * N))
    b, a = (x - null.T @ (null @ x) for x in (b, a))
    found = solve(matrix, b, a, start, tolerance=1e-10, most=5000)
    x = found.x.ravel()
    np.testing.assert_allclose(null @ x, null @ start, atol=1e-9)
    assert np.linalg.norm(b - matrix @ x - found.multiplier * a) < 1e-8


def test_iterations_are_counted_and_limited():
    rng = np.random.default_rng(2)
    half = rng.normal(size=(3 * N, 3 * N))
    matrix, b, a, start = half @ half.T, *rng.normal(size=(3, 3 * N))
    done = solve(matrix, b, a, start, tolerance=1e-9, most=5000)
    assert done.iterations > 5
    again = solve(matrix, b, a, done.x.ravel(), tolerance=1e-6)
    assert again.iterations == 0
    assert solve(matrix, b, a, start, most=3).residual > 1e-3
