"""Continuation on curves that are known in closed form."""

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import pytest
from scipy.linalg.lapack import dgetrf

from amoeboid.numerics.arcs import Arc, _bracketed, _direct, arcs, at_value, unknowns_at
from amoeboid.numerics.branch_points import (
    Options,
    Stalled,
    Unresolved,
    at_distance,
    at_parameter,
    residual_and_bordered,
    slope_row,
    started,
    through,
    with_tangent,
)
from amoeboid.numerics.continuation import _bend, _extrapolated, follow
from amoeboid.numerics.locating import located
from amoeboid.numerics.newton import Factor, newton
from amoeboid.numerics.singular import fold_system
from amoeboid.validation import InvalidInput


@dataclass(frozen=True)
class Cusp:
    """q_0 + q_1 x - x^3 = 0: folds in q_0 at x = +-sqrt(q_1/3)."""

    second: float = 3.0

    weights = np.ones(1)
    scale = np.ones(1)

    def _q(self, q):
        return q if q.size == 2 else np.append(q, self.second)

    def residual(self, x, q):
        a, b = self._q(q)
        return np.array([a + b * x[0] - x[0] ** 3])

    def residual_and_jacobian(self, x, q):
        return self.residual(x, q), np.array([[self._q(q)[1] - 3 * x[0] ** 2]])

    def resolved(self, x, q):
        return True

    def refined(self, x, q):
        return None

    def prolonged(self, x, finer):
        return x


def start(**changes):
    options = Options(max_step=0.3, **changes)
    x = at_parameter(Cusp(), np.array([-2.5]), -8.0)
    return started(Cusp(), x, -8.0, np.array([0.0]), 1.0, options), options


def test_every_point_solves_and_both_folds_are_found():
    begin, options = start()
    points = []
    for point in follow(begin, options):
        points.append(point)
        if point.parameter > 8.0:
            break
    for point in points:
        assert abs(point.parameter + 3 * point.x[0] - point.x[0] ** 3) < 1e-11
    folds = [p for p in points if p.fold]
    # with q_1 = 3 the folds lie at x = -1 and x = +1, q_0 = 2 and -2
    assert [f.parameter for f in folds] == pytest.approx([2.0, -2.0], abs=1e-10)
    assert [f.x[0] for f in folds] == pytest.approx([-1.0, 1.0], abs=1e-5)


def test_an_event_is_located_on_the_branch():
    begin, options = start()
    a = begin
    for b in follow(begin, options):
        if b.x[0] > 0.5:
            break
        a = b
    found = located(a, b, lambda p: p.x[0] - 0.5, options)
    assert found.parameter == pytest.approx(0.125 - 1.5, abs=1e-9)


def test_the_fold_is_followed_in_a_second_parameter_along_the_cusp():
    phi = np.array([1.0])
    system, x = fold_system(Cusp(), np.array([-0.9]), phi, 1.9)
    q = np.array([3.0])
    first = newton(lambda y: system.residual(y, q), lambda y: system.residual_and_jacobian(y, q), x)
    assert first.converged
    options = Options(max_step=0.3)
    begin = through(system, first.x, 3.0, -1.0, options)
    seen = 0
    for point in islice(follow(begin, options), 12):
        if point.parameter < 0.2:
            break
        seen += 1
        # the cusp 27 q_0^2 = 4 q_1^3
        assert 27 * point.x[2] ** 2 == pytest.approx(4 * point.parameter**3, rel=1e-9)
    assert seen >= 5


def test_a_curve_that_ends_stalls_instead_of_inventing_points():
    class Ending(Cusp):
        def residual(self, x, q):
            if q[0].real > 1.0:
                raise InvalidInput("ends here")
            return super().residual(x, q)

    options = Options(max_step=0.3)
    begin = started(Ending(), np.array([-2.49]), -8.0, np.array([0.0]), 1.0, options)
    points = []
    with pytest.raises(Stalled, match="no step"):
        points.extend(follow(begin, options))
    assert all(p.parameter <= 1.0 for p in points)


@pytest.mark.parametrize(
    "change", [{"max_step": 0.0}, {"angle": -1.0}, {"max_points": 0}, {"min_step": 0.0}]
)
def test_impossible_options_are_rejected(change):
    with pytest.raises(InvalidInput, match="got"):
        Options(**change)


def test_two_folds_between_neighbors_are_found():
    """q_1 = 3e-4: folds at x = -+0.01, 0.02 apart, with steps of 0.3."""
    curve = Cusp(3e-4)
    options = Options(max_step=0.3, first_step=0.3)
    x = at_parameter(curve, np.array([-0.7]), -0.343 + 0.7 * 3e-4)
    begin = through(curve, x, -0.343 + 0.7 * 3e-4, 1.0, options)
    found = []
    for arc in arcs(begin, options):
        point = at_value(arc, 0.0, options)
        if point is not None:
            found.append(point.x[0])
        if arc.b.parameter > 0.3:
            break
    root = np.sqrt(3e-4)
    assert found == pytest.approx([-root, 0.0, root], abs=1e-9)


@pytest.mark.parametrize("beside", [1e-1, 1e-6, 1e-12])
def test_both_solutions_near_a_fold_are_found(beside):
    """x^3 - 3 x = 2 - d has solutions at x = 1 -+ sqrt(d/3) near the fold."""
    begin, options = start()
    found = []
    for arc in arcs(begin, options):
        point = at_value(arc, -2.0 + beside, options)
        if point is not None:
            found.append(point.x[0])
        if arc.b.parameter > 8.0:
            break
    roots = np.sort(np.roots([1.0, 0.0, -3.0, 2.0 - beside]).real)
    assert sorted(found) == pytest.approx(roots, abs=1e-9 / np.sqrt(beside))
    assert len(found) == 3
    assert at_value(Arc(begin, begin, begin), 5.0, options) is None


def test_the_direct_way_to_a_value_is_taken_only_where_it_is_safe():
    """It agrees with the bracket, tangent included; next to a fold there is another solution."""
    begin, options = start()
    ways = {True: 0, False: 0}
    for arc in arcs(begin, options):
        low, high = sorted((arc.a.parameter, arc.b.parameter))
        for share in (1e-9, 0.5):
            value = low + share * (high - low)
            direct = _direct(arc, value, options)
            ways[direct is not None] += 1
            if direct is not None:
                bracketed = _bracketed(arc, value, options)
                rise = abs(3 * direct.x[0] ** 2 - 3)
                assert direct.x == pytest.approx(bracketed.x, abs=1e-12 + 1e-15 / rise)
                assert direct.length == pytest.approx(bracketed.length, abs=0.01)
                assert begin.length <= direct.length
                slope_ = direct.parameter_tangent / direct.x_tangent[0]
                assert abs(slope_) == pytest.approx(rise, abs=1e-9)
        if arc.b.parameter > 8.0:
            break
    assert all(ways.values())


def test_a_branch_ends_with_the_first_point_that_is_enough_resolved_or_not():
    class Coarse(Cusp):
        def resolved(self, x, q):
            return q[0] < 1.0

    begin, options = start()
    begin = replace(begin, system=Coarse())
    with pytest.raises(Unresolved):
        list(follow(begin, options))
    *before, last = follow(begin, options, lambda point: point.parameter >= 1.0)
    assert max(point.parameter for point in before) < 1.0 <= last.parameter
    assert abs(last.parameter + 3 * last.x[0] - last.x[0] ** 3) < 1e-11


def test_a_step_does_not_lead_to_another_branch():
    """(q - x)(q - x - 1/5) = 0: two lines side by side; a jump leaves both tangents."""

    class Lines(Cusp):
        def residual(self, x, q):
            return (q[:1] - x) * (q[:1] - x - 0.2)

        def residual_and_jacobian(self, x, q):
            return self.residual(x, q), np.array([[2 * (x[0] - q[0]) + 0.2]])

    options = Options(max_step=0.5)
    a = through(Lines(), np.zeros(1), 0.0, 1.0, options)
    across = at_distance(a, 0.1, options, np.array([-0.1, 0.1]))
    assert across.x[0] == pytest.approx(across.parameter - 0.2)
    assert _bend(a, across, options) > 0.5


def test_a_tangent_refined_from_a_jacobian_nearby_is_exact():
    begin, options = start()
    for point in islice(follow(begin, options), 20):
        row = slope_row(point, options)
        shifted = np.append(point.x + 1e-3, point.parameter)
        _, matrix = residual_and_bordered(point.system, shifted, row, 0.0)
        near = Factor(*dgetrf(matrix.T)[:2])
        exact, refined = with_tangent(point, row, options), with_tangent(point, row, options, near)
        assert refined.x_tangent == pytest.approx(exact.x_tangent, abs=2e-10)
        assert refined.parameter_tangent == pytest.approx(exact.parameter_tangent, abs=2e-10)


def test_a_tangent_is_exact_where_refinement_does_not_converge():
    begin, options = start()
    [point] = islice(follow(begin, options), 1)
    row = slope_row(point, options)
    _, matrix = residual_and_bordered(point.system, np.array([0.1, 0.0]), row, 0.0)
    far = Factor(*dgetrf(matrix.T)[:2])
    exact = with_tangent(point, row, options)
    assert with_tangent(point, row, options, far) == exact


def test_the_guess_of_the_next_point_is_of_fourth_order():
    begin, options = start()
    here = at_distance(begin, 0.5, options)
    errors = []
    for step in (0.2, 0.1, 0.05):
        before = at_distance(here, -step, options)
        guess = _extrapolated(before, here, step, options)
        found = at_distance(here, step, options)
        errors.append(abs(guess[0] - found.x[0]))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(4.0, abs=0.4)


def test_nothing_is_guessed_from_a_point_too_near():
    begin, options = start()
    here = at_distance(begin, 0.5, options)
    before = at_distance(here, -0.01, options)
    assert _extrapolated(before, here, 0.1, options) is None
    assert _extrapolated(None, here, 0.1, options) is None


def test_unknowns_at_a_value_are_those_of_the_point():
    begin, options = start()
    for arc in arcs(begin, options):
        value = arc.a.parameter + 0.3 * (arc.b.parameter - arc.a.parameter)
        assert unknowns_at(arc, value, options) == at_value(arc, value, options).x
        if arc.b.parameter > 8.0:
            break
