"""Observables of states that are known exactly."""

from dataclasses import replace

import numpy as np
import pytest

import amoeboid
from amoeboid.axisymmetric.evolution import Dynamics, perturbed_sphere
from amoeboid.axisymmetric.evolution import evolve as evolve_axisymmetric
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.spectral import even_basis, grid, odd_basis
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.unknowns import fields_of
from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.extrema import DEGREE, REACH, RINGS, fitted_maxima, largest
from amoeboid.meshes.geometry import geometry
from amoeboid.model.parameters import Parameters
from amoeboid.observables import (
    OBSERVABLES,
    c_front,
    c_rear,
    cortex_drag_heading,
    cortex_drag_speed,
    cortex_drag_velocity,
    deformation,
    filament_number,
    max_retrograde_speed,
    mesh_quality,
    observed,
    polarity,
    reduced_volume,
    retrograde_flow,
    units,
)
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.initial import sphere
from amoeboid.surface.state import Flow
from surface.shapes import lumpy


@pytest.fixture(scope="module")
def cell():
    model, state = sphere(Parameters(), 3)
    unit = state.r / np.linalg.norm(state.r, axis=1, keepdims=True)
    return model, state, unit


def flow_with(v, state, unit, model):
    areas = np.full(len(unit), model.A0 / len(unit))
    return Flow(v, 0 * v, state.zeta0, unit, areas)


def test_retrograde_flow_is_that_of_the_frame_of_the_cell(cell):
    """A sphere that translates does not flow; a tangential flow does not depend on the frame."""
    model, state, unit = cell
    along = np.array([0.3, -0.2, 0.5])
    translating = flow_with(np.broadcast_to(along, unit.shape), state, unit, model)
    resting = SurfaceCell(model, state, translating)
    assert max_retrograde_speed(resting) < 0.01 * np.linalg.norm(along)
    tangential = 0.7 * (np.array([0, 0, 1.0]) - unit[:, 2:] * unit)
    for shift in (np.zeros(3), along):
        flow = flow_with(tangential + shift, state, unit, model)
        assert max_retrograde_speed(SurfaceCell(model, state, flow)) == pytest.approx(0.7, rel=0.01)
        found = retrograde_flow(SurfaceCell(model, state, flow))
        np.testing.assert_allclose(np.einsum("vi,vi->v", found, unit), 0, atol=1e-12)


def test_with_drag_on_the_cortex_a_cell_moves_as_its_shape_moves_against_its_cortex(cell):
    """Known motions: whatever the frame of the nodes, the cortex stays behind."""
    model, state, unit = cell
    areas = np.full(len(unit), model.A0 / len(unit))
    along = np.array([0.3, -0.2, 0.5])
    size = np.linalg.norm(along)
    for frame in (np.zeros(3), np.array([1.0, 2.0, -3.0])):
        v_c = np.broadcast_to(frame, unit.shape)
        v_p = (unit @ along)[:, None] * unit  # moves the sphere by `along`
        flow = Flow(v_c, v_p, state.zeta0, unit, areas)
        # the moments of 642 nodes are off by 1 to 2 %
        np.testing.assert_allclose(
            cortex_drag_velocity(SurfaceCell(model, state, flow)), along, atol=0.02 * size
        )
        np.testing.assert_allclose(
            cortex_drag_heading(SurfaceCell(model, state, flow)), along / size, atol=0.02
        )
        assert np.linalg.norm(
            cortex_drag_heading(SurfaceCell(model, state, flow))
        ) == pytest.approx(1.0, rel=1e-14)
        speed = cortex_drag_speed(SurfaceCell(model, state, flow))
        assert speed == pytest.approx(size, rel=0.02)
        row = observed(SurfaceCell(model, state, flow), ["cortex_drag_heading"])
        np.testing.assert_array_equal(
            list(row.values()), cortex_drag_heading(SurfaceCell(model, state, flow))
        )
        assert list(row) == [f"cortex_drag_heading_{axis}" for axis in "xyz"]
    carried = Flow(np.broadcast_to(along, unit.shape), 0 * unit, state.zeta0, unit, areas)
    assert cortex_drag_speed(SurfaceCell(model, state, carried)) < 0.02 * size
    resting = flow_with(0 * unit, state, unit, model)
    assert np.array_equal(cortex_drag_heading(SurfaceCell(model, state, resting)), np.zeros(3))


def test_one_noisy_node_does_not_decide_the_speed(cell):
    model, state, unit = cell
    tangential = 0.7 * (np.array([0, 0, 1.0]) - unit[:, 2:] * unit)
    five = int(np.argmin(model.mesh.valence + np.abs(unit[:, 2])))
    tangential[five] *= 1.2
    flow = flow_with(tangential, state, unit, model)
    excess = np.linalg.norm(tangential, axis=1).max() - 0.7
    assert excess > 0.05
    assert abs(max_retrograde_speed(SurfaceCell(model, state, flow)) - 0.7) < 0.45 * excess


@pytest.mark.parametrize("direction", [(0, 0, 1), (0.3, -0.5, 0.8), (1, 0.1, 0)])
def test_poles_are_found_between_the_nodes(cell, direction):
    model, state, unit = cell
    x = unit @ (np.array(direction) / np.linalg.norm(direction))
    peaked = replace(state, c=3 + x + x**2)
    flow = flow_with(0 * unit, state, unit, model)
    assert c_rear(SurfaceCell(model, peaked, flow)) == pytest.approx(5, rel=2e-3)
    assert c_front(SurfaceCell(model, replace(state, c=3 - x - x**2), flow)) == pytest.approx(
        1, rel=5e-3
    )
    # cos(theta) in c: integral of c r is 4 pi/3, of c 12 pi + 4 pi/3
    found = polarity(SurfaceCell(model, peaked, flow))
    assert found == pytest.approx((1 / 3) / (3 + 1 / 3), rel=0.01)


def test_an_empty_front_is_not_below_zero(cell):
    model, state, unit = cell
    flow = flow_with(0 * unit, state, unit, model)
    for shift in (0.0, 1e-3):
        c = np.maximum(0, 3 + 3 * unit @ [0.1, 0.2, np.sqrt(0.95)] - shift)
        assert c_front(SurfaceCell(model, replace(state, c=c), flow)) >= 0


def test_a_homogeneous_sphere_has_none_of_it(cell):
    model, state, unit = cell
    found = observed(SurfaceCell(model, state, flow_with(0 * unit, state, unit, model)))
    assert list(found) == list(units())
    assert found["max_retrograde_speed"] < 1e-12
    assert found["polarity"] < 1e-10
    assert found["c_front"] == found["c_rear"] == 3.0
    assert found["area_error"] < 1e-12


def test_shape_and_content_of_an_ellipsoid(cell):
    model, state, unit = cell
    stretched = replace(state, r=state.r * [1, 1, 1.5])
    flow = flow_with(0 * unit, state, unit, model)
    e = np.sqrt(1 - 1 / 1.5**2)
    R = np.sqrt(0.5 * (1 + 1.5 / e * np.arcsin(e)))  # that of the sphere of the same area
    assert deformation(SurfaceCell(model, stretched, flow)) == pytest.approx(1.5 / R - 1, rel=1e-3)
    rest, long = SurfaceCell(model, state, flow), SurfaceCell(model, stretched, flow)
    assert deformation(rest) < 1e-4  # although the nodes are 0.2 % outside
    volume_ratio = reduced_volume(long) / reduced_volume(rest)
    assert volume_ratio == pytest.approx(1.5, rel=1e-12)
    assert filament_number(rest) == pytest.approx(3 * model.A0, rel=1e-12)
    assert 0 < mesh_quality(long) < mesh_quality(rest) <= 1


def fitted_polynomial(mesh, r, normals, values, i):
    """The polynomial fitted around node i to three rings, spelled out, at plane coordinates."""
    patch = np.array([i])
    for _ in range(RINGS):
        patch = np.unique(mesh.columns[np.isin(mesh.rows, patch)])
    n = normals[i]
    first = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    first /= np.linalg.norm(first)
    plane = (r[patch] - r[i]) @ np.column_stack([first, np.cross(n, first)])
    plane /= np.linalg.norm(plane, axis=1).max()
    weights = np.exp(-np.sum(plane**2, axis=1))
    powers = [(d - q, q) for d in range(DEGREE + 1) for q in range(d + 1)]
    basis = np.column_stack([plane[:, 0] ** p * plane[:, 1] ** q for p, q in powers])
    k = np.linalg.lstsq(basis * weights[:, None], weights * values[patch], rcond=None)[0]
    return lambda x, y: sum(a * x**p * y**q for a, (p, q) in zip(k, powers, strict=True))


def test_maxima_are_those_of_fitted_polynomials():
    r, mesh = lumpy(3)
    normals = geometry(r, mesh.faces).normals
    values = np.sin(3 * r[:, 0]) + np.cos(2 * r[:, 1] + r[:, 2])
    nodes = largest(values, 6)
    found = fitted_maxima(nodes, mesh.row_start, mesh.columns, r, normals, values)
    radius, angle = np.meshgrid(np.linspace(0, REACH, 201), np.linspace(0, 2 * np.pi, 361))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    for i, value in zip(nodes, found, strict=True):
        fitted = fitted_polynomial(mesh, r, normals, values, i)
        assert fitted(0.0, 0.0) <= value
        assert value == pytest.approx(fitted(x, y).max(), abs=1e-4)


def test_a_climb_never_ends_lower_than_it_began():
    """Through noise the polynomials are so steep that steps of Newton's method overshoot."""
    r, mesh = lumpy(3)
    normals = geometry(r, mesh.faces).normals
    values, nodes = np.random.default_rng(1).normal(size=len(r)), np.arange(len(r))
    found = fitted_maxima(nodes, mesh.row_start, mesh.columns, r, normals, values)
    for i, value in zip(nodes, found, strict=True):
        assert value > fitted_polynomial(mesh, r, normals, values, i)(0.0, 0.0) - 1e-12


def test_few_nodes_give_a_fit_of_lower_degree():
    """Four nodes determine a + b x + c y + d x^2, the first four powers, exactly."""
    r = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    mesh = connectivity(np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
    normals, nodes = r / np.sqrt(3), np.arange(4)

    def largest_of_interpolant(i, values):
        first = np.cross(normals[i], np.eye(3)[np.argmin(np.abs(normals[i]))])
        first /= np.linalg.norm(first)
        plane = (r - r[i]) @ np.column_stack([first, np.cross(normals[i], first)])
        plane /= np.linalg.norm(plane, axis=1).max()
        x, y = plane.T
        a, b, c, d = np.linalg.solve(np.column_stack([np.ones(4), x, y, x * x]), values)
        radius, angle = np.meshgrid(np.linspace(0, REACH, 101), np.linspace(0, 2 * np.pi, 721))
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        return (a + b * x + c * y + d * x * x).max()

    for values in np.eye(4):
        found = fitted_maxima(nodes, mesh.row_start, mesh.columns, r, normals, values)
        exact = [largest_of_interpolant(i, values) for i in nodes]
        np.testing.assert_allclose(found, exact, rtol=1e-12)
    alike = fitted_maxima(nodes, mesh.row_start, mesh.columns, r, normals, np.full(4, 2.0))
    np.testing.assert_allclose(alike, 2.0, rtol=1e-14)


@pytest.mark.parametrize("along", [(0.0, 0.0, 1.0), (0.0, 1.0, (1 + 5**0.5) / 2), (0.3, -0.5, 0.8)])
def test_the_speed_of_an_exact_flow_is_found_to_high_order(along):
    """u = sin(theta) (1 + cos(theta)/2), wherever its ring of maxima passes the nodes."""
    axis = np.array(along) / np.linalg.norm(along)
    theta = np.linspace(0, np.pi, 200_001)
    exact = np.max(np.sin(theta) * (1 + 0.5 * np.cos(theta)))
    errors = []
    for subdivisions in (2, 3, 4):
        model, state = sphere(Parameters(), subdivisions)
        unit = state.r / np.linalg.norm(state.r, axis=1, keepdims=True)
        cosine = unit @ axis
        v = (axis - cosine[:, None] * unit) * (1 + 0.5 * cosine)[:, None]
        found = max_retrograde_speed(SurfaceCell(model, state, flow_with(v, state, unit, model)))
        errors.append(abs(found / exact - 1))
    print(along, errors)
    assert np.all(np.array(errors) < [2e-3, 5e-5, 4e-6])


def test_on_a_rim_the_mesh_does_not_resolve_no_maximum_is_beyond_measure():
    """A flat disk: three rings around its rim fold into one plane, where polynomials may swing."""
    model, rest = sphere(Parameters(), 3)
    r, mesh = rest.r * [2.0, 2.0, 0.15], model.mesh
    x = r[:, 0] / np.abs(r[:, 0]).max()
    values = (1.0 + x) ** 2
    nodes = np.argsort(-values)[:12]
    normals = geometry(r, mesh.faces).normals
    found = fitted_maxima(nodes, mesh.row_start, mesh.columns, r, normals, values)
    assert 3.9 < found.max() < 5.2


def test_the_largest_values_come_first_and_ties_in_order():
    values = np.random.default_rng(0).integers(0, 8, 200).astype(float)
    expected = np.argsort(-values, kind="stable")
    for count in (1, 24, 200, 300):
        assert np.array_equal(largest(values, count), expected[:count])


def sampled(state, subdivisions):
    """The exact axisymmetric state, steady or an instant, on the nodes of a sphere's mesh."""
    p = state.parameters
    model, rest = sphere(p, subdivisions)
    unit = rest.r / np.linalg.norm(rest.r, axis=1, keepdims=True)
    theta, phi = np.arccos(np.clip(unit[:, 2], -1, 1)), np.arctan2(unit[:, 1], unit[:, 0])
    guess = state if isinstance(state, SteadySolution) else state.as_guess()
    fields = fields_of(guess.x, guess.n)
    # radius and height along the scaled arclength theta, whose pole 0 looks up
    radius, height = guess.position(theta)
    out = np.column_stack([np.cos(phi), np.sin(phi), 0 * phi])
    up = np.array([0.0, 0.0, 1.0])
    r = radius[:, None] * out + height[:, None] * up
    modes = grid(guess.n)
    psi = theta + odd_basis(theta, guess.n) @ (modes.to_odd @ (fields.psi - modes.x))
    along = np.cos(psi)[:, None] * out - np.sin(psi)[:, None] * up
    normals = np.sin(psi)[:, None] * out + np.cos(psi)[:, None] * up
    u, V = guess.flow(theta), np.zeros_like(theta)
    if not isinstance(state, SteadySolution):
        sines, cosines = force_balance_velocities(state)
        u, V = odd_basis(theta, guess.n) @ sines, even_basis(theta, guess.n) @ cosines
    # any frame; the cell is turned, so that nothing depends on the axis of the mesh
    v = u[:, None] * along + V[:, None] * normals + [0.3, -0.7, 0.2]
    c = guess.concentration(theta)
    v_p = p.v_p(c)[:, None] * normals
    g = geometry(r, model.mesh.faces)
    there = replace(rest, r=r, c=c, zeta0=state.zeta0)
    return model, there, Flow(v - v_p, v_p, state.zeta0, g.normals, g.node_areas)


def force_balance_velocities(instant):
    """Coefficients of the tangential and normal velocity in the frame of the force balance."""
    dynamics = Dynamics(instant.parameters, instant.n)
    s, c, _ = dynamics.closed(instant.y)
    q, g = dynamics._velocities((s, c, None)), s.grid
    return q[: g.n], q[g.n : 2 * g.n] + g.to_even @ instant.parameters.v_p(c)


def axisymmetric_states():
    soft, softest = Parameters(D=0.4, v_p0=6.0, delta_P=11.0), Parameters(D=0.4, v_p0=5.4)
    polarized = max(steady_solutions(soft, (1,)), key=lambda s: s.max_retrograde_speed)
    y = perturbed_sphere(softest, {1: 1.0, 2: 0.5}, {2: 0.2, 3: 0.15})
    *_, moving = evolve_axisymmetric(softest.replace(delta_P=2.0), y, 0.1)
    return polarized, moving


def test_all_solvers_define_each_observable_alike():
    """Exact axisymmetric cells, one steady, one on its way, on meshes: the difference is O(h^2)."""
    names = [name for name, known in OBSERVABLES.items() if not known.on_meshes]
    for state in axisymmetric_states():
        errors = {}
        for subdivisions in (2, 3, 4):
            found = observed(SurfaceCell(*sampled(state, subdivisions)))
            for name in names:
                exact = getattr(state, name)
                scale = exact if exact > 1e-6 else 1.0
                errors.setdefault(name, []).append(abs(found[name] - exact) / scale)
        assert list(errors) == names
        for name, values in errors.items():
            print(f"{name:22}", [f"{x:.1e}" for x in values])
            assert values[-1] < 5e-3, name
            assert values[-1] < 1e-6 or np.log2(values[0] / values[-1]) > 2 * 1.7, name


def test_a_cell_without_filaments_has_no_polarity():
    p = Parameters(c0=0.0, D=0.4)
    (state,) = amoeboid.steady_states(p)
    assert (state.polarity, state.filament_number) == (0.0, 0.0)
