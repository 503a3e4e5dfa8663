"""The bending force on triangle meshes: exact derivative, spheres, order of convergence."""

import numpy as np
import pytest
from numpy.polynomial import legendre

import amoeboid as am
from amoeboid.closed_forms.linear import finite_pressure_rates
from amoeboid.meshes.bending import (
    BendingStiffness,
    TwoRings,
    bending_energy,
    bending_gradient,
    curvature_vectors,
)
from amoeboid.meshes.geometry import geometry
from amoeboid.meshes.operators import (
    normal_blocks,
    normal_projection,
    product,
    scalar_matrix,
    stiffness,
)
from amoeboid.surface.dissipation import viscous_forces
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.force_balance import NORMAL_VISCOSITY, bending_force
from amoeboid.surface.model import Model
from amoeboid.surface.stability import leading_growth_rate
from amoeboid.surface.state import State
from surface.shapes import lumpy, observed_orders, sphere

SHAPE = np.array([1.0, 0.0, 0.2, 0.1, 0.0])


def energy(coefficients):
    """Half the integral of H^2 over r = sum of coefficients times P_l, and its derivatives."""
    x, weights = legendre.leggauss(120)
    s = np.sqrt(1 - x * x)

    def at(c):
        R, slope = legendre.legval(x, c), legendre.legval(x, legendre.legder(c))
        R_t, R_tt = -s * slope, s * s * legendre.legval(x, legendre.legder(c, 2)) - x * slope
        squared = R * R + R_t * R_t
        k1 = (R * R + 2 * R_t * R_t - R * R_tt) / squared**1.5
        k2 = (R - R_t * x / s) / (R * np.sqrt(squared))
        return np.pi * np.sum(weights * (k1 + k2) ** 2 * R * np.sqrt(squared))

    steps = 1e-20j * np.eye(len(coefficients))
    return at(coefficients).real, np.array([at(coefficients + e).imag for e in steps]) * 1e20


def test_gradient_is_the_derivative_of_the_energy():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    found = bending_gradient(r, g, mesh.faces, curvature_vectors(g, mesh.faces))
    direction = np.random.default_rng(0).normal(size=r.shape)
    sides = [
        bending_energy(geometry(r + k * direction, mesh.faces), mesh.faces) for k in (-1e-6, 1e-6)
    ]
    assert np.vdot(found, direction) == pytest.approx((sides[1] - sides[0]) / 2e-6, rel=1e-6)
    # the energy depends neither on place, nor orientation, nor size
    assert np.abs(found.sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(r, found).sum(axis=0)).max() < 1e-12
    assert abs(np.vdot(found, r)) < 1e-11


@pytest.mark.parametrize("subdivisions", [1, 2])
def test_bending_exerts_no_force_on_a_sphere(subdivisions):
    r, mesh = sphere(subdivisions)
    g = geometry(1.7 * r, mesh.faces)
    assert np.abs(bending_gradient(1.7 * r, g, mesh.faces)).max() < 1e-12


def test_bending_force_has_no_tangential_part_and_moves_no_cell():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    force = bending_force(r, g, mesh.faces)
    assert np.abs(force.sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(r, force).sum(axis=0)).max() < 1e-12
    along = np.einsum("vi,vi->v", force, g.normals)[:, None] * g.normals
    assert np.linalg.norm(force - along) < 1e-2 * np.linalg.norm(force)


def test_energy_and_virtual_work_of_bending_are_of_second_order():
    exact, derivatives = energy(SHAPE.astype(complex))
    energies, works = [], []
    for subdivisions in (2, 3, 4):
        r, mesh = sphere(subdivisions)
        height = r[:, 2]
        at = r * legendre.legval(height, SHAPE)[:, None]
        g = geometry(at, mesh.faces)
        force = bending_force(at, g, mesh.faces)
        energies.append(bending_energy(g, mesh.faces) - exact)
        modes = [legendre.legval(height, e)[:, None] * r for e in np.eye(5)]
        works.append([np.vdot(force, mode) for mode in modes] - derivatives)
    sizes = (162, 642, 2562)
    print(energies, works)
    assert observed_orders(sizes, energies) == pytest.approx([2, 2], abs=0.2)
    for errors in np.transpose(works):
        assert observed_orders(sizes, errors) == pytest.approx([2, 2], abs=0.2)


def test_stiffness_on_two_rings_is_the_product_of_the_matrices():
    r, mesh = lumpy(1)
    g = geometry(r, mesh.faces)
    bending, rings = BendingStiffness.on(g, mesh), TwoRings(mesh)
    L = scalar_matrix(stiffness(g, mesh), mesh).toarray()
    exact = L @ np.diag(1 / g.node_areas) @ L
    h = np.random.default_rng(1).normal(size=len(r))
    assert bending.product(h) == pytest.approx(exact @ h, rel=1e-10, abs=1e-10)
    matrix = normal_blocks(stiffness(g, mesh), g.normals, mesh)
    blocks = rings.added(matrix, 0.7, bending, g.normals)
    dense = np.zeros((len(r), 3, len(r), 3))
    rows = np.repeat(np.arange(len(r)), np.diff(rings.row_start))
    dense[rows, :, rings.columns, :] = blocks
    across = np.einsum("vi,wj->viwj", g.normals, g.normals)
    assert dense == pytest.approx((L + 0.7 * exact)[:, None, :, None] * across, abs=1e-10)


def test_bending_energy_falls_as_fast_as_viscosity_dissipates():
    """Without polymerization and pressure nothing else drives, and tension keeps the area.

    The normal viscosity of the method dissipates its share.
    """
    p = am.Parameters(v_p0=0.0, delta_P=0.0, kappa=1.5, D=0.1)
    shares = []
    for subdivisions in (2, 3):
        r, mesh = lumpy(subdivisions)
        fitting = float(np.sqrt(geometry(r, mesh.faces).area / (4 * np.pi)))
        model = Model(p.replace(R0=fitting), mesh)
        flow = flow_of(model, State(0.0, r, np.full(len(r), p.c0), 0.0, np.zeros(3)), 1e-7)
        g = geometry(r, mesh.faces)
        viscous = viscous_forces(g, mesh, flow.v_c, p.eta_s, p.eta_b)
        v_n = np.einsum("vi,vi->v", flow.v, g.normals)
        damping = normal_projection(stiffness(g, mesh), g.normals, mesh)
        damped = NORMAL_VISCOSITY * (p.eta_s + p.eta_b) * v_n @ product(damping, mesh, v_n)
        step = 1e-5 / np.abs(flow.v).max()
        sides = [
            bending_energy(geometry(r + k * step * flow.v, mesh.faces), mesh.faces) for k in (-1, 1)
        ]
        lost = p.kappa * (sides[0] - sides[1]) / (2 * step)
        shares.append(lost / (damped - np.vdot(flow.v_c, viscous)))
    print(shares)
    assert lost > 0
    assert shares[0] == pytest.approx(1.0, abs=0.005)
    assert shares[1] == pytest.approx(1.0, abs=0.001)


def test_slowest_mode_of_a_cell_without_pressure_is_that_of_the_theory():
    """l = 2 grows first with little stiffness; 42 and 162 nodes."""
    p = am.Parameters(delta_P=0.0, kappa=0.03, v_p0=3.6)
    exact = float(finite_pressure_rates(p, 2)[0].real)
    errors = []
    for subdivisions in (1, 2):
        r, mesh = sphere(subdivisions)
        model = Model(p, mesh)
        r = r * np.sqrt(model.A0 / geometry(r, mesh.faces).area)
        state = State(0.0, r, np.full(len(r), p.c0), 0.0, np.zeros(3))
        found = leading_growth_rate(model, state, flow_of(model, state, 1e-2), 1.0, 1e-6, 1e-4)
        errors.append(found.rate - exact)
    print(exact, errors)
    assert abs(errors[1]) < 0.02
    assert abs(errors[1]) < abs(errors[0]) / 3
