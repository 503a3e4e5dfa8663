import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.meshes.geometry import geometry
from amoeboid.meshes.operators import advection, mass, scalar_matrix, stiffness
from amoeboid.model.parameters import Parameters
from amoeboid.surface.model import Model
from amoeboid.surface.transport import (
    added_diffusion,
    diffusive_loss,
    filaments,
    rate_of_change,
    returned_fluxes,
    transported,
)
from surface.shapes import lumpy, observed_orders, sphere


@given(seed=st.integers(0, 10**6), dt=st.floats(1e-4, 10.0))
def test_without_turnover_filaments_are_conserved(seed, dt):
    r, mesh = lumpy(seed=seed)
    rng = np.random.default_rng(seed)
    model = Model(Parameters(beta=0, D=0.1), mesh)
    g, c = geometry(r, mesh.faces), rng.uniform(0.1, 5.0, len(r))
    new = transported(model, filaments(c, g), g, rng.normal(size=r.shape), dt, c)
    before, after = filaments(c, g).sum(), filaments(new, g).sum()
    assert after == pytest.approx(before, rel=1e-12, abs=1e-12 * np.abs(filaments(new, g)).sum())


@given(
    seed=st.integers(0, 10**6),
    dt=st.floats(1e-4, 10.0),
    D=st.sampled_from([0.0, 1e-3, 0.1]),
    speed=st.floats(0, 20),
)
def test_concentration_never_becomes_negative(seed, dt, D, speed):
    """Empty nodes, single full ones, any flow, no diffusion: c >= 0, and nothing is lost."""
    r, mesh = lumpy(seed=seed)
    rng = np.random.default_rng(seed)
    model = Model(Parameters(beta=0, D=D), mesh)
    g = geometry(r, mesh.faces)
    c = rng.uniform(0, 5, len(r)) * (rng.uniform(size=len(r)) < 0.2)
    new = transported(model, filaments(c, g), g, speed * rng.normal(size=r.shape), dt, c)
    assert new.min() >= -1e-13 * new.max()
    assert filaments(new, g).sum() == pytest.approx(filaments(c, g).sum(), rel=1e-12)


@given(seed=st.integers(0, 10**6), empty=st.floats(0, 0.9))
def test_flux_correction_is_that_of_the_full_matrices(seed, empty):
    """Against the formulas of flux correction, written with full matrices."""
    r, mesh = lumpy(seed=seed)
    rng = np.random.default_rng(seed)
    model = Model(Parameters(), mesh)
    g, n = geometry(r, mesh.faces), len(r)
    c = rng.uniform(0, 5, n) * (rng.uniform(size=n) > empty)
    stock = rng.uniform(0, 3, n)
    entries = 0.02 * stiffness(g, mesh) - advection(g, mesh, rng.normal(size=r.shape))
    added = added_diffusion(entries, model)

    K = scalar_matrix(entries, mesh).toarray()
    d = np.maximum(0, np.maximum(K, K.T)) * (1 - np.eye(n))
    np.testing.assert_array_equal(scalar_matrix(added, mesh).toarray(), d)
    step = c[:, None] - c[None, :]
    flux = d * step
    near = scalar_matrix(np.ones_like(entries), mesh).toarray() > 0
    highest = np.where(near, -step, -np.inf).max(axis=1)
    lowest = np.where(near, step, -np.inf).max(axis=1)
    wanted, unwanted = np.maximum(flux, 0).sum(axis=1), np.maximum(-flux, 0).sum(axis=1)
    tiny = 1e-300
    gain = np.minimum(1, d.sum(axis=1) * highest / np.maximum(wanted, tiny))
    loss = np.minimum(1, np.minimum(stock, d.sum(axis=1) * lowest) / np.maximum(unwanted, tiny))
    gain[wanted == 0], loss[unwanted == 0] = 1, 1
    share = np.where(flux > 0, np.minimum(gain[:, None], loss), np.minimum(loss[:, None], gain))
    found = returned_fluxes(added, c, stock, model)
    np.testing.assert_allclose(found, (share * flux).sum(axis=1), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        diffusive_loss(added, c, model), flux.sum(axis=1), rtol=1e-12, atol=1e-12
    )


def test_flux_correction_leaves_resolved_transport_alone_and_bounds_the_rest():
    r, mesh = sphere(2)
    g = geometry(r, mesh.faces)
    v = np.array([0, 0, 1.0]) - r[:, 2:] * r
    steady = {}
    for D in (0.4, 0.005):
        model = Model(Parameters(D=D), mesh)
        entries = D * stiffness(g, mesh) - advection(g, mesh, v)
        assert added_diffusion(entries, model).any() == (D == 0.005)
        c = np.full(len(r), 3.0)
        for _ in range(300):
            c = transported(model, filaments(c, g), g, v, 0.1, c)
        steady[D] = c
        # a state that the step keeps has no rate of change, with or without correction
        assert np.abs(rate_of_change(model, c, g, v)).max() < 1e-4 * c.max()
    # the flow gathers filaments at z = 1: c rises monotonically from node to node along the axis
    for c in steady.values():
        near_axis = np.argsort(r[:, 2])[-12:]
        assert np.argmax(c) in near_axis
        assert c.min() > 0


def test_columns_of_the_exchange_matrices_sum_to_zero():
    r, mesh = lumpy()
    g = geometry(r, mesh.faces)
    u = np.random.default_rng(0).normal(size=r.shape)
    for entries in (stiffness(g, mesh), advection(g, mesh, u)):
        sums = np.ones(len(r)) @ scalar_matrix(entries, mesh)
        np.testing.assert_allclose(sums, 0, atol=1e-13)


def test_homogeneous_state_does_not_change_without_flow():
    r, mesh = lumpy()
    model = Model(Parameters(), mesh)
    g = geometry(r, mesh.faces)
    c = np.full(len(r), model.parameters.c0)
    new = transported(model, filaments(c, g), g, np.zeros_like(r), 0.7, c)
    np.testing.assert_allclose(new, c, rtol=1e-13)


@pytest.mark.parametrize("l", [1, 2, 3])
def test_rate_of_change_on_the_sphere_is_second_order(l):
    """dc/dt of c = P_l carried by the potential flow v = grad cos(theta), against the exact one."""
    p = Parameters(D=0.3, beta=0.7, c0=2.0)
    legendre = np.polynomial.legendre.Legendre.basis(l)
    sizes, errors = [], []
    for subdivisions in (2, 3, 4):
        r, mesh = sphere(subdivisions)
        g = geometry(r, mesh.faces)
        z = r[:, 2]
        c = 2 + legendre(z)
        v = np.array([0, 0, 1.0]) - z[:, None] * r
        # div(v c) = c div v + v . grad c, div v = -2 z, v . grad c = (1 - z^2) dc/dz
        exact = (
            2 * z * c
            - (1 - z**2) * legendre.deriv()(z)
            - p.D * l * (l + 1) * legendre(z)
            + p.beta * (p.c0 - c)
        )
        found = rate_of_change(Model(p, mesh), c, g, v)
        # in the weak sense, against smooth functions: a linear finite element has no more
        smooth = np.column_stack([np.polynomial.legendre.legvander(z, 4), r[:, 0] * z])
        sizes.append(len(r))
        errors.append(np.linalg.norm((g.node_areas * (found - exact)) @ smooth))
    orders = observed_orders(sizes, errors)
    assert np.all(np.abs(orders - 2) < 0.2), (errors, orders)


def test_turnover_is_implicit_euler_with_its_exact_integral():
    """Without flow: (m + dt (D L + beta M)) c = m c_before + dt beta M c0, densely."""
    r, mesh = lumpy()
    p = Parameters(D=0.5, beta=2.0, c0=3.0)
    g, dt = geometry(r, mesh.faces), 0.1
    c = np.random.default_rng(0).uniform(1, 5, len(r))
    new = transported(Model(p, mesh), filaments(c, g), g, np.zeros_like(r), dt, c)
    L, M = (scalar_matrix(f(g, mesh), mesh).toarray() for f in (stiffness, mass))
    before = g.node_areas * c + dt * p.beta * M @ np.full(len(r), p.c0)
    expected = np.linalg.solve(np.diag(g.node_areas) + dt * (p.D * L + p.beta * M), before)
    np.testing.assert_allclose(new, expected, rtol=1e-11)
    even = transported(Model(p, mesh), g.node_areas, g, np.zeros_like(r), dt, np.ones(len(r)))
    np.testing.assert_allclose(even, (1 + dt * 2.0 * 3.0) / (1 + dt * 2.0), rtol=1e-12)
