import numpy as np
import pytest

from amoeboid.numerics.arnoldi import ritz_values
from amoeboid.numerics.recycling import Recycling, SolvedImages


class Exact:
    """Images under a map that is known exactly."""

    def __init__(self, image):
        self._image, self._rows = image, []

    @property
    def array(self):
        return np.array(self._rows)

    def add(self, y):
        self._rows.append(self._image(y))

    def errors(self, shares):
        return np.zeros(shares.shape[1])

    def improve(self, shares):
        return False


EIGENVALUES = np.concatenate([[1.2, 1.0, 0.9], np.linspace(0.5, 0.0, 57)])


def not_normal(n=60):
    """A matrix with EIGENVALUES and one complex pair, far from symmetric."""
    rng = np.random.default_rng(3)
    core = np.diag(EIGENVALUES)
    core[1:3, 1:3] = [[0.9, 0.4], [-0.4, 0.9]]
    vectors = np.eye(n) + 0.3 * rng.standard_normal((n, n)) / np.sqrt(n) + np.eye(n, k=1)
    return vectors @ core @ np.linalg.inv(vectors)


def test_outlying_eigenvalues_are_found_first():
    A = not_normal()
    start = np.random.default_rng(1).standard_normal(len(A))
    for count, found in enumerate(ritz_values(Exact(lambda x: A @ x), start)):
        values, residuals = found.values, found.residuals
        first = np.argsort(-np.abs(values))[:3]
        if count == 19:
            assert residuals[first[0]] < 1e-6
            break
    np.testing.assert_allclose(values[first[0]], 1.2, rtol=1e-8)
    np.testing.assert_allclose(np.abs(values[first[1:]]), np.hypot(0.9, 0.4), rtol=1e-6)


def test_residuals_are_those_of_the_approximate_vectors():
    """Exact for the space that has been spanned: |A x - value x|, x of length 1."""
    A = not_normal()
    start = np.random.default_rng(1).standard_normal(len(A))
    kept = []

    def image(x):
        kept.append(x)
        return A @ x

    found = next(v for k, v in enumerate(ritz_values(Exact(image), start)) if k == 6)
    values, residuals = found.values, found.residuals
    basis = np.stack(kept, axis=1)
    small, vectors = np.linalg.eig(basis.T @ A @ basis)
    for i, (value, residual) in enumerate(zip(values, residuals, strict=True)):
        own = found.vector(i)
        assert np.linalg.norm(A @ own - value * own) == pytest.approx(residual, rel=1e-6)
        k = np.argmin(np.abs(small - value))
        x = basis @ vectors[:, k]
        assert np.linalg.norm(A @ x - value * x) == pytest.approx(residual, rel=1e-6)


def test_condition_numbers_tell_how_errors_of_the_map_change_eigenvalues():
    """To first order the most that an error of a given norm can do; 1 for a symmetric map."""
    A, start = not_normal(), np.random.default_rng(1).standard_normal(60)
    *_, found = ritz_values(Exact(lambda x: A @ x), start)
    values, conditions = found.values, found.conditions
    first = int(np.argmax(np.abs(values)))
    _, vectors = np.linalg.eig(A)
    left = np.linalg.inv(vectors)
    k = int(np.argmax(np.abs(np.diag(left @ A @ vectors))))
    x, y = vectors[:, k].real, left[k].real
    worst = 1e-6 * np.outer(y, x) / np.linalg.norm(x) / np.linalg.norm(y)
    changed = np.abs(np.linalg.eigvals(A + worst)).max() - np.abs(values[first])
    assert conditions[first] > 1.2
    assert changed == pytest.approx(1e-6 * conditions[first], rel=1e-3)

    symmetric = A + A.T
    *_, found = ritz_values(Exact(lambda x: symmetric @ x), start)
    np.testing.assert_allclose(found.conditions, 1.0, rtol=1e-6)


def test_arnoldi_ends_when_the_space_is_exhausted():
    A = np.diag([3.0, 2.0, 1.0, 1.0])
    found = list(ritz_values(Exact(lambda x: A @ x), np.ones(4)))
    assert len(found) == 3
    np.testing.assert_allclose(np.sort(found[-1].values.real), [1.0, 2.0, 3.0], rtol=1e-12)


def test_eigenvectors_that_agree_have_no_finite_condition():
    shift = np.eye(3, k=-1)
    found = list(ritz_values(Exact(lambda x: shift @ x), np.array([1.0, 0.0, 0.0])))
    assert len(found) == 3
    assert found[0].conditions == 1.0
    assert np.all(np.array(found[-1].conditions) > 1e10)


def test_roughly_known_images_are_improved_where_an_eigenvalue_needs_it():
    """Solved to 1e-2, the largest eigenvalue is found to 1e-6, and its error is known."""
    A = not_normal()
    solver = Recycling(lambda x: 2.0 * x + np.roll(x, 1), len(A))
    inverse = np.linalg.inv(2.0 * np.eye(len(A)) + np.roll(np.eye(len(A)), 1, axis=0))
    exact = np.linalg.eigvals(inverse @ A)
    images = SolvedImages(solver, lambda y: A @ y, lambda x: x, 1e-2, 1e-12)
    start = np.random.default_rng(1).standard_normal(len(A))

    def choose(found):
        k = int(np.argmax(np.abs(found.values)))
        return k, bool(found.errors[k] > found.residuals[k])

    for found in ritz_values(images, start, choose):
        k = choose(found)[0]
        x = found.vector(k)
        missing = np.linalg.norm(inverse @ (A @ x) - found.values[k] * x)
        assert missing <= found.residuals[k] + found.errors[k] + 1e-12
        if found.residuals[k] + found.errors[k] < 1e-7:
            break
    assert np.abs(exact - found.values[k]).min() < 1e-6
