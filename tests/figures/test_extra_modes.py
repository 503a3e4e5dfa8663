"""Growth rates of the modes: printed formula, exact matrix, and the order of the modes."""

import math

import numpy as np
import pytest

from amoeboid import Parameters, figures
from amoeboid.closed_forms.linear import critical_pressure, mode_onsets
from amoeboid.model.parameters import DIMENSIONS
from figures.drawn import drawn, lines
from unit_systems import SYSTEMS


@pytest.fixture(scope="module")
def data():
    return figures.extra_modes.data()


def shape_matrix(v_p0, delta_P, l, D=0.03, c0=3.0):
    """The exact linear dynamics of (c_l, rho_l), docs/theory.md, with all other numbers 1."""
    L, S, f0 = l * (l + 1), 2.0, v_p0 * math.exp(-c0)
    return np.array(
        [
            [-L * D - 1 + 2 * c0 * f0, c0 * (L - 2) * (delta_P / (4 * S) - f0)],
            [-f0, -(f0 + delta_P / 8 * (L + (L - 2) / S))],
        ]
    )


@pytest.mark.parametrize("l", range(1, 7))
def test_rates_at_infinite_pressure_are_the_printed_ones(data, l):
    """SI lambdal with R0 = beta = eta_s = eta_b = 1, v_p' = -v_p."""
    rates = data["rates"]
    L, f0 = l * (l + 1), rates["v_p0"] * math.exp(-3)
    expected = 2 * L * 2 * 3 * f0 / (L * 3 - 2) - L * 0.03 - 1
    np.testing.assert_allclose(
        rates[f"lambda_{l} at infinite delta_P"], expected, rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("l", range(2, 7))
def test_rates_at_finite_pressure_are_the_eigenvalues(data, l):
    low = data["pressures"]["value"][1]
    for name, pressure in (("delta_P", 300.0), ("low delta_P", low)):
        for k in (10, 60, 120):
            matrix = shape_matrix(data["rates"]["v_p0"][k], pressure, l)
            expected = np.linalg.eigvals(matrix).real.max()
            assert data["rates"][f"lambda_{l} at {name}"][k] == pytest.approx(expected, abs=1e-10)


def test_mode_2_leads_below_the_critical_pressure_and_mode_1_above(data):
    onsets = data["onsets"]
    assert onsets["l"][np.nanargmin(onsets["v_p0 at low delta_P"])] == 2
    assert onsets["l"][np.nanargmin(onsets["v_p0 at delta_P"])] == 1
    at_star = mode_onsets(Parameters(delta_P=float(critical_pressure(Parameters()))), 2)
    assert at_star[2] == pytest.approx(at_star[1], rel=1e-9)


@pytest.mark.parametrize("l", range(2, 7))
def test_modes_are_neutral_at_their_onset(data, l):
    low = data["pressures"]["value"][1]
    onset = data["onsets"]["v_p0 at low delta_P"][l - 1]
    assert abs(np.linalg.eigvals(shape_matrix(onset, low, l)).real.max()) < 1e-9


def test_rates_do_not_depend_on_units(data):
    units = SYSTEMS["um, s, pN s^2/um"]
    base = Parameters()
    given = {key: getattr(base, key) / units.of(unit) for key, unit in DIMENSIONS.items()}
    found = figures.extra_modes.data(Parameters(**given))["rates"]
    for name, column in data["rates"].columns.items():
        size = units.of("L/T" if name == "v_p0" else "1/T")
        np.testing.assert_allclose(found[name] * size, column.values, rtol=1e-9, atol=1e-9)


def test_dots_of_the_drawing_lie_where_the_lines_cross_zero(data):
    for panel, name in zip(
        drawn(figures.extra_modes, data), ("delta_P", "low delta_P"), strict=True
    ):
        found = lines(panel)
        (dots,) = (line.get_xdata() for line in panel.lines if line.get_marker() == "o")
        crossed = 0
        for l in range(1, 7):
            x, y = found[f"$l = {l}$"]
            np.testing.assert_array_equal(y, data["rates"][f"lambda_{l} at {name}"])
            crossing = x[np.flatnonzero(np.diff(y > 0.0))]
            crossed += len(crossing)
            for at in crossing:
                assert np.abs(dots - at).min() < 1.01 * x[1]
        assert len(dots) == crossed
        assert panel.get_ylabel() == r"growth rate $λ_l$ [β]"
