"""Steady cells by accelerated iterations: those of runs, of other solvers, and their branches."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import amoeboid as am
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.geometry import area
from amoeboid.numerics.acceleration import Acceleration
from amoeboid.surface import steady as steady_module
from amoeboid.surface.relative_equilibrium import ImplicitMap, Moving
from amoeboid.surface.steadiness import relative_rate
from amoeboid.surface.steady import NotSteady, around, steady_cell
from surface.shapes import observed_orders

STIFF = am.Parameters(D=0.4, v_p0=6.0)
SOFT = am.Parameters(D=0.4, v_p0=6.0, delta_P=11.0)
TURNS = am.Parameters(D=0.4, v_p0=8.0, delta_P=20.0)
SHOWN = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "cortex_drag_speed", "polarity")


@cache
def straight(p):
    return am.steady_states(p, (1,)).fastest_stable


@cache
def steady(p, subdivisions):
    return am.steady_state(p, mesh=am.Icosphere(subdivisions), start=straight(p))


def values(cell):
    return np.array([cell.number(name) for name in SHOWN])


@pytest.mark.parametrize("p", [STIFF, SOFT], ids=["stiff", "soft"])
def test_the_steady_cell_does_not_change_in_a_run(p):
    """The force balance, the transport and the area of the time step hold in it."""
    cell = steady(p, 2)
    rate, _ = relative_rate(cell.model, cell.state, cell.flow)
    assert rate < 2e-7
    assert cell.residual < 2e-7
    assert abs(area(cell.state.r, cell.faces) / cell.model.A0 - 1.0) < 1e-12
    run = am.simulate(p, initial=cell, until=am.time(0.5))
    # nodes drift within the surface there
    assert np.abs(run["max_retrograde_speed"] / cell.max_retrograde_speed - 1.0).max() < 2e-3


def test_the_steady_cell_is_that_of_a_run():
    run = am.simulate(STIFF, mesh=am.Icosphere(2))
    cell = am.steady_state(STIFF, start=run.final)
    found, expected = values(cell), np.array([run.final.cell and run[n][-1] for n in SHOWN])
    print(found / expected - 1.0)
    assert np.abs(found / expected - 1.0).max() < 1e-4
    assert cell.iterations < 12


def test_the_steady_cell_depends_neither_on_the_base_nor_on_the_step():
    cell = steady(SOFT, 1)
    guess = Moving(cell.state.r, cell.state.c, cell.state.zeta0, 0.0 * cell.state.r, np.zeros(3))
    model = replace(cell.model, parameters=replace(SOFT, v_p0=6.2))
    far = steady_cell(model, guess)
    near = steady_cell(model, far.cell)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steady_module, "STEP", 1.0)
        longer = steady_cell(model, far.cell)
    for other in (near, longer):
        assert np.abs(other.cell.c - far.cell.c).max() < 1e-5 * far.cell.c.max()
        assert np.abs(other.cell.zeta0 / far.cell.zeta0 - 1.0) < 1e-6


def test_the_steady_cell_turns_with_its_start_off_the_axes_of_the_mesh():
    cell = steady(STIFF, 2)
    axes = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    axes *= np.linalg.det(axes)
    turned = InitialCell(cell.state.r @ axes.T, cell.faces, cell.state.c, cell.state.zeta0)
    other = am.steady_state(STIFF, start=turned)
    assert np.abs(other.velocity - axes @ cell.velocity).max() < 1e-6
    assert np.abs(values(other) / values(cell) - 1.0).max() < 1e-5


def test_a_cell_on_nodes_in_no_relation_to_its_axis_is_found():
    """The concentration is carried to the nodes of the mesh as they lie, the axis at an angle."""
    mesh, p = am.Icosphere(2), STIFF
    sphere = steady(STIFF, 2)
    x = sphere.state.r / np.linalg.norm(sphere.state.r, axis=1)[:, None]
    axis = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
    run = am.simulate(p, mesh=mesh, initial=am.Initial(direction=tuple(axis)), until=am.time(4.0))
    cell = am.steady_state(p, start=run.final)
    assert len(x) == len(cell.state.r)
    assert abs(cell.velocity @ axis) > 0.999 * np.linalg.norm(cell.velocity)
    # the error of 162 nodes
    assert np.abs(values(cell) / values(sphere) - 1.0).max() < 0.02


@pytest.mark.slow
def test_steady_cells_converge_at_second_order_to_the_axisymmetric_state():
    exact = straight(STIFF)
    errors = [
        [steady(STIFF, n).number(name) / exact.number(name) - 1.0 for name in SHOWN[:4]]
        for n in (3, 4, 5)
    ]
    orders = [observed_orders((642, 2562, 10242), column) for column in np.transpose(errors)]
    print(errors, orders)
    assert np.abs(np.array(orders) - 2.0).max() < 0.1


def test_no_wrong_state_is_given_without_a_sign():
    cell = steady(STIFF, 2)
    with pytest.raises(am.InvalidInput, match="and this one is not"):
        am.steady_state(replace(STIFF, v_p0=4.0), start=cell)
    # a weak polarization, at a speed where it decays
    x = cell.state.r[:, 2] / STIFF.R0
    weak = InitialCell(cell.state.r, cell.faces, 5.0 + x, cell.state.zeta0)
    with pytest.raises(am.InvalidInput, match="the homogeneous cell"):
        am.steady_state(replace(STIFF, v_p0=4.0, c0=5.0), start=weak)
    with pytest.raises(am.InvalidInput, match="start must be"):
        am.steady_state(STIFF, start=3)
    with pytest.raises(am.InvalidInput, match="mesh must be left out"):
        am.steady_state(STIFF, start=cell, mesh=am.Icosphere(2))


@pytest.mark.parametrize("beta", [0.0, 1e-9])
def test_without_turnover_the_filament_number_is_that_of_the_sphere(beta):
    """That of the parameters, not of the start."""
    p = replace(STIFF, beta=beta, v_p0=3.0)
    cell = am.steady_state(p, mesh=am.Icosphere(2), start=straight(replace(p, beta=0.0)))
    assert cell.number("filament_number") == pytest.approx(p.c0 * cell.model.A0, rel=1e-7)
    more = InitialCell(cell.state.r, cell.faces, 1.2 * cell.state.c, cell.state.zeta0)
    other = am.steady_state(p, start=more)
    # but for the place of the nodes: 1 % of the smallest number, where the other start has 20 %
    assert np.abs(values(other) / values(cell) - 1.0).max() < 0.015


@pytest.mark.parametrize("factor", [np.nan, -1.0, 0.0])
def test_a_start_without_a_concentration_is_refused(factor):
    cell = steady(STIFF, 1)
    start = InitialCell(cell.state.r, cell.faces, factor * cell.state.c, cell.state.zeta0)
    with pytest.raises(am.InvalidInput, match="concentration >= 0, not 0 everywhere"):
        am.steady_state(STIFF, start=start)


def test_a_sphere_is_not_given_where_polarized_states_may_be_missing():
    p = replace(STIFF, law="inverse")
    assert am.steady_states(p, (1,)).problems
    with pytest.raises(am.InvalidInput, match="no polarized axisymmetric state was found"):
        am.steady_state(p, mesh=am.Icosphere(1))


def test_a_straight_cell_that_its_mesh_turns_is_on_no_circle():
    """At an angle to the axes of 42 nodes it turns by 0.0035; on 642 by some 0.0002."""
    initial = am.Initial(direction=(0.3, 0.5, 0.8))
    run = am.simulate(STIFF, mesh=am.Icosphere(1), initial=initial, until=am.time(8.0))
    cell = am.steady_state(STIFF, start=run.final)
    print(cell.turning)
    assert cell.turning > 1e-3
    assert (cell.path, cell.radius_of_curvature) == ("straight", np.inf)


def test_the_cue_of_a_run_acts_on_the_steady_cell_of_its_end():
    """It moves along the cue; nothing holds a cell that no cue acts on."""
    cue = am.Cue(strength=0.1, direction=(1.0, 0.0, 0.3))
    run = am.simulate(STIFF, mesh=am.Icosphere(1), cue=cue, until=[am.steady(), am.time(40.0)])
    cell = am.steady_state(run.parameters, start=run.final)
    assert cell.c_rear == pytest.approx(run.final.c_rear, rel=1e-5)
    assert cell.stability == "stable"
    # of a neighbour, too
    assert am.steady_state(run.parameters.replace(v_p0=6.2), start=cell).model.cue == cue


def test_an_iteration_that_does_not_converge_is_refused(monkeypatch):
    cell = steady(STIFF, 1)
    monkeypatch.setattr(steady_module, "MAX_ITERATIONS", 3)
    with pytest.raises(am.InvalidInput, match="does not converge"):
        am.steady_state(replace(STIFF, v_p0=7.0), start=cell)
    monkeypatch.setattr(steady_module, "MAX_CHANGE", 1e-3)
    with pytest.raises(am.InvalidInput, match="diverges"):
        am.steady_state(replace(STIFF, v_p0=7.0), start=cell)


def test_a_start_that_is_no_surface_of_a_cell_is_refused():
    model = steady(STIFF, 1).model
    flat = steady(STIFF, 1).state.r * (1.0, 1.0, 1e-3)
    with pytest.raises(NotSteady):
        around(model, Moving(flat, np.ones(42), 150.0, 0.0 * flat, np.zeros(3)))


def test_acceleration_solves_linear_equations_in_as_many_steps_as_they_have_eigenvalues():
    """Those above 1, in which the iteration itself diverges, included."""
    factors = np.array([3.0, -2.0, 0.5, 0.9, 0.9])
    next_of, z = Acceleration(8, 5), np.zeros(6)
    for _ in range(6):
        g = np.append(factors * z[:5] + 1.0, z[:5].sum())
        z = next_of(z, g)
    assert np.abs(z[:5] - 1.0 / (1.0 - factors)).max() < 1e-6


def test_rigid_motions_of_a_cell_do_not_move_the_iteration():
    """Three translations and two rotations are excluded: what is left has one solution."""
    cell = steady(STIFF, 2)
    base = Moving(cell.state.r, cell.state.c, cell.state.zeta0, cell.flow.v_c, np.zeros(3))
    iteration = ImplicitMap(cell.model, base, 0.5)
    assert iteration._excluded.shape[1] == 5
    z = iteration.vector(base)
    n = 2 * iteration.n
    moved = iteration.image(z)[:n] - z[:n]
    assert np.abs(iteration._excluded.T @ moved).max() < 1e-12
    kept = iteration._excluded.T @ iteration._excluded
    assert np.abs(kept - np.eye(5)).max() < 1e-12
