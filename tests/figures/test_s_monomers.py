"""The monomer estimate: numbers of the SI, computed here without units, and both laws."""

import math

import numpy as np
import pytest

from amoeboid import Parameters, figures
from figures.drawn import drawn, lines

MOL = 6.02214076e23
PER_UM3 = MOL * 1e-6 * 1e-15  # 1 umol/l in monomers per um^3
B = 1.184 / 60  # um/s, SI eq_vp_lit
H = 0.19  # um


@pytest.fixture(scope="module")
def data():
    return figures.s_monomers.data()


def test_numbers_of_the_estimate_round_to_those_of_the_paper(data):
    """SI eqV1Numbers, eqRatioInVitro, eqRatioInVivo."""
    vitro, vivo = data["points"]["mu_bar"]
    assert vitro == pytest.approx(3 * PER_UM3 * H / 560, rel=1e-12)
    assert vivo == pytest.approx(8.5 * PER_UM3 * H / 1370, rel=1e-12)
    V_1 = data["points"]["v_p"] / data["points"]["mu_bar"]
    np.testing.assert_allclose(V_1, 1e3 * B * 560 / (3 * PER_UM3 * H), rtol=1e-12)
    assert [round(x, 2) for x in (vitro, vivo)] == [0.61, 0.71]
    assert round(V_1[0], 1) == 32.2


def test_the_paper_rounds_the_filament_concentration():
    """6700 filaments on 12 um^2 are 558.3 per um^2; with them V_1 = 32.1, not 32.2."""
    ratio, V_1 = figures.s_monomers.compute.__globals__["in_vitro"]("6700 / (12 um^2)")
    assert ratio == pytest.approx(3 * PER_UM3 * H / (6700 / 12), rel=1e-12)
    assert round(1e3 * V_1, 1) == 32.1


def test_inverse_law_is_the_line_of_the_experiment_and_the_exponential_law_meets_it(data):
    laws = data["laws"]
    np.testing.assert_allclose(laws["inverse"], laws["experiment"], rtol=1e-12, atol=1e-12)
    vivo, v_p = (data["points"][key][1] for key in ("mu_bar", "v_p"))
    found = np.interp(vivo, laws["mu_bar"], laws["exponential"])
    assert found == pytest.approx(v_p, rel=1e-3)  # linear between points of the curve
    expected = v_p * np.exp(1 / vivo - 1 / laws["mu_bar"][1:])
    np.testing.assert_allclose(laws["exponential"][1:], expected, rtol=1e-12)


def test_comet_slows_down_as_the_fit_says(data):
    t, v = data["comet"]["t"], data["comet"]["v_p"]
    np.testing.assert_allclose(v, 1e3 * B * np.exp(-1.248 * t / 60), rtol=1e-12)
    assert v[0] == pytest.approx(1184 / 60)


def test_estimate_does_not_depend_on_units(data):
    p = Parameters.physical()
    other = Parameters(c0=2e6 * p.c0, c_r=2e6 * p.c_r, R0=1e-3, delta_P=3.0)
    found = figures.s_monomers.data(other)
    for name in ("mu_bar", "exponential"):
        np.testing.assert_allclose(found["laws"][name], data["laws"][name], rtol=1e-12)
    assert math.isclose(found["points"]["v_p"][1], data["points"]["v_p"][1], rel_tol=1e-12)


def test_drawing_marks_both_estimates_on_the_lines_of_their_laws(data):
    (axes,) = drawn(figures.s_monomers, data)
    found = lines(axes)
    vivo = found[data["points"]["where"][1]]
    assert np.interp(vivo[0], *found["exponential law"]) == pytest.approx(vivo[1], rel=1e-3)
    assert np.interp(vivo[0], *found["inverse law"]) == pytest.approx(vivo[1], rel=1e-3)
    assert axes.get_ylabel() == "polymerization speed $v_p$ [nm/s]"
