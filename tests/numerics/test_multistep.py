import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.numerics.multistep import backward_difference, error_share, extrapolated

lengths = st.lists(st.floats(0.05, 2.0), min_size=3, max_size=3)


def past_of(steps):
    """Three past times, newest first, and the new one."""
    new = 0.3
    first, second, third = steps
    return [new - first, new - first - second, new - first - second - third], new


@given(steps=lengths, coefficients=st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_second_order_is_exact_for_parabolas(steps, coefficients):
    """y(new) = known part + dt y'(new), for steps of any length."""
    y = np.polynomial.Polynomial(coefficients)
    times, new = past_of(steps)
    for known, exact_for in ((times[:2], y), (times[:1], y.cutdeg(1))):
        scheme = backward_difference(known, new)
        assert sum(scheme.past) == pytest.approx(1)
        assert scheme.dt > 0
        value = scheme.combined([exact_for(t) for t in known])
        assert value + scheme.dt * exact_for.deriv()(new) == pytest.approx(exact_for(new), abs=1e-9)


@given(steps=lengths, coefficients=st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_extrapolation_is_the_polynomial_through_all_values(steps, coefficients):
    y = np.polynomial.Polynomial(coefficients)
    times, new = past_of(steps)
    for count in (1, 2, 3):
        p = y.cutdeg(count - 1)
        found = extrapolated(times[:count], [np.array([p(t), 1.0]) for t in times[:count]], new)
        np.testing.assert_allclose(found, [p(new), 1.0], atol=1e-6 * max(1, np.abs(found).max()))


@given(steps=lengths)
def test_error_share_is_that_of_the_first_power_beyond_the_method(steps):
    """t^3 for three past values and BDF2, t^2 for two and BDF1."""
    times, new = past_of(steps)
    for order in (1, 2):
        known = times[: order + 1]
        y = [t ** (order + 1) for t in known]
        scheme = backward_difference(known[:order], new)
        step = scheme.combined(y) + scheme.dt * (order + 1) * new**order
        ahead = extrapolated(known, [np.array(v) for v in y], new)
        error, distance = step - new ** (order + 1), step - ahead
        assert error_share(known, new) == pytest.approx(abs(error / distance), rel=1e-6)


def test_a_stiff_decay_is_damped_at_any_step_length():
    """L-stable: y' = -1e6 y, with steps that grow by 2 at a time, as the controller lets them."""
    times, y, t, h = [0.0], [1.0], 0.0, 1e-3
    for _ in range(25):
        t, h = t + h, 2 * h
        scheme = backward_difference(times[:2], t)
        y.insert(0, scheme.combined(y[:2]) / (1 + 1e6 * scheme.dt))
        times.insert(0, t)
    assert abs(y[0]) < 1e-12
