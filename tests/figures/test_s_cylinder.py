"""The thick cortex against the printed velocity, a boundary value problem, and first orders."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_bvp

from amoeboid import Parameters, figures
from amoeboid.figures.gallery.s_cylinder import first_order, stress_ratio, viscosity_ratio_3d
from unit_systems import SYSTEMS

RATIOS = (0.0, 2.0, 20.0)


@pytest.fixture(scope="module")
def data():
    return figures.s_cylinder.data()


def rows(table, shape, ratio):
    return (table["shape"] == shape) & (table["lambda_over_mu"] == ratio)


def printed_velocity(r, h, lam):
    """SI eqvR with v_p = R0 = mu = 1."""
    inner = (lam + 1) * (1 - h) ** 2
    return -(inner + r**2) / (r * (inner + 1))


@pytest.mark.parametrize("ratio", RATIOS)
def test_velocity_in_the_cylinder_is_the_printed_one(data, ratio):
    table = data["profile"]
    at = rows(table, "cylinder", ratio)
    expected = printed_velocity(table["r_over_R0"][at], 0.3, ratio)
    np.testing.assert_allclose(table["v_r_over_v_p"][at], expected, rtol=1e-13)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("h", [0.05, 0.25])
def test_hoop_stress_of_the_cylinder_is_the_integral_of_the_printed_solution(ratio, h):
    """SI eqStressesIntegrated by quadrature, over eqSurfaceStressesThinShell."""

    def stress(r):
        slope = (printed_velocity(r + 1e-6, h, ratio) - printed_velocity(r - 1e-6, h, ratio)) / 2e-6
        hoop = printed_velocity(r, h, ratio) / r
        return ratio * (slope + hoop) + 2 * hoop

    thin = -h * (2 * ratio / (ratio + 2) + 2)
    expected = quad(stress, 1 - h, 1)[0] / thin
    assert float(stress_ratio("cylinder", h, ratio)) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("ratio", RATIOS)
def test_hoop_stress_of_the_sphere_solves_the_boundary_value_problem(ratio):
    """div sigma = 0 in the shell by collocation: v = -1 outside, no traction inside."""
    h = 0.25

    def equations(r, y):
        return np.vstack([y[1], 2 * y[0] / r**2 - 2 * y[1] / r])

    def traction(r, y):
        return (ratio + 2) * y[1] + 2 * ratio * y[0] / r

    r = np.linspace(1 - h, 1, 200)
    found = solve_bvp(
        equations,
        lambda a, b: np.array([traction(1 - h, a), b[0] + 1]),
        r,
        np.vstack([-np.ones_like(r), np.zeros_like(r)]),
        tol=1e-9,
    )
    assert found.success

    def hoop(at):
        v, slope = found.sol(at)
        return ratio * (slope + 2 * v / at) + 2 * v / at

    thin = -2 * h * (2 * ratio / (ratio + 2) + 1)
    expected = quad(hoop, 1 - h, 1)[0] / thin
    assert float(stress_ratio("sphere", h, ratio)) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("shape", ["cylinder", "sphere"])
@pytest.mark.parametrize("ratio", RATIOS)
def test_first_order_leaves_an_error_of_higher_order(shape, ratio):
    """1 + (3 lambda + 2 mu)/(2 (lambda + 2 mu)) t for the cylinder, 5 in place of 3: sphere."""
    t = np.array([1e-2, 1e-3])
    error = np.abs(stress_ratio(shape, t, ratio) - 1 - first_order(shape, ratio) * t)
    assert np.log10(error[0] / error[1]) > 1.8  # 3 on the cylinder without lambda


def test_the_cell_of_the_paper_has_a_thin_cortex(data):
    """h = 190 nm and R0 = 10 um, SI tab_params; eta_s = eta_b is lambda = 2 mu."""
    cell = data["cell"]
    np.testing.assert_allclose(cell["h_over_R0"], 0.019, rtol=1e-12)
    np.testing.assert_allclose(cell["lambda_over_mu"], 2.0, rtol=1e-12)
    assert np.all(cell["stress_ratio"] < 1.03)


def test_no_layer_has_a_bulk_viscosity_of_twice_the_shear_viscosity():
    p = Parameters(eta_b=2.0)
    assert viscosity_ratio_3d(p) is None
    found = figures.s_cylinder.data(p)
    assert "no layer" in found.notes[0]
    assert sorted(set(found["stress"]["lambda_over_mu"])) == [0.0, 20.0]


def test_layer_of_a_cell_does_not_depend_on_units():
    units = SYSTEMS["nm, ms, single filaments"]
    p = Parameters(eta_s=1.0 / units.of("M/T"), eta_b=0.7 / units.of("M/T"))
    expected = viscosity_ratio_3d(Parameters(eta_b=0.7))
    assert viscosity_ratio_3d(p) == pytest.approx(expected, rel=1e-12)
