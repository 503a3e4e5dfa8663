"""Intervals hold the truth as often as they say, and the posterior agrees with least squares."""

import numpy as np
import pytest
from benchmarks.fit_coverage import NAMES, fits

import amoeboid as am

P = am.Parameters(D=0.4, v_p0=6.0)
SETS = 100


@pytest.mark.slow
def test_intervals_hold_the_truth_in_95_of_100_synthetic_data_sets():
    held = dict.fromkeys(NAMES, 0)
    falls = []
    for fall, inside in fits(SETS):
        falls.append(fall)
        for name in NAMES:
            held[name] += inside[name]
    # 95 are expected, with a binomial standard deviation of 2.2: within three of them
    assert all(SETS * 0.95 - 6.6 <= count <= SETS for count in held.values()), held
    # the four are correlated: a mean of four has at most the deviation of one
    assert sum(held.values()) / (len(NAMES) * SETS) > 0.95 - 3 * 0.022, held
    # from the truth to the best fit chi2 falls by a chi-squared number of 4 degrees of freedom
    assert np.mean(falls) == pytest.approx(4, abs=3 * np.sqrt(2 * 4 / SETS))


@pytest.mark.slow
def test_the_posterior_agrees_with_the_covariance_of_least_squares():
    pytest.importorskip("emcee", reason="the extra amoeboid[posterior]")
    found = am.fit(am.synthetic(P, {"u": 0.01, "c": 0.06}), ["D", "v_p0"], P, starts=1)
    posterior = found.posterior(600, seed=1)
    assert posterior.problems == ()
    expected = found.sensitivity.covariance
    sizes = np.sqrt(np.diag(expected))
    # about 3600/20 independent samples: errors of 7 %
    assert np.sqrt(np.diag(posterior.covariance)) == pytest.approx(sizes, rel=0.25)
    assert np.mean(posterior.y, axis=0) == pytest.approx(found.point.y, abs=0.3 * sizes.max())
    correlation = posterior.covariance[0, 1] / np.sqrt(np.prod(np.diag(posterior.covariance)))
    assert correlation == pytest.approx(found.correlation[0, 1], abs=0.1)
    one, other = (found.posterior(10, seed=1) for _ in range(2))
    assert np.array_equal(one.y, other.y)
