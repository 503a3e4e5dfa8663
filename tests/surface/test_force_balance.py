from dataclasses import replace

import numpy as np
import pytest

from amoeboid.closed_forms.linear import base_tension
from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.geometry import area_gradient, geometry, volume, volume_centroid
from amoeboid.meshes.operators import (
    block_matrix,
    normal_blocks,
    normal_projection,
    scalar_matrix,
    stiffness,
    tensile_stiffness,
)
from amoeboid.model.parameters import Parameters
from amoeboid.surface.dissipation import dissipation_blocks, viscous_stress
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.force_balance import (
    NORMAL_VISCOSITY,
    factorized_cortex,
    force_balance,
    normal_force,
    pressure_force,
    tension_force,
    turning_responses,
)
from amoeboid.surface.frame import rigid_motions
from amoeboid.surface.initial import sphere
from amoeboid.surface.model import Model
from surface.shapes import lumpy, observed_orders


@pytest.mark.parametrize(
    "p", [Parameters(), Parameters(alpha=0.2, law="inverse", eta_b=2.0, R0=2.0, delta_P=40.0)]
)
def test_a_homogeneous_sphere_is_at_rest_and_its_tension_converges(p):
    """v_c = -v_p(c0) n, zeta0 = delta_P R0/2 + 2 v_p(c0) (eta_s + eta_b)/R0 + alpha c0."""
    sizes, tension_errors, flows = [], [], []
    for subdivisions in (2, 3, 4):
        model, state = sphere(p, subdivisions)
        flow = flow_of(model, state, 0.1 / model.rate)
        sizes.append(len(state.r))
        tension_errors.append(flow.zeta0 / base_tension(p) - 1)
        flows.append(np.abs(flow.v).max() / p.v_p(p.c0))
        # the discrete equilibrium: no shape motion at all
        v_n = np.einsum("vi,vi->v", flow.v, flow.normals)
        assert np.abs(v_n).max() < 1e-6 * p.v_p(p.c0)
    assert np.all(np.abs(observed_orders(sizes, tension_errors) - 2) < 0.1), tension_errors
    # what flow remains within the surface is the mesh's, small and falling
    assert flows[0] < 3e-3
    assert flows[2] < flows[1] < flows[0]


def test_pressure_balances_tension_on_every_mesh_of_a_sphere():
    """An icosphere as subdivided, with uneven triangles: no node is pushed out of the sphere."""
    r, faces = icosphere(3)
    g = geometry(r, faces)
    pressure, tension = pressure_force(r, g, faces), tension_force(r, g, faces)
    share = np.vdot(pressure, tension) / np.vdot(tension, tension)
    np.testing.assert_allclose(pressure, share * tension, atol=1e-10 * np.abs(pressure).max())


def test_pressure_does_the_work_of_the_volume_and_makes_no_net_force():
    r, mesh = lumpy()
    force = pressure_force(r, geometry(r, mesh.faces), mesh.faces)
    np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-13)
    np.testing.assert_allclose(np.cross(r, force).sum(axis=0), 0, atol=1e-13)
    assert np.vdot(force, r) == pytest.approx(3 * volume(r, mesh.faces), rel=1e-12)


def test_polarized_sphere_moves_its_cortex_as_a_whole():
    """c = c0 + a cos(theta): v_c changes by the uniform -f_1 a e_z, main text `deltavp`."""
    p, a = Parameters(), 1e-3
    exact = -float(p.v_p_derivatives(p.c0, 1)[1]) * a
    for subdivisions in (2, 3, 4):
        model, rest = sphere(p, subdivisions)
        z = rest.r[:, 2] / np.linalg.norm(rest.r, axis=1)
        v = []
        for sign in (1, -1):
            state = type(rest)(0.0, rest.r, rest.c + sign * a * z, rest.zeta0, rest.position)
            v.append(flow_of(model, state, 1.0).v_c)
        change = 0.5 * (v[0] - v[1])
        areas = geometry(rest.r, model.mesh.faces).node_areas
        squares = areas @ (change - [0, 0, exact]) ** 2
        # normals are exact on a sphere, so that this is up to rounding over a, and a squared
        assert np.sqrt(squares.sum() / areas.sum()) < 2e-6 * exact


def test_iterated_solution_satisfies_the_balance_of_its_own_shape():
    """With the factor of another shape: K v_c + zeta0 G = delta_P B + elastic - normal viscosity.

    Built independently. Implicit tension acts on what the step does beyond `ahead`: on nothing
    once that is dt v. What is left over are the forces that keep translation and rotation.
    """
    r, mesh = lumpy()
    p = Parameters(alpha=0.3)
    model = Model(p, mesh)
    dt, zeta0 = 1e-4, 149.0
    g_near = geometry(r, mesh.faces)
    factorized = factorized_cortex(model, r, np.ones(len(r)), g_near, dt, 150.0)
    r = r + 0.02 * np.column_stack([np.sin(3 * r[:, 1]), np.cos(2 * r[:, 2]), r[:, 0] ** 2])
    g = geometry(r, mesh.faces)
    c = 3 + np.sin(r[:, 0])
    v_c, ahead = np.zeros_like(r), np.zeros_like(r)
    for _ in range(300):
        solution = force_balance(model, factorized, r, g, c, zeta0, ahead, v_c)
        v = solution.v(zeta0)
        v_c, ahead = v - solution.v_p, dt * v
    viscous = block_matrix(dissipation_blocks(g, mesh, p.eta_s, p.eta_b), mesh) @ v_c.ravel()
    even = scalar_matrix(stiffness(g_near, mesh), mesh)
    v_n = np.einsum("vi,vi->v", v, g.normals)
    damping = np.einsum("vi,vi->v", g_near.normals, even @ (g_near.normals * v_n[:, None]))
    elastic = np.zeros_like(r)
    for f, corners in enumerate(mesh.faces):
        elastic[corners] += p.alpha * c[corners].mean() * g.face_areas[f] * g.gradients[f]
    pressure = p.delta_P * pressure_force(r, g, mesh.faces)
    forces = (
        zeta0 * normal_force(area_gradient(g, mesh.faces), r, g)
        - pressure
        - elastic
        + NORMAL_VISCOSITY * (p.eta_s + p.eta_b) * damping[:, None] * g_near.normals
    )
    residual = viscous + forces.ravel()
    # a torque over the surface, and what resists translation in `factorized`
    rigid = rigid_motions(lumpy()[0], g_near)
    resisted = factorized.damping + dt * factorized.tension
    stiff = block_matrix(normal_blocks(resisted, g_near.normals, mesh), mesh) @ rigid[:, :3]
    torques = np.repeat(g_near.node_areas, 3)[:, None] * rigid[:, 3:]
    keeping = np.hstack([stiff, torques])
    left = residual - keeping @ np.linalg.lstsq(keeping, residual, rcond=None)[0]
    assert np.abs(left).max() < 1e-6 * np.abs(pressure).max()
    # no rotation of the cortex, no drift of the cell
    rotations = np.repeat(g.node_areas, 3)[:, None] * rigid_motions(r, g)[:, 3:]
    assert np.abs(rotations.T @ v_c.ravel()).max() < 1e-8 * np.abs(v_c).max()
    h = 1e-6
    moved = volume_centroid(r + h * v, mesh.faces) - volume_centroid(r - h * v, mesh.faces)
    assert np.abs(moved).max() / (2 * h) < 1e-3 * np.abs(v).max()


def test_implicit_tension_is_tension_plus_the_tensile_viscous_stress():
    r, mesh = lumpy(subdivisions=1)
    model, g = Model(Parameters(), mesh), geometry(r, mesh.faces)
    v_c = np.random.default_rng(8).normal(size=r.shape)
    factorized = factorized_cortex(model, r, np.ones(len(r)), g, 0.1, 5.0, v_c)
    stress = 5.0 * np.eye(3) + viscous_stress(g, mesh, v_c, 1.0, 1.0)
    expected = normal_projection(tensile_stiffness(g, mesh, stress), g.normals, mesh)
    np.testing.assert_allclose(factorized.tension, expected, rtol=1e-12, atol=1e-12)


def test_normal_force_is_normal_up_to_rigid_parts_and_balanced():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    force = normal_force(area_gradient(g, mesh.faces), r, g)
    rigid = rigid_motions(r, g)
    np.testing.assert_allclose(rigid.T @ force.ravel(), 0, atol=1e-12)
    tangential = force - np.einsum("vi,vi->v", force, g.normals)[:, None] * g.normals
    assert np.linalg.norm(tangential) < 0.02 * np.linalg.norm(force)


def test_the_response_to_tension_solves_the_balance_of_the_factorized_shape():
    """(K + normal resistance) slope = -tension force + what keeps translation and rotation."""
    r, mesh = lumpy()
    p, dt = Parameters(), 0.3
    model, g = Model(p, mesh), geometry(r, mesh.faces)
    factorized = factorized_cortex(model, r, np.ones(len(r)), g, dt, 150.0)
    resisted = normal_blocks(factorized.damping + dt * factorized.tension, g.normals, mesh)
    matrix = block_matrix(dissipation_blocks(g, mesh, p.eta_s, p.eta_b) + resisted, mesh)
    force = normal_force(area_gradient(g, mesh.faces), r, g)
    rigid = rigid_motions(r, g)
    torques = np.repeat(g.node_areas, 3)[:, None] * rigid[:, 3:]
    keeping = np.hstack([matrix @ rigid[:, :3], torques])
    residual = matrix @ factorized.dv_dzeta0.ravel() + force.ravel()
    left = residual - keeping @ np.linalg.lstsq(keeping, residual, rcond=None)[0]
    assert np.abs(left).max() < 1e-6 * np.abs(force).max()
    assert (
        np.abs(torques.T @ factorized.dv_dzeta0.ravel()).max()
        < 1e-9 * np.abs(factorized.dv_dzeta0).max()
    )
    v_n = np.einsum("vi,vi->v", factorized.dv_dzeta0, g.normals)
    drift = (g.node_areas * v_n) @ (r - volume_centroid(r, mesh.faces))
    assert np.abs(drift).max() < 1e-9 * np.abs(v_n).max()


@pytest.mark.parametrize("friction", [{}, {"gamma_c": 0.3, "gamma_n": 0.1}])
def test_responses_to_a_rotating_frame_are_differences_of_force_balances(friction):
    """A frame that rotates faster moves the nodes as the force balance has it."""
    model, state = sphere(Parameters(D=0.4, v_p0=5.0, **friction), 1)
    x = state.r
    state = replace(state, r=x * (1.0, 1.1, 0.9), c=state.c * (1.0 + 0.2 * x[:, 2]))
    g = geometry(state.r, model.mesh.faces)
    factorized = factorized_cortex(model, state.r, state.c, g, 0.5, 300.0)
    v_c = 0.1 * np.cross((0.3, 0.2, -0.5), state.r)
    turning = np.array([0.2, 0.0, -0.1])

    def v(omega):
        return force_balance(
            model, factorized, state.r, g, state.c, 300.0, v_c=v_c, turning=omega
        ).v(300.0)

    found = turning_responses(model, factorized, state.r, g, state.c, v_c, turning)
    expected = np.stack([v(turning + axis) - v(turning) for axis in np.eye(3)])
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
