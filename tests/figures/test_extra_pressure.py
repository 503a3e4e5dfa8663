"""Shape, fold and nu of a cell against its pressure."""

import numpy as np
import pytest

from amoeboid import InvalidInput, Parameters, figures
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.figures.gallery import extra_pressure


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
