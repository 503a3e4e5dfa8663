"""Figure 1: treadmilling in flat and curved cortices, and the first mode of the cell."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from amoeboid import Parameters, figures
from amoeboid.closed_forms.thick_cortex import sphere_surface_stresses
from amoeboid.figures.gallery import fig1
from amoeboid.figures.results import Results


@pytest.fixture(scope="module")
def data():
    return figures.fig1.data()


def filament(data, flat, n):
    table = data["filaments"]
    rows = (table["flat"] == flat) & (table["n"] == n)
    return {name: table[name][rows] for name in table.columns}


def test_filaments_of_a_flat_cortex_keep_their_distance_and_bear_no_stress(data):
    left, right = filament(data, True, 0), filament(data, True, 1)
    gap = np.hypot(right["x"] - left["x"], right["y"] - left["y"])
    assert np.ptp(gap) < 1e-4 * gap.mean()
    speed = data.parameters.v_p0 * np.exp(-3.0)  # main text `vp` at c0 = 3 c_r
    np.testing.assert_allclose(left["v_y"], -speed, rtol=1e-4)
    curved = filament(data, False, 0)
    assert np.abs(left["stress"]).max() < 2.0 / fig1.FLAT * np.abs(curved["stress"]).min()


def test_filaments_of_a_curved_cortex_converge_and_push_each_other_apart(data):
    left, right = filament(data, False, 1), filament(data, False, 2)
    gap = np.hypot(right["x"] - left["x"], right["y"] - left["y"])
    assert np.all(np.diff(gap) < 0)
    assert np.all(left["stress"] < 0)


def test_monomers_have_moved_with_the_cortex_since_they_were_added():
    """Against an integration of dr/dt = A r + B/r^2 with coefficients from a linear solve."""
    p = Parameters()
    found = fig1.cortex(p, 1.0)
    h, lam, mu, v_p = (float(getattr(found, k)) for k in ("h", "lambda_3d", "mu_3d", "v_p"))
    inner = 1.0 - h
    # v_r = -v_p outside; no radial stress (lam + 2 mu) v' + 2 lam v/r inside; SI `eq3DStress`
    free = [3 * lam + 2 * mu, -4 * mu / inner**3]
    A, B = np.linalg.solve([[1.0, 1.0], free], [-v_p, 0.0])
    depth, speed, stress = fig1.monomers(found)
    times = np.arange(depth.size) * h / (v_p * fig1.MONOMERS)
    way = solve_ivp(
        lambda t, r: A * r + B / r**2, (0, times[-1]), [1.0], "DOP853", times, rtol=1e-10
    )
    np.testing.assert_allclose(1.0 - depth, way.y[0], atol=1e-7)
    np.testing.assert_allclose(speed, -(A * way.y[0] + B / way.y[0] ** 2), rtol=1e-6)
    # hoop stress 2 mu v/r + lam (v' + 2 v/r)
    np.testing.assert_allclose(
        stress, (3 * lam + 2 * mu) * A + 2 * mu * B / way.y[0] ** 3, rtol=1e-6
    )


def test_viscosities_of_the_thick_cortex_are_those_of_the_shell():
    """SI `eq2DViscosities3D`, also of the incompressible fluid, eta_b = 2 eta_s."""
    for eta_b in (0.0, 0.5, 1.0, 2.0):
        found = fig1.cortex(Parameters(eta_b=eta_b), 1.0)
        h, lam, mu = (float(getattr(found, k)) for k in ("h", "lambda_3d", "mu_3d"))
        assert h * mu == pytest.approx(1.0)
        assert 2 * h * lam * mu / (lam + 2 * mu) == pytest.approx(eta_b, rel=1e-8)
        assert np.isfinite(sphere_surface_stresses(found).hoop)


def test_cortex_that_no_fluid_makes_is_told_and_the_rest_is_drawn():
    data = figures.fig1.data(Parameters(eta_b=3.0))
    assert "eta_b <= 2 eta_s, got eta_b/eta_s = 3" in data.problems[0]
    assert len(data["filaments"]) == 0
    assert len(data["cell"]) == fig1.CELL


def test_stress_and_filament_velocity_are_largest_at_the_front(data):
    """SI `activestress3` on the sphere: -2 v_p (eta_s + eta_b)/R0."""
    cell = data["cell"]
    np.testing.assert_allclose(cell["active_stress"], -4.0 * cell["v_p"], rtol=1e-14)
    rear, front = 0, fig1.CELL // 2
    assert cell["c"][front] < cell["c"][rear]
    assert cell["v_p"][front] == pytest.approx(3.0 * cell["v_p"][rear])  # 1 -+ 1/2 of v_p(c0)


def test_flow_is_tangential_in_the_cell_frame_and_normal_in_that_of_the_laboratory(data):
    cell = data["cell"]
    n = np.column_stack([cell["z"], cell["x"]])
    v, laboratory = (
        np.column_stack([cell[f"{k}_z"], cell[f"{k}_x"]]) for k in ("v", "v_laboratory")
    )
    size = np.abs(v).max()
    assert np.abs(np.einsum("pi,pi->p", v, n)).max() < 1e-14 * size
    assert np.abs(n[:, 0] * laboratory[:, 1] - n[:, 1] * laboratory[:, 0]).max() < 1e-14 * size
    assert cell["v_z"][fig1.CELL // 4] > 0  # towards the rear
    assert cell["v_laboratory_z"][fig1.CELL // 2] < 0  # the front protrudes


def test_flow_in_the_laboratory_is_normal_unless_the_figure_says_that_it_is_not():
    def tangential(p):
        cell = fig1.compute(p, Results())["cell"]
        at, v = (
            np.column_stack([cell[f"{name}{k}"] for k in "zx"]) for name in ("", "v_laboratory_")
        )
        along = at[:, 0] * v[:, 1] - at[:, 1] * v[:, 0]
        return np.abs(along).max() / np.abs(v).max()

    def warned(p):
        return any("not normal" in note for note in fig1.compute(p, Results()).notes)

    plain, stiff = Parameters(), Parameters(alpha=0.05)
    assert tangential(plain) < 1e-12
    assert not warned(plain)
    # the share of the stiffness in the flow: alpha R0/(2 (eta_s + eta_b)) against |v_p'(c0)|
    assert tangential(stiff) == pytest.approx(0.05 / 4 / (3.8 * np.exp(-3)), rel=1e-9)
    assert warned(stiff)
