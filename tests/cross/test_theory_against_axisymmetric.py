"""Weakly nonlinear theory against the exact steady states, near the threshold and far from it."""

from itertools import takewhile

import numpy as np
import pytest

from amoeboid.axisymmetric.onset import branch_tangent, onset_speed
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.unknowns import mode_count
from amoeboid.closed_forms.amplitude import at_threshold, bifurcation, cubic_coefficient
from amoeboid.closed_forms.branch import branch, prediction
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import points
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import Options, at_distance
from amoeboid.numerics.continuation import follow
from cross.scripts import script
from cross.spectral import polarized
from theory.sample_points import OWN_LAW


def relative_error(p):
    speed = float(prediction(p).max_retrograde_speed)
    return abs(speed / polarized(p).max_retrograde_speed - 1)


@pytest.mark.slow
def test_the_error_estimate_far_from_threshold_is_not_smaller_than_the_error():
    """Where cubic and next order cross by chance the estimate must not shrink."""
    estimates = []
    for v_p0 in (3.8, 4.5, 5.6, 7.0):
        p = Parameters(v_p0=v_p0)
        estimates.append(float(prediction(p).relative_error))
        error = relative_error(p)
        print(f"v_p0 = {v_p0}: error {error:.3f}, estimate {estimates[-1]:.3f}")
        assert error < 1.1 * estimates[-1]
    assert np.all(np.diff(estimates) > -0.05)


def test_the_theory_becomes_exact_at_the_threshold():
    """At high pressure, on a rigid sphere, the error is proportional to the distance."""
    p = Parameters(delta_P=1e6)
    distances = np.array([4e-3, 2e-3])
    errors = [relative_error(p.replace(v_p0=float(critical_speed(p)) + d)) for d in distances]
    assert errors[1] < 0.03
    assert 1.7 < errors[0] / errors[1] < 2.3


def state_at(point, p):
    at = p.replace(v_p0=point.parameter)
    return SteadySolution(at, mode_count(point.x), point.x, True, ())


def measured_branch(p):
    """(v_2, v_4') of v_p0 = v_p^c + v_2 h^2 + v_4' h^4, h half the difference of c at the poles.

    Fitted at ever smaller distances; the fit whose v_4' changed least counts.
    """
    threshold = onset_speed(p)
    options = Options(parameter_scale=threshold)
    start = branch_tangent(p, "v_p0", threshold, options)
    fits = []
    for distance in 0.3 * 0.7 ** np.arange(7):
        squares, slopes = [], []
        for share in (1.0, 1.2, 1.4, 1.6, 1.8, 2.0):
            point = at_distance(start, share * distance, options)
            if point is None:
                break
            state = state_at(point, p)
            squares.append((state.c_rear - state.c_front) ** 2 / 4)
            slopes.append((point.parameter - threshold) / squares[-1])
        else:
            fits.append(np.polyfit(squares, slopes, 5)[:-3:-1])
    fits = np.array(fits)
    return fits[np.argmin(np.abs(np.diff(fits[:, 1]))) + 1]


SOFT = [
    Parameters(delta_P=2.0),
    Parameters(delta_P=5.0, D=0.4),
    Parameters(delta_P=5.0, alpha=0.2, eta_b=0.3),
    Parameters(delta_P=11.0, law="inverse"),
    Parameters(delta_P=11.0, law=OWN_LAW, alpha=0.1, eta_s=0.6, R0=1.3),
    Parameters(delta_P=5.0, beta=0.0, D=0.1),
]


@pytest.mark.parametrize("p", SOFT)
def test_the_polarized_branch_of_a_soft_cell_is_that_of_the_theory(p):
    """v_2 = -nu/lambda_1' to six digits, and v_4, of free shapes at the pressure of the cell."""
    found = branch(p)
    v_2, v_4 = measured_branch(p)
    assert found.v_2 == pytest.approx(v_2, rel=1e-6)
    # c at the poles holds the third harmonic: h = a + m_3 a^3.
    m_3 = float(at_threshold(p).m_3)
    assert found.v_4 - 2 * found.v_2 * m_3 == pytest.approx(v_4, rel=1e-4)


def followed(p, farthest=2.2, number=40):
    """(v_p0, speed) of the polarized states that a cell comes to one after the other from onset."""
    threshold = onset_speed(p)
    options = Options(parameter_scale=threshold)

    def inside(point):
        return threshold < point.parameter < farthest * threshold and point.x.size < 300

    found = []
    way = follow(branch_tangent(p, "v_p0", threshold, options), options)
    for _, point in zip(range(number), takewhile(inside, way), strict=False):
        if not found or point.parameter > found[-1][0]:
            found.append((point.parameter, state_at(point, p).max_retrograde_speed))
    return np.array(found).reshape(-1, 2)


def coverage(p):
    """(errors, estimates) of the states on the branch from the sphere that are predicted."""
    exact = followed(p)
    found = prediction(points(p, v_p0=exact[:, 0]))
    predicted = found.state.stable & found.in_reach
    errors = np.abs(found.max_retrograde_speed / exact[:, 1] - 1)
    return errors[predicted], found.relative_error[predicted]


def kinds():
    """The cells of the published comparison, each once, without speed and pressure."""
    alike = (p.replace(v_p0=1.0, delta_P=1.0) for p in script("comparison").POINTS)
    return list(dict.fromkeys(alike))


def supercritical(pressures):
    cells = [p.replace(delta_P=delta_P) for delta_P in pressures for p in kinds()]
    return [p for p in cells if bifurcation(p) == "supercritical"]


def assert_covered(cells, useful=10.0):
    quantified = []
    for p in cells:
        errors, estimates = coverage(p)
        assert np.all(errors <= estimates), p
        quantified.extend(estimates[estimates < 1] / errors[estimates < 1])
    # a bound that is of use: the median of all cells of the comparison is 2.6 times the error
    print(f"{len(cells)} cells, {len(quantified)} states: median {np.median(quantified):.2f}")
    assert np.median(quantified) < useful


def test_the_error_estimate_contains_the_error_of_a_soft_cell():
    assert_covered([Parameters(delta_P=11.0)])


@pytest.mark.slow
@pytest.mark.parametrize("delta_P", [2.0, 3.0, 5.0, 11.0, 30.0, 100.0, 300.0, 1000.0])
def test_the_error_estimate_contains_the_error_at_every_kind_of_point(delta_P):
    # few soft cells are predicted, with loose bounds: 10.1 and 16.0 at 2 and 5
    assert_covered(supercritical([delta_P]), useful=20.0 if delta_P < 11.0 else 10.0)


def test_a_soft_cell_jumps_where_the_theory_says_subcritical():
    """D = 0.03 at delta_P = 5: the branch turns back below the threshold, by 0.1 % of v_p0."""
    p = Parameters(delta_P=5.0, D=0.03, v_p0=3.56)
    assert cubic_coefficient(p) > 0
    threshold = onset_speed(p)
    options = Options(parameter_scale=threshold)
    first = at_distance(branch_tangent(p, "v_p0", threshold, options), 0.05, options)
    assert first.parameter < threshold
    assert polarized(p).max_retrograde_speed == pytest.approx(0.1435, abs=1e-4)
