"""The paper's explicit scheme, against exact rates, dense algebra and the semi-implicit scheme."""

from dataclasses import replace

import numpy as np
import pytest

from amoeboid.config import Initial
from amoeboid.meshes.geometry import area_gradient, geometry, weighted_area_gradient
from amoeboid.meshes.operators import block_matrix
from amoeboid.model.parameters import Parameters
from amoeboid.observables import filament_number, observed
from amoeboid.surface import explicit, initial
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.dissipation import dissipation_blocks
from amoeboid.surface.explicit import (
    constrained_flow,
    explicit_step,
    interpolated,
    lagrangian_rate,
)
from amoeboid.surface.force_balance import pressure_force
from amoeboid.surface.frame import rigid_motions
from amoeboid.surface.model import Model
from amoeboid.surface.state import State
from amoeboid.surface.stepping import StepFailed, semi_implicit_step
from surface.shapes import lumpy, observed_orders, sphere

SOFT = Parameters(D=0.4, v_p0=6.0, delta_P=30.0)


def stepped(model, state, dt, count, flow=None):
    for _ in range(count):
        state, flow = explicit_step(model, state, dt, flow)
    return state, flow


def semi_implicit(model, state, dt, count):
    for _ in range(count):
        state, flow, _ = semi_implicit_step(model, (state,), dt)
    return state, flow


def polarizing(p, subdivisions, perturbation=1.0):
    """A cell on its way to the polarized state, past the fast adjustment of its shape."""
    model, rest = initial.sphere(p, subdivisions)
    state = initial.perturbed(model, rest, Initial(perturbation=perturbation))
    return model, semi_implicit(model, state, 0.01, 20)[0]


def test_flow_is_that_of_a_dense_solve_with_all_constraints():
    """K v_c + zeta0 dA/dr = forces, dA/dt as wanted, no mean translation, no rotation."""
    p = Parameters(alpha=0.2, eta_b=2.0, delta_P=5.0)
    r, mesh = lumpy(1)
    model, g = Model(p, mesh), geometry(r, mesh.faces)
    rng = np.random.default_rng(0)
    c = rng.uniform(1, 5, len(r))
    v_p = p.v_p(c)[:, None] * g.normals
    state = State(0.0, r, c, 1.0, np.zeros(3))
    found, zeta0 = constrained_flow(model, state, g, v_p, 0.3, rng.normal(size=r.shape))

    per_area = area_gradient(g, mesh.faces)
    force = p.delta_P * pressure_force(r, g, mesh.faces)
    force += weighted_area_gradient(g, mesh.faces, p.alpha * c[mesh.faces].mean(axis=1))
    K = block_matrix(dissipation_blocks(g, mesh, p.eta_s, p.eta_b), mesh).toarray()
    border = np.column_stack(
        [per_area.ravel(), np.repeat(g.node_areas, 3)[:, None] * rigid_motions(r, g)]
    )
    wanted = (model.A0 - g.area) / 0.3 - np.sum(per_area * v_p)
    system = np.block([[K, border], [border.T, np.zeros((7, 7))]])
    exact = np.linalg.solve(system, np.concatenate([force.ravel(), [wanted], np.zeros(6)]))
    size = np.abs(exact[: K.shape[0]]).max()
    np.testing.assert_allclose(found.ravel(), exact[: K.shape[0]], atol=1e-4 * size)
    assert zeta0 == pytest.approx(exact[K.shape[0]], rel=1e-6)
    # forces that the shape exerts are free of net force and torque: rigid motions need none
    np.testing.assert_allclose(exact[K.shape[0] + 1 :], 0, atol=1e-9)


def test_rate_and_interpolation_on_a_sphere_are_second_order():
    """c = 2 + P_2 dilated by a normal speed, gathered by a tangential flow: exact rates."""
    p = Parameters(D=0.3, beta=0.7, c0=2.0)
    sizes, rates, moves = [], [], []
    for subdivisions in (2, 3, 4):
        r, mesh = sphere(subdivisions)
        model, g, z = Model(p, mesh), geometry(r, mesh.faces), r[:, 2]
        c = 1.5 + 1.5 * z**2
        tangential = np.array([0, 0, 1.0]) - z[:, None] * r
        v = tangential + (0.4 + 0.2 * z)[:, None] * r
        # div v = 2 v_n - 2 z; lap P_2 = -6 P_2
        exact = -(2 * (0.4 + 0.2 * z) - 2 * z) * c - p.D * 6 * (c - 2) + p.beta * (p.c0 - c)
        carried = (1 - z**2) * 3 * z
        smooth = np.column_stack([np.polynomial.legendre.legvander(z, 4), r[:, 0] * z])
        weights = g.node_areas[:, None] * smooth
        sizes.append(len(r))
        rates.append(np.linalg.norm((lagrangian_rate(model, c, g, v) - exact) @ weights))
        change = (interpolated(model, c, g, 1e-3 * tangential) - c) / 1e-3
        moves.append(np.linalg.norm((change - carried) @ weights))
    for errors in (rates, moves):
        orders = observed_orders(sizes, errors)
        assert np.all(np.abs(orders - 2) < 0.2), (errors, orders)


def test_a_rigid_motion_changes_no_concentration():
    r, mesh = lumpy()
    model, g = Model(Parameters(beta=0, D=0), mesh), geometry(r, mesh.faces)
    c = np.random.default_rng(0).uniform(1, 5, len(r))
    v = np.array([1.0, 2.0, -0.5]) + np.cross([0.3, -1.0, 0.5], r)
    np.testing.assert_allclose(lagrangian_rate(model, c, g, v), 0, atol=1e-12)


def test_uniform_growth_dilutes_by_twice_its_rate():
    r, mesh = lumpy()
    model, g = Model(Parameters(beta=0, D=0), mesh), geometry(r, mesh.faces)
    c = np.full(len(r), 3.0)
    np.testing.assert_allclose(lagrangian_rate(model, c, g, 0.1 * r), -0.2 * c, rtol=1e-12)


@pytest.mark.slow
def test_the_step_is_first_order_in_time(monkeypatch):
    monkeypatch.setattr(explicit, "RESIDUAL", 1e-12)  # far below the error of the steps
    model, begin = polarizing(SOFT, 1)
    begin, flow = stepped(model, begin, 1e-3, 100)
    ends = [stepped(model, begin, 0.4 / n, n, flow)[0] for n in (100, 200, 400, 3200)]
    for field in ("r", "c"):
        errors = [np.abs(getattr(e, field) - getattr(ends[-1], field)).max() for e in ends[:-1]]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        # the reference is itself wrong by an eighth of the last error
        assert np.all(np.abs(orders - 1) < 0.2), (field, errors, orders)


def transient_difference(subdivisions, dt):
    """Largest difference to the semi-implicit scheme over a transient, relative to the change."""
    model, begin = polarizing(SOFT, subdivisions, perturbation=3.0)
    here = stepped(model, begin, dt, round(0.4 / dt))[0]
    there = semi_implicit(model, begin, 2e-3, 200)[0]
    return np.abs(here.c - there.c).max() / np.abs(there.c - begin.c).max(), len(begin.c)


@pytest.mark.slow
def test_transient_approaches_that_of_the_semi_implicit_scheme():
    """Two space discretizations and two time discretizations of one model, on two meshes."""
    (coarse, n), (fine, m) = transient_difference(2, 2e-3), transient_difference(3, 8e-4)
    order = observed_orders([n, m], [coarse, fine])[0]
    print(coarse, fine, order)
    assert fine < 0.03
    assert order > 1.5


@pytest.mark.slow
def test_steady_state_is_that_of_the_semi_implicit_scheme():
    """162 nodes at delta_P = 30: within the mesh error, and nothing but turnover feeds it."""
    model, rest = initial.sphere(SOFT, 2)
    begin = initial.perturbed(model, rest, Initial(perturbation=3.0))
    start, flow = semi_implicit(model, begin, 0.1, 300)
    there = observed(SurfaceCell(model, start, flow))
    last, flow = stepped(model, start, 2e-3, 1500)
    here = observed(SurfaceCell(model, last, flow))
    differences = {
        name: here[name] / there[name] - 1
        for name in ("max_retrograde_speed", "c_front", "c_rear", "zeta0")
    }
    print(differences, here["area_error"])
    # second order in h: the slow test finds a quarter of this on 642 nodes
    tolerances = {"max_retrograde_speed": 0.05, "c_front": 0.05, "c_rear": 0.1, "zeta0": 0.02}
    assert all(abs(differences[k]) < tolerance for k, tolerance in tolerances.items())
    # first order in dt; the pressure on dual areas has another residual than the gradient had
    assert here["area_error"] < 2e-7
    assert here["mesh_quality"] > 0.95
    # the frame follows the cell, which crawls as far as in the other scheme
    assert np.linalg.norm(last.r - start.r, axis=1).max() < 0.01
    crawled = (last.position - start.position)[2] / 3.0
    before = semi_implicit(model, start, 0.1, 1)[0]
    assert crawled == pytest.approx((before.position - start.position)[2] / 0.1, rel=0.05)


@pytest.mark.slow
def test_steady_state_converges_to_the_axisymmetric_one():
    from cross.spectral import OBSERVED, polarized

    exact = polarized(SOFT)
    errors = {name: [] for name in OBSERVED}
    for subdivisions, dt in ((2, 2e-3), (3, 5e-4)):
        model, rest = initial.sphere(SOFT, subdivisions)
        begin = initial.perturbed(model, rest, Initial(perturbation=3.0))
        start, _ = semi_implicit(model, begin, 0.1, 300)
        last, flow = stepped(model, start, dt, round(4 / dt))
        found = observed(SurfaceCell(model, last, flow))
        for name in OBSERVED:
            errors[name].append(found[name] / getattr(exact, name) - 1)
    for name, (coarse, fine) in errors.items():
        order = np.log2(coarse / fine)
        print(f"{name}: {coarse:+.3%} {fine:+.3%}, order {order:.2f}")
        assert order > 1.7, name
        assert abs(fine) < 0.025, name


def test_without_turnover_filaments_are_kept_to_second_order_in_the_mesh():
    """The Lagrangian form keeps them up to dt and the interpolation up to the mesh."""
    p = replace(SOFT, beta=0.0)
    losses = []
    for subdivisions, dt in ((1, 2e-3), (2, 1e-3)):
        model, begin = polarizing(p, subdivisions)
        last, flow = stepped(model, begin, dt, round(0.4 / dt))
        before = filament_number(SurfaceCell(model, begin, flow))
        losses.append(filament_number(SurfaceCell(model, last, flow)) / before - 1)
    order = observed_orders([42, 162], losses)[0]
    print(losses, order)
    assert abs(losses[-1]) < 0.01
    assert order > 1.5


def test_an_error_of_the_area_is_corrected_in_one_step():
    """dA/dt = (A0 - A)/dt: left is what the last step alone did, its redistribution above all."""
    model, begin = polarizing(SOFT, 1)
    swollen = replace(begin, r=1.001 * begin.r)
    left = []
    for dt in (2e-3, 1e-3, 5e-4):
        last, flow = stepped(model, swollen, dt, 3)
        left.append(observed(SurfaceCell(model, last, flow))["area_error"])
    assert max(left) < 1e-7
    assert np.log2(left[0] / left[-1]) / 2 > 0.8, left


def test_a_start_from_the_previous_flow_changes_nothing_but_the_effort(monkeypatch):
    model, begin = polarizing(SOFT, 1)
    iterations = []
    plain = explicit.constrained_minimum

    def counted(*arguments):
        result = plain(*arguments)
        iterations.append(result.iterations)
        return result

    monkeypatch.setattr(explicit, "constrained_minimum", counted)
    state, flow = explicit_step(model, begin, 1e-4)
    warm, _ = explicit_step(model, state, 1e-4, flow)
    cold, _ = explicit_step(model, state, 1e-4)
    np.testing.assert_allclose(warm.r, cold.r, atol=1e-8)
    assert warm.zeta0 == pytest.approx(cold.zeta0, rel=1e-6)
    assert iterations[1] < 0.7 * iterations[2]


def test_a_turned_cell_gives_the_turned_result():
    model, begin = polarizing(SOFT, 1)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    plain, _ = stepped(model, begin, 1e-3, 20)
    turned, _ = stepped(
        model, replace(begin, r=begin.r @ turn.T, position=turn @ begin.position), 1e-3, 20
    )
    np.testing.assert_allclose(turned.r, plain.r @ turn.T, atol=1e-8)
    np.testing.assert_allclose(turned.c, plain.c, rtol=1e-7)
    np.testing.assert_allclose(turned.position, turn @ plain.position, atol=1e-8)


def test_stiff_shapes_limit_the_step():
    """642 nodes at delta_P = 300: calm at 3e-5, violent at 1e-4."""
    model, begin = polarizing(replace(SOFT, delta_P=300.0), 3, perturbation=3.0)
    speeds = []
    for dt in (3e-5, 1e-4):
        _, flow = stepped(model, begin, dt, 150)
        speeds.append(np.abs(np.einsum("vi,vi->v", flow.v, flow.normals)).max())
    print(speeds)
    assert speeds[0] < 0.3
    assert speeds[1] > 3.0


@pytest.mark.parametrize(
    ("changes", "dt", "says"),
    [
        ({"delta_P": 300.0}, 1e-2, r"concentration|inverted|degenerated|finite|area error"),
        ({"D": 10.0}, 0.05, "concentration became negative"),
    ],
)
def test_too_long_a_step_is_rejected_with_its_reason(changes, dt, says):
    model, begin = polarizing(SOFT, 1)
    model = Model(replace(SOFT, **changes), model.mesh)
    with pytest.raises(StepFailed, match=says):
        stepped(model, begin, dt, 200)


def test_a_step_that_loses_the_area_is_rejected():
    """Above the stability limit nodes fly away and come back within steps: no silent garbage."""
    model, begin = polarizing(replace(SOFT, delta_P=1e4), 1, perturbation=3.0)
    rough = begin.r * (1 + 0.1 * np.sin(3 * begin.r[:, :1]))
    with pytest.raises(StepFailed, match="stiff shape modes: the relative area error"):
        stepped(model, replace(begin, r=rough), 1e-4, 50)


def test_conjugate_gradients_that_do_not_converge_are_reported(monkeypatch):
    model, begin = polarizing(SOFT, 1)
    monkeypatch.setattr(explicit, "MAX_ITERATIONS", 3)
    with pytest.raises(StepFailed, match="conjugate gradients"):
        explicit_step(model, begin, 1e-4)
