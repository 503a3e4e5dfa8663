"""No state is lost: next to folds and thresholds, in any window; or that is said."""

import numpy as np
import pytest

from amoeboid.axisymmetric.branches import branch_from_sphere, branch_from_state, polarized_branch
from amoeboid.axisymmetric.onset import branch_tangent, onset_speed, onset_speeds
from amoeboid.axisymmetric.paths import CLOSED, Path, asymmetry
from amoeboid.axisymmetric.phase_diagram import _polarized_branch
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import unstable_modes
from amoeboid.axisymmetric.steady import newton_solution, strong_residual
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.axisymmetric.unknowns import resampled
from amoeboid.axisymmetric.window import Window
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.arcs import at_value
from amoeboid.numerics.branch_points import Options, at_distance, started
from amoeboid.validation import InvalidInput
from axisymmetric.scans import CELLS, Reference, rear, spaced

STEPS = Options(parameter_scale=5.0, max_step=0.4)


def amplitudes(states):
    return sorted(s.c_rear - s.parameters.c0 for s in states if s.max_retrograde_speed > 0)


def check(p, reference, values, count):
    """The polarized states at every value are those of the reference, and `count` of them."""
    for v in values:
        found = steady_solutions(p.replace(v_p0=float(v)), (1,))
        expected = sorted(rear(x) - p.c0 for x in reference.states(v))
        assert found.complete
        assert len(expected) == count
        # rounding leaves v_p0 uncertain by some 1e-9/amplitude: next to a threshold the amplitude,
        # its square root, has fewer digits
        distance = abs(v / reference.threshold - 1)
        assert amplitudes(found) == pytest.approx(expected, rel=1e-8 + 1e-9 / distance)
        assert all(strong_residual(s) < 1e-8 for s in found)


@pytest.mark.parametrize("name", ["exponential", "supercritical"])
def test_states_next_to_fold_and_threshold_are_found(name):
    p = CELLS[name]
    reference = Reference(p)
    low, threshold = reference.fold()[1], reference.threshold
    if name == "supercritical":
        check(p, reference, [threshold * (1 + 1e-6)], 1)
        assert len(steady_solutions(p.replace(v_p0=threshold * (1 - 1e-6)), (1,))) == 1
    else:
        near = 1e-6 * (threshold - low)
        check(p, reference, [low + near, threshold - near], 2)
        assert len(steady_solutions(p.replace(v_p0=low - near), (1,))) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", CELLS)
def test_all_states_between_fold_and_threshold_are_found(name):
    """25 values a cell, geometrically spaced towards both ends; far above if supercritical."""
    p = CELLS[name]
    rises = name.startswith("supercritical")
    reference = Reference(p, 1.25 if rises else 1.0)
    low, high = reference.fold()[1], reference.threshold
    if rises:
        low, high = high, 1.2 * high
    check(p, reference, spaced(low, high), 1 if rises else 2)


def test_the_stable_state_just_above_the_fold_is_found():
    found = steady_solutions(Parameters(D=0.4, v_p0=5.213))
    assert [s.max_retrograde_speed for s in found] == pytest.approx(
        [0.0, 0.89372, 0.99565], abs=5e-6
    )
    assert found.complete
    assert found.problems == ()


def test_a_state_where_the_mode_l_2_goes_first_is_found():
    p = Parameters(delta_P=0.5, v_p0=3.4)
    (state,) = [s for s in steady_solutions(p, (1,)) if s.max_retrograde_speed > 0]
    # a continuation with other steps passes it between 3.428 and 3.328
    assert state.max_retrograde_speed == pytest.approx(0.18166, abs=5e-6)
    assert strong_residual(state) < 1e-8


def test_boundary_layers_are_resolved_before_more_modes_only_add_rounding():
    """The paper's cell at 3 um/s: D/(beta R0^2) = 0.003. At 256 modes rounding reaches 5e-9."""
    p = Parameters.physical(v_p0="3 um/s", delta_P="300 Pa")
    found = steady_solutions(p, (1,))
    assert found.complete
    state = found[-1]
    assert 128 < state.n < 256
    known = resampled(state.x, state.n, 256)
    finest = newton_solution(SteadySystem(p, 256), known).x
    assert finest == pytest.approx(known, rel=1e-8, abs=1e-8)


def test_a_state_that_cannot_be_resolved_is_reported(monkeypatch):
    monkeypatch.setattr("amoeboid.axisymmetric.system.MAX_MODES", 64)
    found = steady_solutions(Parameters(D=0.03, v_p0=6.0), (1,))
    assert not found.complete
    assert "l = 1" in found.problems[0]
    assert "does not resolve" in found.problems[0]
    assert "may be missing" in repr(found)


@pytest.mark.parametrize(
    ("low", "high", "pieces"),
    [
        (6.5, 8.0, [(6.5, 8.0)]),
        pytest.param(7.0, 8.0, [(7.0, 8.0)], marks=pytest.mark.slow),
        (5.5, 8.0, [(None, 5.5), (5.5, 8.0)]),
        pytest.param(6.02, 7.0, [(None, 6.02), (6.02, 7.0)], marks=pytest.mark.slow),
        (5.3, 5.31, [(5.31, 5.3), (5.3, 5.31)]),
        (0.0, 5.3, [(5.3, 5.3)]),
    ],
)
def test_all_of_the_branch_that_lies_in_the_window_is_listed(low, high, pieces):
    branch = branch_from_sphere(Parameters(D=0.4), "v_p0", (low, high), options=STEPS)
    assert branch.complete
    assert branch.problems == ()
    assert len(branch.pieces) == len(pieces)
    for piece, (first, last) in zip(branch.pieces, pieces, strict=True):
        assert first is None or piece[0].value == first
        assert piece[-1].value == last
        assert all(low <= b.value <= high for b in piece)
    assert len(branch.folds) == (1 if low < 5.2 < high else 0)
    fastest = steady_solutions(Parameters(D=0.4, v_p0=high), (1,))[-1].max_retrograde_speed
    last = branch.pieces[-1][-1]
    assert last.stable
    assert last.state.max_retrograde_speed == pytest.approx(fastest, rel=1e-9)


def test_a_window_at_the_edge_of_which_the_branch_begins():
    threshold = onset_speed(Parameters(D=0.4))
    above = branch_from_sphere(Parameters(D=0.4), "v_p0", (threshold, 7.0), options=STEPS)
    assert [len(above.pieces), above.points[0].value] == [1, threshold]
    assert above.points[0].stable
    below = branch_from_sphere(Parameters(D=0.4), "v_p0", (5.5, threshold), options=STEPS)
    assert [p[-1].value for p in below.pieces] == [5.5, threshold]


def test_a_branch_that_stays_outside_the_window_says_where_it_is():
    branch = branch_from_sphere(Parameters(D=0.4), "v_p0", (0.0, 2.0), options=STEPS)
    assert branch.points == ()
    assert branch.complete
    assert "does not enter 0 <= v_p0 <= 2" in branch.message
    assert "5.2096" in branch.message


def test_a_window_may_be_a_pair_and_nothing_else():
    p = Parameters(D=0.4)
    pair, window = (
        branch_from_sphere(p, "v_p0", w, options=STEPS) for w in ((4.0, 8.0), Window(4.0, 8.0))
    )
    assert [b.value for b in pair.points] == [b.value for b in window.points]
    for wrong in ((4.0,), 4.0, "48x", (4.0, "a"), None):
        with pytest.raises(InvalidInput, match="pair"):
            branch_from_sphere(p, "v_p0", wrong)
    for wrong in ((8.0, 4.0), (np.nan, 8.0)):
        with pytest.raises(InvalidInput, match="low < high"):
            branch_from_sphere(p, "v_p0", wrong)


TURNING = "v_p0/(1 + v_p0**2/57.76)*exp(-c/c_r)"


def effective(v):
    return v / (1 + v**2 / 57.76)


@pytest.mark.slow
def test_a_law_with_two_thresholds_has_one_branch_between_them():
    """v_p0 enters as v/(1 + (v/7.6)^2), which has its maximum, 3.8, at v = 7.6."""
    p = Parameters(law=TURNING, v_p0=9.0)
    thresholds = onset_speeds(p)
    assert effective(np.array(thresholds)) == pytest.approx(onset_speed(Parameters()), rel=1e-9)
    assert len(thresholds) == 2
    branch = branch_from_sphere(p, "v_p0", (0.0, 20.0), options=STEPS)
    assert branch.origins == pytest.approx(thresholds, rel=1e-9)
    assert branch.complete
    found = steady_solutions(p, (1,))
    same = steady_solutions(Parameters(v_p0=float(effective(9.0))), (1,))
    assert [s.max_retrograde_speed for s in found] == pytest.approx(
        [s.max_retrograde_speed for s in same], rel=1e-8
    )
    # its end at the upper threshold was found from there: states as near as one likes
    near = steady_solutions(p.replace(v_p0=thresholds[1] * (1 - 1e-6)), (1,))
    assert len(near) == 2
    assert len(steady_solutions(p.replace(v_p0=thresholds[1] * (1 + 1e-6)), (1,))) == 1


def test_an_onset_outside_the_window_sends_its_branch_into_it():
    """At v_p0 = 5 the sphere loses stability at D = 0.2468 and the branch reaches D = 0.3483."""
    p = Parameters(v_p0=5.0)
    branch = branch_from_sphere(p, "D", (0.26, 0.28))
    assert branch.origin == pytest.approx(0.246806026, abs=1e-8)
    assert [(q[0].value, q[-1].value) for q in branch.pieces] == [(0.26, 0.28), (0.28, 0.26)]
    both = polarized_branch(p, "D", 0.26, 0.28)
    assert both.complete
    assert sorted(b.state.max_retrograde_speed for b in both.points if b.value == 0.26) == (
        pytest.approx(amplitudes_of_flow(p.replace(D=0.26)), rel=1e-8)
    )


def amplitudes_of_flow(p):
    return [s.max_retrograde_speed for s in steady_solutions(p, (1,)) if s.max_retrograde_speed > 0]


def test_a_branch_that_ends_on_symmetrical_states_says_so():
    p = Parameters(D=0.03, v_p0=3.7, delta_P=2.0)
    start = steady_solutions(p, (1,))[-1]
    branch = branch_from_state(start, "delta_P", (0.9, 2.0), -1.0)
    assert branch.complete
    # the place does not depend on the length of steps (0.01 to 0.1)
    assert "1.04094, where it reaches states that are symmetric" in branch.message
    last = branch.points[-1].state
    assert last.c_rear - last.c_front < 0.2 * (start.c_rear - start.c_front)


def test_where_a_branch_meets_symmetrical_states_is_found_and_is_no_fold():
    p, at = Parameters(D=0.165, delta_P=3.0), 1e-4
    path, folds, problem = _polarized_branch(p, onset_speed(p), np.linspace(1.0, 8.0, 12))
    assert problem == ""
    assert [fold.parameter < onset_speed(p) for fold in folds] == [True]
    last = path[-1]
    beside = [at_value(last, last.b.parameter - distance, STEPS) for distance in (at, 2 * at)]
    near, far = (float(np.sum(asymmetry(point) ** 2)) for point in beside)
    # the square of the asymmetry vanishes linearly there
    assert near / (far - near) * at == pytest.approx(at, abs=2e-7)


class Ring:
    """Unknowns as in a steady state of 2 modes; c_1 and v_p0 on a circle, the rest fixed."""

    weights = scale = np.ones(9)
    fixed = np.array([0.0, 0.0, 0.0, 3.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    def point(self, q):
        p = Parameters()
        return p.point({"v_p0": q[0]})

    def residual(self, x, q):
        f = x - self.fixed + 0 * q[0]
        f[4] = (x[4] - 3.0) ** 2 + (q[0] - 5.0) ** 2 - 1.0
        return f

    def residual_and_jacobian(self, x, q):
        jacobian = np.eye(9)
        jacobian[4, 4] = 2 * (x[4] - 3.0)
        return self.residual(x, q), jacobian

    def resolved(self, x, q):
        return True


def test_a_branch_that_closes_on_itself_ends_at_its_start():
    x = Ring.fixed.copy()
    x[4] = 4.0
    options = Options(max_step=0.3)
    start = started(Ring(), x, 5.0, np.zeros(9), 1.0, options)
    path = Path(Parameters(), "v_p0", start, options)
    lengths = [arc.b.length for arc in path]
    assert path.end == CLOSED
    assert lengths[-1] == pytest.approx(2 * np.pi, rel=0.1)


@pytest.mark.parametrize("l", [1, 2, 3, 4])
def test_a_branch_leaves_the_sphere_along_its_tangent(l):
    """v_p0 = threshold + k_1 s + ...; k_1 = 0 by symmetry for odd l, and not for even l."""
    p = Parameters(D=0.4, delta_P=30.0)
    threshold = onset_speed(p, l)
    options = Options(parameter_scale=threshold)
    size = 1e-3
    ends = []
    for sign in (1.0, -1.0):
        start = branch_tangent(p, "v_p0", threshold, options, sign=sign)
        ends.append((start, at_distance(start, size, options)))
    (plus, ahead), (minus, behind) = ends
    slope = (ahead.parameter - behind.parameter) / (2 * size)
    assert plus.parameter_tangent == -minus.parameter_tangent
    assert plus.parameter_tangent == pytest.approx(slope, rel=1e-4, abs=1e-8)
    assert (plus.parameter_tangent == 0.0) == (l % 2 == 1)


@pytest.mark.slow
def test_where_a_branch_in_pressure_ends_is_said():
    branch = polarized_branch(
        Parameters(D=0.4, v_p0=6.0), "delta_P", 1.0, 0.1, Options(max_step=0.8)
    )
    assert "symmetrical" in branch.message or not branch.complete
    assert branch.message


def test_results_say_in_a_few_lines_what_they_are():
    found = steady_solutions(Parameters(D=0.4, v_p0=5.5), (1,))
    assert repr(found).splitlines()[0] == "3 steady states, complete"
    assert len(repr(found).splitlines()) == 5
    assert len(found) == 3
    assert found[-1] is list(found)[2]
    assert found[1:] == found.states[1:]
    soft = steady_solutions(Parameters(D=0.4, v_p0=6.2, delta_P=0.0), (1,))
    assert "short waves" in soft.problems[-1]
    branch = branch_from_sphere(Parameters(D=0.4), "v_p0", (0.0, 6.0), options=STEPS)
    assert "complete" in repr(branch)
    assert "fold at v_p0 = 5.20959845" in repr(branch)
    assert len(repr(branch)) < 500


def test_the_maximum_of_a_state_with_filaments_at_the_equator_is_its_c_rear():
    """The branch of l = 2 below its threshold at delta_P = 11: c is the same at both poles."""
    found = steady_solutions(Parameters(D=0.4, v_p0=6.0, delta_P=11.0), (2,))
    (state,) = [s for s in found if s.max_retrograde_speed > 0]
    c = state.concentration(np.linspace(0.0, np.pi, 20001))
    assert c[0] == pytest.approx(c[-1], rel=1e-9)
    assert [state.c_front, state.c_rear] == pytest.approx([c.min(), c.max()], rel=1e-7)
    assert state.c_rear > 2 * state.c_front
    polarized = steady_solutions(Parameters(D=0.4, v_p0=6.0), (1,))[-1]
    poles = polarized.concentration(np.array([0.0, np.pi]))
    assert sorted(poles) == pytest.approx([polarized.c_front, polarized.c_rear], rel=1e-12)
    assert not any(unstable_modes(polarized).values())


@pytest.mark.slow
@pytest.mark.parametrize("window", [(300.0, 0.0), (0.4, 0.2)])
def test_a_branch_in_pressure_does_not_slide_to_symmetrical_states(window):
    """Its threshold does not depend on delta_P: the branch of l = 1 meets that of l = 2 instead."""
    p = Parameters(D=0.4, v_p0=6.0)
    branch = polarized_branch(p, "delta_P", *window)
    assert all(b.state.max_retrograde_speed > 1e-6 for b in branch.points)
    assert branch.origins == ()
    assert any(
        "0.29064" in problem and "symmetric from front" in problem for problem in branch.problems
    )
