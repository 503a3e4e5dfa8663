"""Shapes with saddles, where a membrane has next to no viscous resistance to some motions.

The treatment is NORMAL_VISCOSITY of surface/force_balance.py; docs/large-deformation.md says more.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh

from amoeboid.config import Config, Mesh, Time
from amoeboid.meshes.geometry import area, geometry, mesh_quality, volume_centroid
from amoeboid.meshes.intersections import embedded
from amoeboid.meshes.operators import block_matrix, normal_blocks, normal_projection, stiffness
from amoeboid.model.parameters import Parameters
from amoeboid.observables import observed, reduced_volume
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step import Step
from amoeboid.surface import force_balance, stepping
from amoeboid.surface.dissipation import dissipation_blocks
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.force_balance import NORMAL_VISCOSITY
from amoeboid.surface.frame import rigid_motions
from amoeboid.surface.model import Model
from amoeboid.surface.state import State
from amoeboid.surface.stepping import StepFailed, semi_implicit_step
from surface.shapes import dumbbell, sphere, three_lobed

SHAPES = {"dumbbell": dumbbell, "three lobes": lambda s: three_lobed(s, 0.2)}
DEEP = {"dumbbell": dumbbell, "three lobes": three_lobed}


def ellipsoid(subdivisions):
    """A convex shape of area 4 pi that is not at rest either."""
    r, mesh = sphere(subdivisions)
    r = r * [1, 1.1, 1.4]
    return r * np.sqrt(4 * np.pi / area(r, mesh.faces)), mesh


def gaussian_curvature(r, mesh):
    """Angle defect over node area, (V,)."""
    defect = np.full(len(r), 2 * np.pi)
    for k in range(3):
        i, j, l = np.roll(mesh.faces, -k, axis=1).T
        u, v = r[j] - r[i], r[l] - r[i]
        cosine = np.einsum("fi,fi->f", u, v) / np.linalg.norm(u, axis=1)
        np.subtract.at(defect, i, np.arccos(cosine / np.linalg.norm(v, axis=1)))
    return defect / geometry(r, mesh.faces).node_areas


def lowest_resistance(r, mesh, share):
    """Smallest dissipation per area of a motion without rigid part; eta_s = eta_b = 1."""
    g = geometry(r, mesh.faces)
    blocks = dissipation_blocks(g, mesh, 1.0, 1.0)
    damping = normal_projection(2.0 * share * stiffness(g, mesh), g.normals, mesh)
    blocks = blocks + normal_blocks(damping, g.normals, mesh)
    scale = np.repeat(g.node_areas, 3) ** -0.5
    matrix = block_matrix(blocks, mesh).toarray() * scale[:, None] * scale
    # rigid motions are lifted out of the way
    rigid, _ = np.linalg.qr(rigid_motions(r, g) / scale[:, None])
    projector = np.eye(len(matrix)) - rigid @ rigid.T
    matrix = projector @ matrix @ projector + 1e3 * rigid @ rigid.T
    return float(eigh(matrix, eigvals_only=True, subset_by_index=[0, 0])[0])


def test_the_test_shapes_have_the_claimed_area_and_curvature():
    for shape in (*SHAPES.values(), *DEEP.values()):
        r, mesh = shape(3)
        assert area(r, mesh.faces) == pytest.approx(4 * np.pi, rel=1e-12)
        assert embedded(r, mesh.faces)
        assert mesh_quality(r, mesh.faces) > 0.3
        curvature = gaussian_curvature(r, mesh)
        assert curvature @ geometry(r, mesh.faces).node_areas == pytest.approx(4 * np.pi)
        assert curvature.min() < -0.5
        np.testing.assert_allclose(volume_centroid(r, mesh.faces), 0, atol=1e-3)
    # three lobes: turning by a third of a circle changes nothing
    found = [three_lobed(3)[0] @ [np.cos(a), np.sin(a), 0] for a in 2 * np.pi / 3 * np.arange(3)]
    assert np.ptp([x.max() for x in found]) < 0.02


def test_normal_viscosity_restores_the_resistance_of_saddles():
    """Without it the lowest eigenvalue falls with the mesh, towards zero; with it it does not."""
    r, mesh = sphere(2)
    plain = lowest_resistance(r, mesh, 0.0)
    assert plain == pytest.approx(10 / 7, rel=0.05)  # l = 2: see below
    assert lowest_resistance(r, mesh, NORMAL_VISCOSITY) == pytest.approx(plain, rel=0.01)
    for name, shape in DEEP.items():
        without = [lowest_resistance(*shape(s), 0.0) for s in (1, 2)]
        treated = [lowest_resistance(*shape(s), NORMAL_VISCOSITY) for s in (1, 2)]
        print(name, without, treated)
        assert without[1] < 2e-3
        assert min(treated) > 10 * NORMAL_VISCOSITY
        assert treated[1] > 15 * without[1]


@pytest.mark.slow
def test_normal_viscosity_restores_the_resistance_of_saddles_on_a_finer_mesh():
    for name, shape in DEEP.items():
        without = [lowest_resistance(*shape(s), 0.0) for s in (2, 3)]
        treated = [lowest_resistance(*shape(s), NORMAL_VISCOSITY) for s in (2, 3)]
        print(name, without, treated)
        assert without[1] < 0.2 * without[0]
        assert treated[1] > 0.7 * treated[0]


def settled(shape, delta_P, end=0.05):
    """A run from a shape at rest nowhere, through the fast motions at its start, as a Step."""
    p = Parameters(D=0.4, v_p0=6.0, delta_P=delta_P)
    r, mesh = shape(2)
    model = Model(p, mesh)
    n = geometry(r, mesh.faces).normals
    c = 3 + 0.5 * n[:, 2] + 0.3 * n[:, 0]
    begin = State(0.0, r, c, 0.5 * delta_P, np.zeros(3))
    first = Step(0, model, (begin,), flow_of(model, begin, 1e-6), 1e-6, 0, 1e3, False)
    *_, last = evolve(first, Time(end=end))
    return first, last


@pytest.mark.parametrize(
    ("name", "delta_P"),
    [
        pytest.param("three lobes", 3.0, marks=pytest.mark.slow),
        pytest.param("dumbbell", 11.0, marks=pytest.mark.slow),
        pytest.param("dumbbell", 3.0, marks=pytest.mark.slow),
        pytest.param("three lobes", 11.0, marks=pytest.mark.slow),
    ],
)
def test_a_run_from_saddles_works_and_its_steps_are_second_order(name, delta_P):
    first, step = settled(SHAPES[name], delta_P)
    model = step.model
    print(name, delta_P, step.number, step.rejected, "steps and rejections")
    assert step.number < 60
    assert step.rejected < 10
    assert embedded(step.state.r, model.mesh.faces)
    assert mesh_quality(step.state.r, model.mesh.faces) > 0.3
    # towards the sphere
    volumes = [reduced_volume(s.cell) for s in (first, step)]
    assert volumes[1] > volumes[0]
    ends = []
    # with 80 steps the fast motions of the saddles are not resolved yet: order 2.3 in v
    for count in (160, 320, 640):
        history = (step.state,)
        for _ in range(count):
            state, flow, _ = semi_implicit_step(model, history, 0.1 / count)
            history = (state, *history[:1])
        ends.append((state, flow))
    for what, value in (
        ("r", lambda s, f: s.r),
        ("c", lambda s, f: s.c),
        ("v", lambda s, f: f.v),
        ("zeta0", lambda s, f: s.zeta0),
    ):
        changes = [np.abs(value(*a) - value(*b)).max() for a, b in pairwise(ends)]
        order = np.log2(changes[0] / changes[1])
        print(name, delta_P, what, changes, order)
        assert abs(order - 2) < 0.2, (what, changes, order)


def test_a_step_factorizes_again_if_its_iteration_does_not_converge(monkeypatch):
    """Deep saddles: the resistance of the softest motions changes as they happen."""
    p = Parameters(D=0.4, v_p0=6.0, delta_P=11.0)
    r, mesh = three_lobed(2)
    n = geometry(r, mesh.faces).normals
    state = State(0.0, r, 3 + 0.5 * n[:, 2] + 0.3 * n[:, 0], 5.5, np.zeros(3))
    model = Model(p, mesh)
    semi_implicit_step(model, (state,), 5e-5)
    monkeypatch.setattr(stepping, "MAX_REUSES", stepping.MAX_ITERATIONS)
    with pytest.raises(StepFailed):
        semi_implicit_step(model, (state,), 5e-5)


def steady_state(share, monkeypatch, delta_P=300.0):
    monkeypatch.setattr(force_balance, "NORMAL_VISCOSITY", share)
    config = Config(
        parameters=Parameters(D=0.4, v_p0=6.0, delta_P=delta_P),
        mesh=Mesh(subdivisions=2),
        time=Time(end=60.0),
    )
    first = start(config)
    *_, last = evolve(first, config.time)
    assert last.steady
    # one runs into its steady state sooner than the other, and the mesh settles slowly in it
    *_, last = evolve(last, Time(end=150.0, stop_when_steady=False))
    return observed(last.cell)


@pytest.mark.slow
@pytest.mark.parametrize("delta_P", [300.0, 11.0])
def test_steady_states_do_not_depend_on_the_normal_viscosity(delta_P, monkeypatch):
    """v.n = 0 in a steady state, up to the rate of change that counts as steady."""
    found = [steady_state(share, monkeypatch, delta_P) for share in (1e-4, 1e-2)]
    for name in ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "deformation"):
        values = [x[name] for x in found]
        print(delta_P, name, values, np.ptp(values) / values[0])
        assert np.ptp(values) < 5e-4 * values[0], name


@pytest.mark.parametrize("name", ["sphere", *SHAPES])
def test_effect_of_the_normal_viscosity_on_a_transient(name, monkeypatch):
    """What the normal velocity is right away, and the shape after the fast motions.

    Convex: nothing, to the digit. On saddles the resistance of the softest motions is that of the
    treatment, and so is the speed of the first moments; the shape they lead to hardly is.
    """
    speeds, volumes = [], []
    for share in (1e-4, 1e-3, 1e-2):
        monkeypatch.setattr(force_balance, "NORMAL_VISCOSITY", share)
        first, last = settled({"sphere": ellipsoid, **SHAPES}[name], 11.0, end=0.1)
        v_n = np.einsum("vi,vi->v", first.flow.v, first.flow.normals)
        speeds.append(np.abs(v_n).max())
        volumes.append(reduced_volume(last.cell))
    print(name, speeds, volumes)
    assert np.ptp(volumes[:2]) < 0.005
    assert np.ptp(volumes) < 0.05
    if name == "sphere":
        # the largest share damps the stretched mode by 9.9 %, on the finest of meshes, too
        assert np.ptp(speeds) < 0.11 * speeds[0]
        assert np.ptp(speeds[:2]) < 0.02 * speeds[0]
    else:
        assert speeds[0] > 1.1 * speeds[1] > 1.2 * speeds[2]
