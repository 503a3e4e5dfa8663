import numpy as np
import pytest

from amoeboid.numerics import recycling
from amoeboid.numerics.recycling import NoConvergence, Recycling, SolvedImages


def equations(n=40):
    rng = np.random.default_rng(0)
    A = np.eye(n) + 0.5 * rng.standard_normal((n, n)) / np.sqrt(n)
    return A, rng.standard_normal((5, n))


@pytest.mark.parametrize("kept", [400, 20])
def test_solutions_are_those_of_direct_elimination(kept, monkeypatch):
    monkeypatch.setattr(recycling, "MAX_KEPT", kept)
    A, right = equations()
    solver = Recycling(lambda x: A @ x, len(A))
    for b in right:
        np.testing.assert_allclose(solver.solve(b, 1e-11), np.linalg.solve(A, b), atol=1e-9)


def test_directions_are_used_again():
    calls = []
    A, right = equations()
    solver = Recycling(lambda x: calls.append(1) or A @ x, len(A))
    for b in right:
        solver.solve(b, 1e-6)
    before = len(calls)
    solver.solve(right.sum(axis=0), 1e-4)
    assert len(calls) == before


def test_equations_without_a_solution_are_reported():
    solver = Recycling(lambda x: np.array([1.0, 0.0]) * x, 2)
    with pytest.raises(NoConvergence):
        solver.solve(np.ones(2), 1e-6)


def test_every_direction_improves_all_images():
    A, right = equations()
    images = SolvedImages(Recycling(lambda x: A @ x, len(A)), lambda y: y, lambda x: x, 0.3, 1e-9)
    for b in right:
        images.add(b)
    exact = np.linalg.solve(A, right.T).T
    before = np.linalg.norm(images.array - exact, axis=1)
    shares = np.array([1.0, 0.0, 0.0, 0.0, 2.0], dtype=complex)
    errors = images.errors(shares[:, None])
    # an estimate: by the longest direction so far
    assert np.linalg.norm(shares.real @ (images.array - exact)) <= 3.0 * errors[0]
    assert images.improve(shares)
    # one that is not part of the sum, too
    assert np.all(np.linalg.norm(images.array - exact, axis=1) != before)
    while images.improve(shares):
        pass
    assert np.linalg.norm(shares.real @ (images.array - exact)) < 1e-7
