"""Shape, fold and nu of a cell against its pressure."""

import numpy as np
import pytest

from amoeboid import InvalidInput, Parameters, figures
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures.gallery import extra_pressure
from amoeboid.figures.results import Results
from figures.drawn import drawn, lines


def test_range_of_physical_cells_is_that_of_the_parameter_table():
    """300 to 700 Pa with R0 = 10 um, eta_s = 2.7 mPa s m, beta = 0.1/s, by hand."""
    found = [float(Parameters.physical(delta_P=v).delta_P) for v in extra_pressure.PHYSICAL]
    np.testing.assert_allclose(found, np.array([300, 700]) * 10e-6 / (2.7e-3 * 0.1), rtol=1e-12)


@pytest.mark.parametrize(("pressure", "fold"), [(300.0, 5.20959845), (11.0, 5.00499426)])
def test_fold_and_nu_by_the_branch(pressure, fold):
    """Fold at 300: docs/numerics-axisymmetric.md; nu against its closed form."""
    p = Parameters(D=0.4, delta_P=pressure)
    found = extra_pressure.onset(p)
    assert found["fold"] == pytest.approx(fold, abs=1e-7)
    assert found["nu"] == pytest.approx(float(cubic_coefficient(p)), rel=1e-3)
    assert not found["problems"]


def test_cell_without_turnover_is_rejected():
    with pytest.raises(InvalidInput, match="beta must be > 0"):
        figures.extra_pressure.data(Parameters(beta=0.0))


@pytest.mark.slow
def test_soft_cells_deform_more_and_lose_their_stability():
    """Deformation 2.268 % at delta_P = 11, 0.097 % at 300 (docs/comparison-3d.md)."""
    data = figures.extra_pressure.data()
    shape, onset = data["shape"], data["onset"]
    order = np.argsort(shape["delta_P"])
    deformation = shape["deformation"][order]
    assert np.all(np.diff(deformation) < 0)
    at = np.interp(np.log([11.0, 300.0]), np.log(shape["delta_P"][order]), deformation)
    np.testing.assert_allclose(at, [0.02268, 0.00097], rtol=0.02)
    assert shape["stable"][order][-1]
    assert not shape["stable"][order][0]
    assert np.all(np.diff(onset["fold_in_thresholds"]) > 0)
    line = np.interp(onset["delta_P"], data["theory"]["delta_P"], data["theory"][extra_pressure.NU])
    np.testing.assert_allclose(onset[extra_pressure.NU], line, rtol=5e-3)
    assert onset["fold_in_thresholds"][0] == pytest.approx(4.080373 / 6.0256611, abs=1e-6)


def made_up_shapes(p, low, high):
    pressure = np.geomspace(low, high, 7)
    share = pressure / low
    return {
        "delta_P": pressure.tolist(),
        "deformation": (0.2 / share).tolist(),
        "aspect": (1.0 + 0.4 / share).tolist(),
        "stable": [False, False, True, True, True, True, True],
        "kind": ["state"] * 7,
        "piece": [0] * 7,
    }


def made_up_onset(p):
    """Without a fold at the lowest pressures."""
    threshold = float(critical_speed(p))
    known = p.delta_P > 10.0
    return {
        "fold": 0.9 * threshold if known else None,
        "nu": float(cubic_coefficient(p.replace(delta_P=300.0))),
        "problems": [] if known else ["no fold"],
    }


def test_drawing_leaves_out_folds_that_are_not_known_and_breaks_the_line_at_its_pole(monkeypatch):
    monkeypatch.setattr(extra_pressure, "shapes", made_up_shapes)
    monkeypatch.setattr(extra_pressure, "onset", made_up_onset)
    data = figures.extra_pressure.data(results=Results())
    low = data["onset"]["delta_P"] <= 10.0
    assert 0 < low.sum() == len(data.problems) < extra_pressure.FOLDS
    assert "no fold" in data.problems[0]
    above, middle, below = drawn(figures.extra_pressure, data)
    styles = {line.get_linestyle() for line in above.lines if len(line.get_xdata())}
    assert styles == {"-", "--"}  # stable and unstable
    folds = lines(middle)["fold"][1]
    np.testing.assert_array_equal(np.isnan(folds), low)
    np.testing.assert_allclose(folds[~low], 0.9, rtol=1e-12)
    # the closed form diverges where modes 1 and 2 share a threshold: both sides, no line between
    nu = lines(below)["theory"][1]
    assert np.isnan(nu).any()
    assert np.nanmax(np.abs(nu)) < extra_pressure.BROKEN * np.nanmax(
        np.abs(data["onset"][extra_pressure.NU])
    )
    first, last = above.get_xlim()
    assert first < extra_pressure.LOW < extra_pressure.HIGH < last
