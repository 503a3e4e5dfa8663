from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from amoeboid.closed_forms.linear import base_tension
from amoeboid.config import Config, Initial, Mesh, Time
from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.geometry import area, geometry, mesh_quality, volume_centroid
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.iterations import Iteration
from amoeboid.numerics.multistep import extrapolated
from amoeboid.observables import filament_number, observed
from amoeboid.simulation.loop import evolve, start
from amoeboid.surface import stepping
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.initial import perturbed, sphere
from amoeboid.surface.model import Model
from amoeboid.surface.state import State
from amoeboid.surface.stepping import (
    StepFailed,
    difference,
    extrapolation,
    local_error,
    semi_implicit_step,
    starting_step,
)
from amoeboid.surface.transport import rate_of_change
from amoeboid.validation import InvalidInput
from surface.orders import in_short_steps, measured_orders

POLARIZED = Parameters(D=0.4, v_p0=6.0)


def short_run(model, state, steps=12, dt=0.05):
    history = (state,)
    for _ in range(steps):
        state, flow, _ = semi_implicit_step(model, history, dt)
        history = (state, *history[:1])
    return state, flow


def rotation_matrix(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * cross.T + (1 - np.cos(angle)) * cross @ cross


unit_vectors = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


@settings(max_examples=8)
@given(axis=unit_vectors, angle=st.floats(0.1, 3.0))
def test_a_rotated_cell_gives_the_rotated_result(axis, angle):
    """The whole method, mesh included, omega with the cell: the same numbers to rounding."""
    model, rest = sphere(POLARIZED, 1)
    state = perturbed(model, rest, Initial(perturbation=1.0, direction=(0.2, 0.5, -0.7)))
    turn = rotation_matrix(axis, angle)
    plain, flow = short_run(model, state)
    turned, turned_flow = short_run(model, replace(state, r=state.r @ turn.T))
    np.testing.assert_allclose(turned.r, plain.r @ turn.T, atol=1e-9)
    np.testing.assert_allclose(turned.c, plain.c, rtol=1e-8)
    np.testing.assert_allclose(turned.position, turn @ plain.position, atol=1e-9)
    a, b = (
        observed(SurfaceCell(model, plain, flow)),
        observed(SurfaceCell(model, turned, turned_flow)),
    )
    headings = [
        np.array([found.pop(f"cortex_drag_heading_{axis}") for axis in "xyz"]) for found in (a, b)
    ]
    assert a == pytest.approx(b, rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(headings[1], turn @ headings[0], atol=1e-6)


@pytest.mark.slow
@settings(max_examples=6)
@given(direction=unit_vectors)
def test_polarization_along_any_direction_gives_the_same_numbers(direction):
    """The mesh has no preferred direction beyond its own error."""
    numbers = []
    for along in ((0.0, 0.0, 1.0), direction):
        config = Config(mesh=Mesh(subdivisions=2), initial=Initial(direction=along))
        first = start(config)
        model = first.model
        *_, last = evolve(first, config.time)
        assert last.steady
        numbers.append(observed(SurfaceCell(model, last.state, last.flow)))
        x = last.state.r - volume_centroid(last.state.r, model.mesh.faces)
        axis = (last.flow.node_areas * last.state.c) @ x
        heading = axis @ np.array(along) / np.linalg.norm(axis) / np.linalg.norm(along)
        # 162 nodes turn the axis by up to 6e-4 per unit time, a quarter of that on 642
        assert heading > 1 - 1e-3
        assert -last.state.position @ axis / np.linalg.norm(axis) > 0.999 * np.linalg.norm(
            last.state.position
        )
    # the discretization error of 162 nodes is 1 to 2.5 %
    for name, tolerance in (
        ("max_retrograde_speed", 0.01),
        ("c_front", 0.01),
        ("c_rear", 0.03),
        ("zeta0", 1e-4),
    ):
        assert numbers[1][name] == pytest.approx(numbers[0][name], rel=tolerance)


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_relabelled_nodes_give_the_same_numbers(seed):
    model, rest = sphere(POLARIZED, 1)
    state = perturbed(model, rest, Initial(perturbation=2.0, direction=(0.3, -0.1, 1.0)))
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(state.c))
    new_label = np.argsort(order)
    faces = np.roll(new_label[model.mesh.faces], rng.integers(3), axis=1)
    relabelled = Model(POLARIZED, connectivity(faces[rng.permutation(len(faces))]))
    plain, _ = short_run(model, state)
    other, _ = short_run(relabelled, replace(state, r=state.r[order], c=state.c[order]))
    np.testing.assert_allclose(other.r, plain.r[order], atol=1e-9)
    np.testing.assert_allclose(other.c, plain.c[order], rtol=1e-8)


@settings(max_examples=5)
@given(
    D=st.floats(0.1, 1.0),
    strength=st.floats(0.5, 1.5),
    delta_P=st.floats(10, 500),
    perturbation=st.floats(0.01, 2.5),
)
def test_area_and_without_turnover_filaments_are_kept_over_a_whole_run(
    D, strength, delta_P, perturbation
):
    p = Parameters(beta=0, D=D, delta_P=delta_P, v_p0=strength * D / 3 * np.exp(3))
    config = Config(
        parameters=p,
        mesh=Mesh(subdivisions=2),
        initial=Initial(perturbation=perturbation),
        time=Time(end=4.0, stop_when_steady=False),
    )
    first = start(config)
    model = first.model
    number = filament_number(SurfaceCell(model, first.state, first.flow))
    for step in evolve(first, config.time):
        assert area(step.state.r, model.mesh.faces) == pytest.approx(model.A0, rel=1e-12)
        found = filament_number(SurfaceCell(model, step.state, step.flow))
        assert found == pytest.approx(number, rel=1e-12)


def test_c_does_not_move_if_only_the_mesh_drifts(monkeypatch):
    """A distorted mesh drifts back so fast that no filament moves: c at a place must stay."""
    monkeypatch.setattr(stepping, "MESH_RELAXATION", 1e5)
    p = Parameters(beta=0, D=0, v_p0=0.1, law="v_p0 + 0*c")
    ratios = []
    for subdivisions in (2, 3):
        r, faces = uniform_icosphere(subdivisions)
        x, y, z = r.T
        distorted = r + 0.1 * np.column_stack([y * z, np.sin(2 * x), x * y])
        distorted /= np.linalg.norm(distorted, axis=1, keepdims=True)
        model = Model(p, connectivity(faces))
        distorted *= np.sqrt(model.A0 / area(distorted, faces))

        def field(x):
            return 3 + x[:, 2] + 0.5 * x[:, 0] * x[:, 1]

        state = State(0.0, distorted, field(distorted), float(base_tension(p)), np.zeros(3))
        for _ in range(40):
            state, *_ = semi_implicit_step(model, (state,), 5e-6 / model.rate)
        left_behind = np.sqrt(np.mean((field(state.r) - field(distorted)) ** 2))
        error = np.sqrt(np.mean((state.c - field(state.r)) ** 2))
        ratios.append(error / left_behind)
        print(left_behind, error)
    assert max(ratios) < 0.35
    assert ratios[-1] < ratios[0]


def test_an_oblique_soft_cell_becomes_steady_although_its_mesh_rotates_it():
    """No force holds the axis: the mesh omega it, at a rate that never falls below STEADY."""
    config = Config(
        parameters=replace(POLARIZED, delta_P=11.0),
        mesh=Mesh(subdivisions=2),
        initial=Initial(direction=(0.0, 1.0, 1.0)),
    )
    *_, last = evolve(start(config), config.time)
    assert last.ended == "steady"
    p, c = POLARIZED, last.state.c
    g = geometry(last.state.r, last.model.mesh.faces)
    rate = rate_of_change(last.model, c, g, last.flow.v) / (c.max() * p.rate)
    assert np.abs(rate).max() > 2e-5


def test_the_cell_advances_as_fast_as_its_cortex_flows_back():
    """Lab frame: the mean cortex rests. The cell moves at minus the mean v_c of its own frame."""
    config = Config(parameters=POLARIZED, mesh=Mesh(subdivisions=2))
    first = start(config)
    model = first.model
    steps = list(evolve(first, config.time))
    last, before = steps[-1], steps[-2]
    velocity = (last.state.position - before.state.position) / last.dt
    flow = last.flow
    expected = -(flow.node_areas @ flow.v_c) / flow.node_areas.sum()
    np.testing.assert_allclose(velocity, expected, rtol=1e-5, atol=1e-9)
    # of the order of the retrograde speed, towards the front
    assert (
        0.5
        < -velocity[2] / observed(SurfaceCell(model, last.state, flow))["max_retrograde_speed"]
        < 1.2
    )


@pytest.mark.parametrize("delta_P", [0.0, 0.05, 1.0, 300.0])
def test_a_homogeneous_cell_starts_at_rest_at_any_pressure(delta_P):
    p = Parameters(D=0.4, v_p0=6.0, delta_P=delta_P)
    model, rest = sphere(p, 2)
    flow = flow_of(model, rest, 0.1)
    # without pressure the stress of the cortex is zero, and nothing resists the errors of the mesh
    largest = 5e-3 if delta_P > 0 else 1.2e-2
    assert np.abs(flow.v).max() < largest * p.v_p(p.c0)
    assert flow.zeta0 == pytest.approx(float(base_tension(p)), rel=0.02)


def test_a_step_does_not_depend_on_units():
    """The same cell in micrometers, seconds and filaments per square micrometer."""
    length, time_, force, density = 10.0, 7.0, 3.0, 400.0
    scaled = Parameters(
        R0=length,
        delta_P=POLARIZED.delta_P * force / length**2,
        eta_s=POLARIZED.eta_s * force * time_ / length,
        eta_b=POLARIZED.eta_b * force * time_ / length,
        c0=POLARIZED.c0 * density,
        c_r=density,
        beta=POLARIZED.beta / time_,
        D=POLARIZED.D * length**2 / time_,
        v_p0=POLARIZED.v_p0 * length / time_,
    )
    results = []
    for p, unit_time, unit_density in ((POLARIZED, 1.0, 1.0), (scaled, time_, density)):
        model, rest = sphere(p, 1)
        state = perturbed(model, rest, Initial(perturbation=2.0 * unit_density))
        state, flow = short_run(model, state, dt=0.05 * unit_time)
        numbers = observed(SurfaceCell(model, state, flow))
        results.append((state.c / unit_density, numbers["max_retrograde_speed"] * unit_time / p.R0))
    np.testing.assert_allclose(results[1][0], results[0][0], rtol=1e-8)
    assert results[1][1] == pytest.approx(results[0][1], rel=1e-7)


def transients(delta_P, counts, compared=1):
    """The whole transient from a perturbed sphere, in steps of all lengths scaled together.

    Of each run what it finds at its end, or at so many times all over it.
    """
    model, rest = sphere(replace(POLARIZED, delta_P=delta_P), 1)
    begin = perturbed(model, rest, Initial(perturbation=2.0))
    for n in counts:
        history, found = (begin,), []
        for k in range(n):
            # steps that grow, as the controller lets them
            length = 0.4 * (((k + 1) / n) ** 1.5 - (k / n) ** 1.5)
            state, flow, _ = semi_implicit_step(model, history, length)
            history = (state, *history[:1])
            if (k + 1) % (n // compared) == 0:
                found.append((state, flow))
        yield found


def test_the_step_is_second_order_in_time():
    counts = (40, 80, 160, 640)
    orders = measured_orders(transients(300.0, counts), counts)
    assert abs(orders["c"] - 2) < 0.2
    assert abs(orders["shape"] - 2) < 0.2
    assert abs(orders["v"] - 2) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("delta_P", [11.0, 300.0])
def test_everything_is_second_order_in_time(delta_P):
    """The largest errors of the whole transient.

    At one time an error may pass through zero, or be so small that the next order is still seen.
    The first time is that of the eighth of 320 steps: the tension at the end of the very first
    step, which has no past, is of first order, and later ones hardly depend on it.
    """
    counts = (320, 640, 1280, 10240)
    orders = measured_orders(transients(delta_P, counts, compared=40), counts)
    for name, order in orders.items():
        assert abs(order - 2) < 0.2, name


def test_the_iteration_solves_the_implicit_equations(monkeypatch):
    """What further passes would change is a small part of what the first ones did."""
    model, rest = sphere(replace(POLARIZED, delta_P=11.0), 1)
    begin = perturbed(model, rest, Initial(perturbation=2.0))
    first, *_ = semi_implicit_step(model, (begin,), 0.05)
    history = (first, begin)
    found, flow, _ = semi_implicit_step(model, history, 0.1)
    monkeypatch.setattr(stepping, "CONVERGED", 1e-7)
    monkeypatch.setattr(stepping, "MAX_ITERATIONS", 60)
    solved, *_ = semi_implicit_step(model, history, 0.1)
    times = [s.t for s in history]
    ahead = [extrapolated(times, [getattr(s, x) for s in history], found.t) for x in ("r", "c")]
    distance = difference(model, (solved.r, solved.c), ahead, flow.normals)
    left = difference(model, (solved.r, solved.c), (found.r, found.c), flow.normals)
    assert 0 < left < 0.12 * distance


def test_remaining_error_of_the_iteration_is_a_share_of_the_error_of_the_step(monkeypatch):
    """Also where steps are so short that the first change is large beside it."""
    model, rest = sphere(replace(POLARIZED, delta_P=11.0), 1)
    history = (perturbed(model, rest, Initial(perturbation=2.0)),)
    for _ in range(6):
        state, *_ = semi_implicit_step(model, history, 0.02, tolerance=1e-9)
        history = (state, *history[:2])
    found, flow, _ = semi_implicit_step(model, history, 0.02, tolerance=0.0)
    expected = extrapolation(history, found.t)
    error = local_error(model, expected, (found.r, found.c), flow.normals)
    monkeypatch.setattr(stepping, "CONVERGED", 1e-9)
    monkeypatch.setattr(stepping, "MAX_ITERATIONS", 60)
    solved, *_ = semi_implicit_step(model, history, 0.02, tolerance=0.0)
    left = difference(model, (solved.r, solved.c), (found.r, found.c), flow.normals)
    print(left, error)
    assert 0 < left < 0.4 * error


@pytest.mark.parametrize("delta_P", [11.0, 300.0])
def test_error_estimate_of_a_step_without_a_past(delta_P):
    """Two implicit Euler steps of half the length: as far from exact as from one whole step."""
    model, rest = sphere(replace(POLARIZED, delta_P=delta_P), 1)
    now = perturbed(model, rest, Initial(perturbation=2.0))
    dt = 2e-4
    new, flow, error = starting_step(model, now, dt, None, 1e-9)
    state, _ = in_short_steps(model, now, dt, 200)
    exact = difference(model, (new.r, new.c), (state.r, state.c), flow.normals)
    print(delta_P, error, exact)
    assert 0.8 < error / exact < 1.25


def test_a_step_whose_iteration_does_not_converge_fails():
    def passes(*changes):
        # each begins where the one before ended
        ends = np.concatenate([[0.0], np.cumsum(changes)])
        return [Iteration(np.array([a]), np.array([b])) for a, b in pairwise(ends)]

    assert not stepping._converged(passes(1.0), 1.0)
    assert stepping._converged(passes(1.0, 0.1), 1.0)
    assert not stepping._converged(passes(1.0, 0.5), 1.0)
    assert not stepping._converged(passes(1.0, 0.1), 1e-3)
    with pytest.raises(StepFailed, match="do not converge"):
        stepping._converged(passes(*[1.0] * stepping.MAX_ITERATIONS), 1.0)
    for broken in (np.nan, np.inf):
        with pytest.raises(StepFailed, match="not finite"):
            stepping._converged(passes(1.0, broken), 1.0)


def test_a_step_to_a_folded_or_degenerate_mesh_fails():
    model, rest = sphere(POLARIZED, 1)
    stepping.check_step(model, rest, rest)
    a, b, _ = model.mesh.faces[0]
    mirrored = rest.r.copy()
    mirrored[[a, b]] = mirrored[[b, a]]
    with pytest.raises(StepFailed, match="has inverted"):
        stepping.check_step(model, rest, replace(rest, r=mirrored))
    flat = rest.r.copy()
    flat[a] = flat[b] + 1e-3 * (flat[a] - flat[b])
    with pytest.raises(StepFailed, match="degenerated"):
        stepping.check_step(model, replace(rest, r=flat), replace(rest, r=flat))


def test_a_distorted_mesh_becomes_uniform():
    model, rest = sphere(POLARIZED, 1)
    x, y, z = rest.r.T
    r = rest.r + 0.15 * np.column_stack([y * z, np.sin(2 * x), x * y])
    r *= np.linalg.norm(rest.r, axis=1)[:, None] / np.linalg.norm(r, axis=1)[:, None]
    r *= np.sqrt(model.A0 / area(r, model.mesh.faces))
    state, _ = short_run(model, replace(rest, r=r), steps=60, dt=0.1)
    before, after = (mesh_quality(s, model.mesh.faces) for s in (r, state.r))
    assert 1 - after < 0.5 * (1 - before)


def test_noise_is_reproducible_and_seeded():
    model, rest = sphere(POLARIZED, 1)
    a, b, other = (
        perturbed(model, rest, Initial(perturbation=0, noise=0.1, seed=s)).c for s in (1, 1, 2)
    )
    assert np.array_equal(a, b)
    assert not np.array_equal(a, other)
    assert np.std(a - 3) == pytest.approx(0.1, rel=0.3)


def test_a_negative_initial_concentration_is_refused():
    model, rest = sphere(POLARIZED, 1)
    with pytest.raises(InvalidInput, match=r"initial\.perturbation = 3\.5"):
        perturbed(model, rest, Initial(perturbation=3.5))


@pytest.mark.parametrize("field", ["r", "c"])
def test_nothing_that_is_not_finite_is_accepted(field):
    model, rest = sphere(POLARIZED, 1)
    values = getattr(rest, field).copy()
    values.flat[7] = np.nan
    with pytest.raises(ArithmeticError):
        semi_implicit_step(model, (replace(rest, **{field: values}),), 0.1)


def test_no_anderson_step_leads_to_a_negative_concentration(monkeypatch):
    """A law may not be defined there."""
    model, rest = sphere(POLARIZED, 1)
    begin = perturbed(model, rest, Initial(perturbation=2.99))
    seen, balance = [], stepping.force_balance

    def watched(model, factorized, r, g, c, *rest):
        seen.append(c.min())
        return balance(model, factorized, r, g, c, *rest)

    monkeypatch.setattr(stepping, "force_balance", watched)
    monkeypatch.setattr(stepping, "anderson_step", lambda before, last: 1e3)
    with pytest.raises(ArithmeticError):
        semi_implicit_step(model, (begin,), 0.3)
    assert len(seen) > 2
    assert min(seen) == 0.0


def test_anderson_steps_save_iterations(monkeypatch):
    """A soft cell on its way to the steady state, same steps to high accuracy with and without."""
    model, rest = sphere(replace(POLARIZED, delta_P=11.0), 1)
    begin = perturbed(model, rest, Initial(perturbation=2.0))

    def passes():
        history, made = (begin,), 0
        for _ in range(12):
            state, *_ = semi_implicit_step(model, history, 0.1)
            history = (state, *history[:1])
            made += count.pop()
        return made, state

    count, converged = [], stepping._converged

    def counted(passes, allowed):
        done = converged(passes, allowed)
        if done:
            count.append(len(passes))
        return done

    monkeypatch.setattr(stepping, "_converged", counted)
    monkeypatch.setattr(stepping, "CONVERGED", 1e-5)
    few, end = passes()
    monkeypatch.setattr(stepping, "anderson_step", lambda before, last: 0.0)
    many, same = passes()
    print(few, many)
    assert few < 0.85 * many
    np.testing.assert_allclose(end.c, same.c, rtol=1e-5)
