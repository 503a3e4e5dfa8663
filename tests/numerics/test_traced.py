"""Functions of NumPy on arrays of another library, whose numbers are not known yet."""

import numpy as np
import pytest

from amoeboid.numerics.traced import NotTraceable, Traced, untraced

X = np.array([[0.5, 2.0, 3.0], [1.0, 1.5, -1.0]])


def traced(array=X):
    """NumPy is the other library here."""
    return Traced(array, np)


def test_arithmetic_and_functions_are_those_of_the_other_library():
    found = 2.0 * np.exp(-traced()) + np.where(traced() > 1.0, traced() ** 2, 0.0)
    assert isinstance(found, Traced)
    np.testing.assert_array_equal(found.array, 2.0 * np.exp(-X) + np.where(X > 1.0, X**2, 0.0))
    both = np.concatenate([traced(), traced()], axis=1)
    np.testing.assert_array_equal(both.array, np.concatenate([X, X], axis=1))


def test_parts_and_shapes_are_those_of_the_array():
    x = traced(X + 1j)
    assert (x.shape, x.ndim, x.dtype) == ((2, 3), 2, np.dtype(complex))
    np.testing.assert_array_equal(x.real.array, X)
    np.testing.assert_array_equal(x[1, :2].array, X[1, :2] + 1j)
    assert untraced([traced(), 3.0])[0] is X
    assert untraced((traced(), 3.0))[1] == 3.0


@pytest.mark.parametrize(
    "needs_numbers",
    [
        lambda x: 1.0 if x > 1.0 else 0.0,
        lambda x: float(x[0, 0]),
        lambda x: np.asarray(x),
        lambda x: np.linalg.norm(x),
        lambda x: [0.0, 1.0][x[0, 1]],
    ],
    ids=["branch", "float", "array", "function", "index"],
)
def test_what_needs_the_numbers_themselves_says_so(needs_numbers):
    with pytest.raises(NotTraceable):
        needs_numbers(Traced(X, np.random))  # which has no function called norm


def test_options_that_the_other_library_may_not_have_are_refused():
    with pytest.raises(TypeError):
        np.exp(traced(), out=np.empty(X.shape))
    with pytest.raises(TypeError):
        np.add.reduce(traced())
