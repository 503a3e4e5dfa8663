"""Friction, contractility and bending on meshes against the axisymmetric solver and the theory."""

from functools import cache

import numpy as np
import pytest

import amoeboid as am
from amoeboid.axisymmetric.steady import steady_state
from amoeboid.closed_forms.linear import growth_rate
from amoeboid.forces import friction
from amoeboid.meshes.geometry import geometry
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.explicit import constrained_flow
from amoeboid.surface.model import Model
from amoeboid.surface.stability import leading_growth_rate
from amoeboid.surface.state import State
from surface.shapes import lumpy, observed_orders, sphere

P = am.Parameters(D=0.4, v_p0=6.0)
GRIP = {"gamma_t": 0.6, "gamma_n": 0.9, "gamma_c": 0.3, "gamma_share": 0.7}
SHOWN = ("max_retrograde_speed", "c_rear", "zeta0", "polarity")


@cache
def axisymmetric(**forces):
    free = am.steady_states(P).fastest_stable.solution
    return steady_state(P.replace(**forces), free)


def numbers(cell):
    moved = np.linalg.norm(friction.velocity(cell.cell))
    return np.array([*(getattr(cell, name) for name in SHOWN), moved])


def on_mesh(subdivisions, **forces):
    return am.simulate(P.replace(**forces), mesh=am.Icosphere(subdivisions), until=am.steady())


@pytest.mark.parametrize(
    "forces",
    [
        pytest.param({"gamma_t": 1.0, "gamma_n": 1.0}, marks=pytest.mark.slow),
        pytest.param(GRIP, marks=pytest.mark.slow),
        GRIP | {"kappa": 1.0},
    ],
)
def test_cell_with_friction_on_a_mesh_is_the_axisymmetric_one(forces):
    """42 and 162 nodes; the errors are those without friction, 6 and 1.5 % at most."""
    exact = numbers(axisymmetric(**forces))
    errors = np.array([numbers(on_mesh(n, **forces).final) / exact - 1 for n in (1, 2)])
    print(errors)
    assert np.abs(errors[0]).max() < 0.1
    assert np.abs(errors[1]).max() < 0.017


@pytest.mark.slow
def test_cell_with_friction_on_a_mesh_is_of_second_order():
    exact = numbers(axisymmetric(**GRIP))
    found = [numbers(am.steady_state(P.replace(**GRIP), mesh=am.Icosphere(n))) for n in (2, 3, 4)]
    gaps = np.array(found) / exact - 1
    print(gaps, [observed_orders((162, 642, 2562), gap) for gap in gaps.T])
    for gap in gaps.T:
        assert observed_orders((642, 2562), gap[1:]) == pytest.approx([2.0], abs=0.2)


def test_weak_friction_leaves_the_run_as_it_is():
    """1e-5: the state differs by 1e-5 from that of a free cell on the same mesh."""
    free, weak = on_mesh(1).final, on_mesh(1, gamma_c=1e-5).final
    for name in SHOWN:
        assert getattr(weak, name) == pytest.approx(getattr(free, name), rel=2e-4)
    moved = np.linalg.norm(friction.velocity(weak.cell))
    assert moved == pytest.approx(free.cortex_drag_speed, rel=2e-4)


@pytest.mark.parametrize(
    "gamma_n", [1.0, *(pytest.param(one, marks=pytest.mark.slow) for one in (1e-9, 1e6))]
)
def test_a_cell_that_slips_without_friction_does_not_turn(gamma_n):
    """Friction along the normal alone holds a round cell, with the flow of one that hardly grips.

    A run without any grip did not get along: its first steps turned the cell.
    """
    p = P.replace(gamma_n=gamma_n)
    run, grips = (
        am.simulate(one, mesh=am.Icosphere(1), until=am.time(0.5))
        for one in (p, p.replace(gamma_t=1e-3 * min(gamma_n, 1.0)))
    )
    assert len(run) < 30
    speed = grips.final.max_retrograde_speed
    assert run.final.max_retrograde_speed == pytest.approx(speed, rel=5e-3)  # 12 to 16 steps
    assert np.linalg.norm(friction.velocity(run.final.cell)) < 1e-4


def test_velocity_is_that_of_a_migration_in_the_same_surroundings():
    """Of an axisymmetric state, and of the state of a run, which is steady up to 1e-4."""
    forces = {"gamma_t": 0.6, "gamma_n": 0.9, "gamma_c": 0.3}
    own = am.Mixed(am.Matrix(0.6, 0.9), am.CortexDrag(0.3))
    state = axisymmetric(**forces)
    speed = np.linalg.norm(friction.velocity(state.cell))
    assert am.migrate(state, own).speed == pytest.approx(speed, rel=1e-9)
    run = on_mesh(1, **forces)
    speed = np.linalg.norm(friction.velocity(run.final.cell))
    assert am.migrate(run.final, own).speed == pytest.approx(speed, rel=1e-3)


def test_explicit_and_implicit_scheme_agree_on_the_flow_with_friction():
    """On one deformed cell; tension and stress keep their tangential errors in the former."""
    r, mesh = lumpy(2)
    g = geometry(r, mesh.faces)
    p = P.replace(**GRIP, R0=float(np.sqrt(g.area / (4 * np.pi))))
    model = Model(p, mesh)
    c = p.c0 * (1 + 0.3 * r[:, 2])
    state = State(0.0, r, c, 0.0, np.zeros(3))
    flow = flow_of(model, state, 1e-6)
    v_c, _ = constrained_flow(model, state, g, flow.v_p, 1.0, np.zeros_like(r))
    difference = v_c - (flow.v_c - g.node_areas @ flow.v_c / g.area)
    assert np.sqrt(np.mean(difference**2) / np.mean(v_c**2)) < 0.05


def resting(p, subdivisions):
    r, mesh = sphere(subdivisions)
    model = Model(p, mesh)
    r = r * np.sqrt(model.A0 / geometry(r, mesh.faces).area)
    state = State(0.0, r, np.full(len(r), p.c0), 150.0, np.zeros(3))
    return model, state, flow_of(model, state, 1e-2)


@pytest.mark.parametrize(
    "forces", [GRIP, {"gamma_t": 2.0, "gamma_n": 2.0, "chi": 0.1}, {"chi": 0.2, "kappa": 0.5}]
)
def test_growth_of_a_polarization_converges_to_the_theory(forces):
    p = am.Parameters(v_p0=3.7, **forces)
    exact = float(growth_rate(p, 1))
    errors = [leading_growth_rate(*resting(p, n), 1.0, 1e-6, 1e-4).rate - exact for n in (1, 2)]
    print(exact, errors)
    assert abs(errors[1]) < 0.04 * (1 + abs(exact))
    assert abs(errors[1]) < abs(errors[0]) / 2.5


def test_steady_solver_finds_the_state_of_the_run_with_friction():
    run = on_mesh(1, **GRIP).final
    cell = am.steady_state(P.replace(**GRIP), start=run)
    assert numbers(cell) == pytest.approx(numbers(run), rel=1e-4)
    assert float(cell.growth_rate) < 0
    np.testing.assert_array_equal(cell.velocity, friction.velocity(cell.cell))
    assert np.linalg.norm(cell.velocity) < 0.8 * cell.cortex_drag_speed
