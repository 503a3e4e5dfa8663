"""Samples of the posterior: around the best fit, with units, and what they refuse."""

import pickle
from importlib.util import find_spec

import numpy as np
import pytest

import amoeboid as am

pytestmark = pytest.mark.skipif(
    find_spec("emcee") is None, reason="the extra amoeboid[posterior] is not installed"
)

P = am.Parameters.physical()


@pytest.fixture(scope="module")
def found():
    return am.fit(am.synthetic(P, {"u": "0.01 um/s"}), ["v_p0"], P, starts=1)


@pytest.fixture(scope="module")
def posterior(found):
    return found.posterior(10, walkers=4, seed=1)


def test_samples_lie_around_the_best_fit_and_a_short_chain_says_so(found, posterior):
    deviation = found.sensitivity.errors[0]
    assert posterior.y.shape == (4 * 8, 1)  # a quarter of the steps is left out
    assert np.abs(posterior.y - found.point.y).max() < 5.0 * deviation
    assert 0.2 < np.sqrt(posterior.covariance[0, 0]) / deviation < 2.0
    assert "the chain is short" in posterior.problems[0]
    assert posterior.problems[0] in repr(posterior)


def test_samples_are_in_the_units_of_the_cell(posterior):
    samples = posterior.samples("v_p0")
    assert samples.check("[length]/[time]")
    low, middle, high = posterior.quantiles("v_p0")
    assert low < middle < high
    assert middle.magnitude == pytest.approx(np.quantile(samples.magnitude, 0.5), rel=1e-14)
    table = posterior.to_pandas()
    (title,) = table.columns
    assert title == "v_p0"
    np.testing.assert_array_equal(table[title], samples.magnitude)
    assert "um/s, 95 % within" in repr(posterior)


def test_posterior_is_the_same_after_pickling(posterior):
    again = pickle.loads(pickle.dumps(posterior))  # noqa: S301  (our own)
    assert np.array_equal(again.y, posterior.y)
    assert repr(again) == repr(posterior)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"steps": 9}, "steps must be a whole number >= 10, got 9"),
        ({"steps": True}, "steps must be a whole number"),
        ({"walkers": 3}, "walkers must be a whole number >= 4, got 3"),
    ],
)
def test_numbers_that_are_too_small_are_rejected(found, given, message):
    with pytest.raises(am.InvalidInput, match=message):
        found.posterior(**({"steps": 10} | given))


def test_unknown_names_are_rejected(posterior):
    with pytest.raises(am.InvalidInput, match="'D'"):
        posterior.samples("D")


def test_parameters_without_effect_are_rejected():
    """The flow does not change with the number of filaments, which c0 and c_r count alike."""
    p = am.Parameters(D=0.4, v_p0=6.0)
    found = am.fit(am.synthetic(p, {"u": 0.04}), ["c0", "c_r"], p, starts=1)
    with pytest.raises(am.InvalidInput, match="c0 and c_r can change without effect"):
        found.posterior(10)
