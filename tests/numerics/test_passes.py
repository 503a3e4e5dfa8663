"""Fixed-point iteration: what is left to come, and the way past the last result."""

from itertools import pairwise

import numpy as np
import pytest

from amoeboid.numerics.passes import Pass, left_to_come, overshoot


def contraction(rates):
    """A map that draws (n,) coordinates by these rates to a known point."""
    rates = np.asarray(rates)
    at = 1.0 + 0.1 * np.arange(len(rates))
    return lambda x: at + rates * (x - at), at


@pytest.mark.parametrize("rate", [0.3, -0.5, 0.9, 2.0])
def test_one_rate_is_overcome_by_one_overshoot(rate):
    """Also where the iteration itself would move away, with a step as long as it takes."""
    g, at = contraction([rate])
    first = Pass(x=np.zeros(1), g=g(np.zeros(1)))
    second = Pass(x=first.g, g=g(first.g))
    ahead = overshoot(first, second)
    exact = rate / (1 - rate)
    assert ahead == pytest.approx(np.clip(exact, -1.0, 1.0))
    if abs(exact) <= 1.0:
        np.testing.assert_allclose(second.g + ahead * (second.g - first.g), at, rtol=1e-14)


@pytest.mark.parametrize("rate", [0.05, 0.4, -0.4])
def test_what_is_left_is_exact_for_one_rate(rate):
    """And on the safe side where the results swing about the solution."""
    g, at = contraction([rate, rate])
    first = Pass(x=np.zeros(2), g=g(np.zeros(2)))
    second = Pass(x=first.g, g=g(first.g))
    exact = np.abs(second.g - at).max()
    left = left_to_come(first, second)
    assert left == pytest.approx(exact if rate > 0 else exact * (1 - rate) / (1 + rate))


def test_the_rate_is_seen_between_passes_that_do_not_follow_on_each_other():
    g, at = contraction([0.4, 0.4])
    a, b = np.array([3.0, 0.0]), np.array([2.5, 0.7])
    found = left_to_come(Pass(a, g(a)), Pass(b, g(b)))
    assert found >= np.abs(g(b) - at).max()
    assert found < 2.0 * np.abs(g(b) - at).max()


def test_passes_that_do_not_come_nearer_leave_everything():
    g, _ = contraction([1.0, 1.5])
    passes = [np.zeros(2), np.ones(2)]
    first, second = (Pass(x, g(x)) for x in passes)
    assert left_to_come(first, second) == np.inf


def test_at_the_solution_nothing_is_left():
    g, at = contraction([0.5])
    same = Pass(at, g(at))
    assert left_to_come(same, same) == 0.0
    assert overshoot(same, same) == 0.0


def test_overshoots_shorten_the_way():
    """One slow rate among fast ones: half as many passes as without."""
    g, at = contraction([0.6, 0.05, -0.05, 0.02])

    def needed(use):
        passes, x = [], np.zeros(4)
        while not passes or np.abs(passes[-1].g - at).max() > 1e-8:
            passes.append(Pass(x, g(x)))
            x = passes[-1].g
            if use and len(passes) > 1:
                before, last = passes[-2:]
                x = last.g + overshoot(before, last) * (last.g - before.g)
        return len(passes), [p.change for p in passes]

    without, changes = needed(False)
    assert all(b < a for a, b in pairwise(changes))
    assert needed(True)[0] <= without / 2
