from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from amoeboid.config import SHORTEST_STEP, Config, Initial, Mesh, Output, Time
from amoeboid.meshes.geometry import area, geometry, node_areas, volume_centroid
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.multistep import backward_difference, extrapolated
from amoeboid.observables import filament_number, retrograde_flow
from amoeboid.output.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from amoeboid.simulation import step_length as simulation
from amoeboid.simulation.dense_output import between, due_times
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step_length import Diverged
from amoeboid.surface import stepping
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.rigid import angular_velocity, rotation
from amoeboid.surface.stability import Growth, leading_growth_rate
from amoeboid.surface.steadiness import MAX_GROWTH_TIMES, SLOW_ROTATION
from amoeboid.surface.stepping import (
    difference,
    extrapolation,
    local_error,
    semi_implicit_step,
    starting_step,
)
from amoeboid.validation import InvalidInput
from surface.orders import in_short_steps

QUICK = Config(mesh=Mesh(subdivisions=1), initial=Initial(perturbation=1.0), output=Output())


def steps_of(config, events=()):
    first = start(config)
    model = first.model
    return model, list(evolve(first, config.time, events))


def test_a_run_ends_exactly_at_its_time():
    _, steps = steps_of(replace(QUICK, time=Time(end=1.7)))
    assert steps[-1].state.t == pytest.approx(1.7, rel=1e-14)
    assert steps[-1].ended == "end of time"
    assert all(step.ended is None for step in steps[:-1])


def test_a_run_ends_when_steady_unless_told_otherwise():
    _, steps = steps_of(QUICK)
    assert steps[-1].ended == "steady"
    assert steps[-1].steady
    goes_on = replace(QUICK, time=Time(end=steps[-1].state.t + 2, stop_when_steady=False))
    _, longer = steps_of(goes_on)
    assert longer[-1].ended == "end of time"
    # a steady state does not depend on how long one looks at it
    np.testing.assert_allclose(longer[-1].state.c, steps[-1].state.c, rtol=1e-4)


def test_a_run_ends_at_an_event():
    def past_one(step):
        return "t passed 1" if step.state.t > 1 else None

    _, steps = steps_of(QUICK, [past_one])
    assert steps[-1].ended == "t passed 1"
    assert steps[-2].state.t <= 1 < steps[-1].state.t


def test_a_tiny_growing_polarization_is_not_mistaken_for_a_steady_state():
    config = replace(
        QUICK,
        parameters=Parameters(D=0.03, v_p0=6.0),
        initial=Initial(perturbation=1e-6),
    )
    _, steps = steps_of(config)
    assert steps[-1].ended == "steady"
    assert steps[-1].state.c.max() > 5


def test_slow_rigid_rotation_is_excluded_from_the_rate_of_change():
    """A resting cell seen from axes that turn, slowly and less slowly, and with a change beside."""
    config = replace(QUICK, parameters=Parameters(D=0.4, v_p0=6.0), time=Time(end=60.0))
    _, steps = steps_of(config)
    last = steps[-1]
    assert last.ended == "steady"
    model, state = last.model, last.state
    g = geometry(state.r, model.mesh.faces)
    x = state.r - volume_centroid(state.r, model.mesh.faces)

    def rate_of(turns, beside=0.0, known=True):
        v_c = last.flow.v_c + rotation(np.array([turns, 0.0, 0.0]) * model.rate, x)
        v_c = v_c + beside * model.rate * x * x[:, :1] ** 2
        flow = replace(last.flow, v_c=v_c)
        found = angular_velocity(model, state.r, state.c, g, flow.v) if known else None
        rate, _ = simulation.relative_rate(model, replace(state, angular_velocity=found), flow)
        return rate / simulation.STEADY

    slow = 0.5 * SLOW_ROTATION
    assert rate_of(slow) < 10.0
    assert rate_of(slow, known=False) > 100.0
    assert rate_of(2.0 * SLOW_ROTATION) > 100.0
    assert rate_of(slow, beside=1e-3) > 0.5 * rate_of(0.0, beside=1e-3) > 20.0


def test_error_control_follows_the_tolerance():
    """A tenth of the tolerance: about 10^(1/3) times the steps, and a smaller error."""
    counts, ends = [], []
    for tolerance in (1e-4, 1e-5, 1e-7):
        _, steps = steps_of(replace(QUICK, time=Time(end=1.0, tolerance=tolerance)))
        counts.append(len(steps))
        ends.append(steps[-1].state.c)
    errors = [np.abs(c - ends[-1]).max() for c in ends[:-1]]
    assert errors[1] < 0.6 * errors[0]
    assert 1.6 < counts[1] / counts[0] < 2.8
    assert errors[0] < 0.01 * ends[-1].max()


@pytest.mark.parametrize("degree", [2, 3])
def test_local_error_is_that_of_the_backward_difference(degree):
    """A node, or a concentration, that moves as t^degree: steps of any length find their error.

    The exact error of a step is what its formula makes of the exact past; two past states see that
    of first order, three that of second.
    """
    first = start(QUICK)
    model, flow, rest = first.model, first.flow, first.state
    times = [0.9, 0.7, 0.4][:degree]
    new_t = 1.15
    scheme = backward_difference(times[: degree - 1], new_t)
    past = sum(w * t**degree for w, t in zip(scheme.past, times, strict=False))
    found = past + scheme.dt * degree * new_t ** (degree - 1)
    error = abs(found - new_t**degree)

    def at(t, value, push_r, push_c):
        r, c = rest.r.copy(), rest.c.copy()
        r[3] += 1e-2 * push_r * value * flow.normals[3]
        c[5] += 1e-2 * push_c * value
        return replace(rest, t=t, r=r, c=c)

    for push in ((1, 0), (0, 1)):
        history = [at(t, t**degree, *push) for t in times]
        new = at(new_t, found, *push)
        scale = 1.0 if push == (1, 0) else model.parameters.c0 + new.c[5]
        expected = extrapolation(history, new.t)
        estimate = local_error(model, expected, (new.r, new.c), flow.normals)
        assert estimate == pytest.approx(1e-2 * error / scale, rel=1e-6)
    # nodes that slide within the surface make no error
    slide = np.cross(flow.normals, [0.3, -0.5, 0.8])
    history = [at(t, 0.0, 0, 0) for t in times]
    slid = replace(rest, t=new_t, r=rest.r + slide)
    expected = extrapolation(history, new_t)
    assert local_error(model, expected, (slid.r, slid.c), flow.normals) < 1e-12


def measured_error(before, step):
    """Of a step, against many short ones from the state before."""
    state, flow = in_short_steps(before.model, before.state, step.dt, 100)
    a, b = ((s.r, s.c) for s in (step.state, state))
    return difference(before.model, a, b, flow.normals)


@pytest.mark.parametrize("delta_P", [11.0, pytest.param(300.0, marks=pytest.mark.slow)])
def test_the_first_step_follows_the_tolerance(delta_P):
    """Its error, measured against many short steps, is no larger than the tolerance allows."""
    config = Config(
        parameters=Parameters(D=0.4, v_p0=6.0, delta_P=delta_P), mesh=Mesh(subdivisions=1)
    )
    first, lengths = start(config), []
    for tolerance in (1e-4, 1e-6):
        step = next(evolve(first, Time(end=1.0, tolerance=tolerance)))
        error = measured_error(first, step)
        print(tolerance, step.dt, error)
        assert error < 1.5 * tolerance
        lengths.append(step.dt)
    assert lengths[1] < 0.3 * lengths[0]


@pytest.mark.slow
def test_a_step_that_would_empty_the_front_follows_the_tolerance_too(monkeypatch):
    """The concentration is of first order then; taken for one of second, it is wrong by more.

    Without turnover the front loses all of its filaments.
    """
    orders, real = [], stepping._concentration

    def recorded(model, known, *rest):
        c, order = real(model, known, *rest)
        orders.append(order)
        return c, order

    config = Config(
        parameters=Parameters(D=0.1, v_p0=3.0, beta=0.0),
        mesh=Mesh(subdivisions=1),
        initial=Initial(perturbation=2.99),
        time=Time(end=8.0, tolerance=1e-2),
    )
    monkeypatch.setattr(stepping, "_concentration", recorded)
    before, of_first_order = start(config), []
    for step in evolve(before, config.time):
        if orders[-1] == 1 and len(before.history) > 1:
            of_first_order.append((before, step))
        before = step
    assert len(of_first_order) > 2
    for before, step in of_first_order:
        error = measured_error(before, step)
        print(step.number, step.dt, error)
        assert error < 1.2 * config.time.tolerance


def test_step_lengths_follow_from_the_error():
    """(tolerance/error)^(1/3) with three past states, and never more than twice the last."""
    config = replace(QUICK, time=Time(end=2.0, max_step=10.0, stop_when_steady=False))
    _, steps = steps_of(config)
    assert [len(s.history) for s in steps[:4]] == [2, 3, 3, 3]
    compared = 0
    for before, step in pairwise(steps[2:-1]):
        assert step.next_dt <= 2.0 * step.dt * (1 + 1e-12)
        if step.rejected == before.rejected:
            new = step.state
            expected = extrapolation(before.history, new.t)
            error = local_error(step.model, expected, (new.r, new.c), step.flow.normals)
            wanted = simulation.SAFETY * (config.time.tolerance / error) ** (1 / 3) * step.dt
            assert step.next_dt == pytest.approx(min(wanted, 2.0 * step.dt))
            compared += wanted < 2.0 * step.dt
    assert compared > 3


def test_step_lengths_follow_from_the_error_of_a_short_past():
    """(tolerance/error)^(1/2): after a start, and after the step from two past states."""
    first = start(QUICK)
    model, dt, tolerance = first.model, 0.04, 3e-5
    begun = next(evolve(replace(first, next_dt=dt), Time(max_step=10.0, tolerance=tolerance)))
    _, _, of_start = starting_step(model, first.state, dt, first.flow, tolerance)
    second = next(evolve(replace(begun, next_dt=dt), Time(max_step=10.0, tolerance=10 * tolerance)))
    new = second.state
    expected = extrapolation(begun.history, new.t)
    of_second = local_error(model, expected, (new.r, new.c), second.flow.normals)
    for step, error in ((begun, of_start / tolerance), (second, of_second / (10 * tolerance))):
        assert step.dt == pytest.approx(dt)
        growth = simulation.SAFETY * error ** (-1 / 2)
        assert simulation.MIN_STEP_FACTOR < growth < simulation.MAX_STEP_FACTOR
        assert step.next_dt == pytest.approx(growth * dt)


def test_a_last_step_cut_short_does_not_shorten_the_next():
    _, steps = steps_of(replace(QUICK, time=Time(end=1.0)))
    reached = steps[-3].state.t + 1e-3 * steps[-2].dt
    _, cut = steps_of(replace(QUICK, time=Time(end=reached)))
    assert cut[-1].dt < 0.01 * steps[-2].dt
    assert cut[-1].next_dt >= 0.99 * cut[-2].next_dt


@pytest.mark.parametrize("sliver", [1e-1, 1e-3, 1e-6, 1e-9])
def test_steps_after_one_cut_short_grow_no_faster_than_is_stable(sliver):
    """BDF2 with variable steps: 1 + sqrt(2); below the shortest step there is nothing to grow."""
    _, steps = steps_of(replace(QUICK, time=Time(end=1.0)))
    reached = steps[-3].state.t + sliver * steps[-2].dt
    (cut,) = evolve(steps[-3], Time(end=reached))
    resumed = [cut, *evolve(cut, Time(end=1.0))]
    for before, step in pairwise(resumed):
        shortest = 2.0 * SHORTEST_STEP / step.model.rate
        assert step.dt < max((1 + np.sqrt(2)) * before.dt, 1.01 * shortest)
    np.testing.assert_allclose(resumed[-1].state.c, steps[-1].state.c, rtol=2e-3)


def test_steps_after_explicit_ones_grow_from_their_length():
    explicit = Time(end=1.001e-3, max_step=1e-4, scheme="explicit")
    _, steps = steps_of(replace(QUICK, time=explicit))
    assert steps[-1].dt == pytest.approx(1e-6)
    resumed = [steps[-1], *evolve(steps[-1], Time(end=0.5))]
    assert all(b.dt < (1 + np.sqrt(2)) * a.dt for a, b in pairwise(resumed))
    assert max(step.dt for step in resumed) > 0.05


def test_outcome_of_a_run_does_not_depend_on_the_tolerance():
    for v_p0, polarized in ((5.9, True), (5.0, False)):
        for tolerance in (1e-3, 1e-4):
            config = Config(
                parameters=Parameters(D=0.4, v_p0=v_p0),
                mesh=Mesh(subdivisions=1),
                time=Time(tolerance=tolerance),
            )
            _, steps = steps_of(config)
            assert (np.ptp(steps[-1].state.c) > 5) == polarized


@pytest.mark.parametrize(
    "parameters",
    [
        Parameters(delta_P=1e308),
        Parameters(law="-v_p0/c"),
        Parameters(R0=1e-200),
    ],
)
def test_parameters_that_allow_no_start_are_refused(parameters):
    with pytest.raises(InvalidInput):
        start(replace(QUICK, parameters=parameters))


def test_the_same_input_gives_the_same_bits():
    config = replace(
        QUICK, initial=Initial(perturbation=1.0, noise=0.1, seed=5), time=Time(end=1.0)
    )
    _, a = steps_of(config)
    _, b = steps_of(config)
    assert len(a) == len(b)
    assert np.array_equal(a[-1].state.r, b[-1].state.r)
    assert np.array_equal(a[-1].state.c, b[-1].state.c)
    assert np.array_equal(a[-1].flow.v_c, b[-1].flow.v_c)


def test_a_run_continued_from_any_step_is_the_uninterrupted_one():
    config = replace(QUICK, time=Time(end=2.0))
    _, steps = steps_of(config)
    again = list(evolve(steps[4], config.time))
    assert [s.number for s in again] == [s.number for s in steps[5:]]
    assert np.array_equal(again[-1].state.r, steps[-1].state.r)
    assert np.array_equal(again[-1].state.c, steps[-1].state.c)


def test_a_run_that_cannot_go_on_says_why_and_keeps_its_good_steps():
    # the inverse law drives filaments off a nearly bare front
    config = replace(
        QUICK,
        parameters=Parameters(law="inverse", D=1e-4, v_p0=30.0),
        initial=Initial(perturbation=2.9),
    )
    first = start(config)
    good = [first]
    with pytest.raises(Diverged, match=r"at t = .*(step|concentration)"):
        for step in evolve(first, config.time):
            good.append(step)
    assert all(np.all(np.isfinite(s.state.c)) and s.state.c.min() >= 0 for s in good)
    assert all(np.all(np.isfinite(s.state.r)) and np.isfinite(s.rate) for s in good)


UNSTABLE = Config(parameters=Parameters(D=0.4, v_p0=8.0, delta_P=20.0), mesh=Mesh(subdivisions=2))
BENDS = 50.0  # where the cell seems steady, at t = 54, the state is unstable to m = 1


def headings(steps):
    """Directions from step to step in the frame in which the mean cortex velocity vanishes."""
    way = np.diff([step.state.position for step in steps], axis=0)
    return way / np.linalg.norm(way, axis=1)[:, None]


def test_a_straight_cell_that_is_unstable_is_not_steady_and_turns(monkeypatch):
    # at the axisymmetric rate, 0.125, rounding needs some hundred units of time to show
    config = replace(UNSTABLE, time=Time(end=180.0))
    _, steps = steps_of(config)
    # it seemed steady, and headed straight until then
    known = [step for step in steps if step.growth is not None]
    assert known
    assert 0.05 < known[0].growth < 0.4
    assert known[0].state.t > BENDS
    directions = headings(steps)
    place = steps.index(known[0])
    assert directions[place] @ directions[place // 2] > 0.999
    # then the perturbation took it off its way
    assert steps[-1].ended == "end of time"
    assert (directions[place:] @ directions[place]).min() < 0.5
    # without the analysis it ends there
    monkeypatch.setattr(simulation, "leading_growth_rate", lambda *_: Growth(-1.0, 0.0))
    *_, last = evolve(steps[place // 2], config.time)
    assert last.ended == "steady"
    assert last.number == known[0].number


def test_stability_is_found_once_and_a_run_continued_goes_on_as_the_uninterrupted_one(
    monkeypatch, tmp_path
):
    calls, found = [], simulation.leading_growth_rate

    def counted(*args):
        calls.append(1)
        return found(*args)

    monkeypatch.setattr(simulation, "leading_growth_rate", counted)
    config = replace(UNSTABLE, time=Time(end=70.0))
    _, steps = steps_of(config)
    known = [step for step in steps if step.growth is not None]
    assert len(known) > 2
    assert len({step.growth for step in known}) == len(calls)
    assert len(calls) < 3
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, Checkpoint(config, known[1], (known[1].state.t,)))
    count = len(calls)
    again = list(evolve(read_checkpoint(path).step, config.time))
    rest = steps[steps.index(known[1]) + 1 :]
    assert [(s.growth, s.steady, s.rate) for s in again] == [
        (s.growth, s.steady, s.rate) for s in rest
    ]
    assert np.array_equal(again[-1].state.c, rest[-1].state.c)
    assert len(calls) - count == len({s.growth for s in rest if s.growth} - {known[1].growth})


def judged(monkeypatch, rates, growths, dt=0.1, first=1.0):
    """(growth, steady) of steps that change at `rates`, where analyses find `growths`."""
    _, steps = steps_of(replace(QUICK, time=Time(end=1.0)))
    rates, growths = iter(rates), iter(growths)
    monkeypatch.setattr(
        simulation, "relative_rate", lambda *_: (rate := next(rates), rate < simulation.STEADY)
    )
    monkeypatch.setattr(
        simulation, "leading_growth_rate", lambda *_: Growth(next(growths), 0.0, "not found")
    )
    step, found = replace(steps[-1], rate=first), []
    while True:
        history = (replace(step.state, t=step.state.t + dt), *step.history[:2])
        try:
            step = simulation._accepted(step, step.model, history, step.flow, dt, 0)
        except StopIteration:
            return found
        found.append((step.growth, step.steady))


def test_stability_is_found_anew_after_the_cell_has_changed(monkeypatch):
    rates = [1.0, 0.5e-5, 0.4e-5, 1e-3, 0.5e-5, 0.6e-5, 0.3e-5]
    assert judged(monkeypatch, rates, [0.5, -0.5]) == [
        (None, False),
        (0.5, False),
        (0.5, False),
        (None, False),
        (-0.5, True),
        (-0.5, True),
        (-0.5, True),
    ]


def test_a_little_more_change_does_not_end_a_rest(monkeypatch):
    """Or its stability would be found again and again."""
    rates = [1.0, 0.9e-5, 1.2e-5, 0.9e-5, 2.5e-5, 0.8e-5, 3.5e-5]
    found = judged(monkeypatch, rates, [-0.5])
    assert found == [(None, False), *[(-0.5, True)] * 5, (None, False)]


def test_a_cell_that_still_changes_faster_is_not_at_rest(monkeypatch):
    rates = [0.5e-5, 0.6e-5, 0.7e-5, 0.6e-5]
    found = judged(monkeypatch, rates, [-0.5], first=1e-6)
    assert found == [*[(None, False)] * 3, (-0.5, True)]


@pytest.mark.parametrize(("growth", "steady"), [(0.018, True), (0.022, False)])
def test_a_state_is_unstable_above_two_hundredths_of_the_rate(growth, steady, monkeypatch):
    growth *= QUICK.parameters.rate
    assert judged(monkeypatch, [1.0, 0.5e-5], [growth])[-1] == (growth, steady)


def test_growth_that_does_not_show_is_not_waited_for_forever(monkeypatch):
    found = judged(monkeypatch, [1.0, *[0.5e-5] * 50], [2.0], dt=0.5)
    waited = found.index((2.0, True))
    assert found[1:waited] == [(2.0, False)] * (waited - 1)
    assert found[waited:] == [(2.0, True)] * (51 - waited)
    assert 0.5 * (waited - 1) == pytest.approx(MAX_GROWTH_TIMES / 2.0, abs=0.6)


def test_a_state_whose_stability_cannot_be_found_is_steady_and_not_looked_at_again(monkeypatch):
    assert judged(monkeypatch, [1.0, 0.5e-5, 0.6e-5, 0.4e-5], [None]) == [
        (None, False),
        (None, True),
        (None, True),
        (None, True),
    ]


def test_a_cell_whose_front_is_empty_ends_steady():
    """Where flux correction rules, on too coarse a mesh, little is known of perturbations."""
    config = Config(
        parameters=Parameters(D=0.1, v_p0=3.0, beta=0.0),
        mesh=Mesh(subdivisions=1),
        initial=Initial(perturbation=2.99),
        time=Time(end=150.0),
    )
    _, steps = steps_of(config)
    assert steps[-1].ended == "steady"
    assert steps[-1].state.c.min() < 1e-8
    assert steps[-1].stability == "unknown"
    assert "is known only to" in steps[-1].stability_problem


def test_a_fast_unstable_cell_is_not_steady():
    """Its implicit steps converge slowly: the analysis has to take shorter ones."""
    config = Config(
        parameters=Parameters(D=0.4, v_p0=9.6, delta_P=30.0),
        mesh=Mesh(subdivisions=2),
        time=Time(end=50.0),
    )
    _, steps = steps_of(config)
    assert not any(step.steady for step in steps)
    assert steps[-1].rate > 1e-2
    still = min(steps, key=lambda step: step.rate)
    growth = leading_growth_rate(still.model, still.state, still.flow)
    assert 0.3 < growth.rate < 0.9
    assert growth.error < 0.1


def test_a_sphere_exactly_at_rest_above_its_threshold_is_not_steady():
    config = replace(
        QUICK,
        parameters=Parameters(D=0.4, v_p0=7.0),
        initial=Initial(perturbation=0.0),
        time=Time(end=10.0),
    )
    _, steps = steps_of(config)
    assert not any(step.steady for step in steps)


def in_fixed_steps(config, dt, end):
    """All steps of the same length, whatever their error."""
    steps = [start(config)]
    while steps[-1].state.t < end - 1e-9:
        last = steps[-1]
        state, flow, _ = semi_implicit_step(last.model, last.history, dt, last.flow, 1e-9)
        history = (state, *last.history[:2])
        steps.append(replace(last, number=last.number + 1, history=history, flow=flow))
    return steps


def at(steps, t):
    """The cell at time t of a run."""
    for before, after in pairwise(steps):
        if before.state.t < t <= after.state.t:
            return between(before, after, t)
    raise AssertionError(t)


def test_the_cell_between_two_steps_is_of_second_order_and_keeps_area_and_filaments():
    """Against many short steps; without turnover, so that the number of filaments is kept."""
    config = replace(QUICK, parameters=Parameters(D=0.4, v_p0=3.0, beta=0.0, delta_P=30.0))
    times = 0.8 * np.array([0.733, 0.81, 0.9])
    reference = in_fixed_steps(config, 5e-3, 0.8)
    errors = []
    for dt in (0.1, 0.05, 0.025):
        steps, worst = in_fixed_steps(config, dt, 0.8), np.zeros(3)
        for t in times:
            cell, exact = at(steps, t), at(reference, t)
            model, now = cell.model, cell.state
            assert now.t == t
            assert area(now.r, model.mesh.faces) == pytest.approx(model.A0, rel=1e-12)
            found = filament_number(SurfaceCell(model, now, cell.flow))
            assert found == pytest.approx(filament_number(steps[0].cell), rel=1e-12)
            r = np.einsum("vi,vi->v", now.r - exact.state.r, exact.flow.normals)
            flow = retrograde_flow(SurfaceCell(model, now, cell.flow))
            v = flow - retrograde_flow(SurfaceCell(model, exact.state, exact.flow))
            c = (now.c - exact.state.c) / exact.state.c
            worst = np.maximum(worst, [np.abs(c).max(), np.abs(r).max(), np.abs(v).max()])
        errors.append(worst)
    order = 0.5 * np.log2(errors[0] / errors[-1])
    print(errors, order)
    # that of the shape is higher: its small errors change sign
    assert np.all(order > 1.8)
    assert np.all(errors[-1] < 5e-5)


def parts(step):
    return step.state, step.flow


def test_the_cell_at_the_ends_of_a_step_is_that_of_the_step():
    _, steps = steps_of(replace(QUICK, time=Time(end=1.0)))
    for before, after in pairwise(steps):
        for state, flow, t in (
            (after.state, after.flow, after.state.t),
            (before.state, before.flow, before.state.t),
        ):
            cell = between(before, after, t)
            np.testing.assert_allclose(cell.state.r, state.r, atol=1e-12)
            np.testing.assert_allclose(cell.state.c, state.c, rtol=1e-12)
            np.testing.assert_allclose(cell.flow.v, flow.v, atol=1e-12)
            np.testing.assert_allclose(cell.state.position, state.position, atol=1e-12)
    for outside in (before.state.t - 1e-3, after.state.t + 1e-3):
        with pytest.raises(InvalidInput, match="t must be"):
            between(before, after, outside)


def test_between_steps_concentrations_stay_positive_where_a_front_empties():
    config = Config(
        parameters=Parameters(D=0.1, v_p0=3.0, beta=0.0),
        mesh=Mesh(subdivisions=1),
        initial=Initial(perturbation=2.99),
        time=Time(end=8.0, tolerance=1e-2),
    )
    before, straight = start(config), 0
    for step in evolve(before, config.time):
        for share in (0.25, 0.75):
            t = before.state.t + share * step.dt
            cell = between(before, step, t)
            assert cell.state.c.min() >= 0
            found = filament_number(cell.cell)
            assert found == pytest.approx(filament_number(step.cell), rel=1e-12)
            numbers = [s.c * node_areas(s.r, step.model.mesh.faces) for s in step.history]
            straight += extrapolated([s.t for s in step.history], numbers, t).min() < 0
        before = step
    assert straight > 0


@pytest.mark.parametrize("interval", [0.1, 0.7, 1e-5])
def test_times_of_frames_are_multiples_of_the_interval(interval):
    """Whatever the ends of the steps, and with their rounding."""
    found, t = [], 0.0
    for dt in np.random.default_rng(1).uniform(0.0, 3.0 * interval, 400):
        found += due_times(found[-1] if found else 0.0, t + dt, interval)
        t += dt
    assert len(found) == int(t / interval)
    np.testing.assert_allclose(found, interval * np.arange(1, len(found) + 1), rtol=1e-12)
    # a step that ends there but for rounding is the frame itself
    assert list(due_times(0.2, np.nextafter(0.3, 0.0), 0.1)) == [np.nextafter(0.3, 0.0)]
    assert list(due_times(0.2, np.nextafter(0.3, 1.0), 0.1)) == [np.nextafter(0.3, 1.0)]
    assert list(due_times(np.nextafter(0.3, 0.0), 0.35, 0.1)) == []
