"""The parameter table: the code's values next to what the paper prints, and derived numbers."""

import math

import numpy as np
import pytest

from amoeboid import Parameters, figures
from amoeboid.model.parameters import DIMENSIONS
from unit_systems import SYSTEMS


@pytest.fixture(scope="module")
def table():
    return figures.table.data()["parameters"]


def value(table, symbol, column="cell"):
    (row,) = (k for k, s in enumerate(table["symbol"]) if s == symbol)
    return table[column][row]


def test_simulation_column_of_the_paper_is_what_the_code_uses(table):
    """SI tab_params, third column; 0.19 is 3.8 exp(-3) = 0.18919 rounded."""
    printed = [(k, text) for k, text in enumerate(table["paper_simulation"]) if text]
    assert len(printed) == 13
    for k, text in printed:
        digits = len(text.partition(".")[2])
        assert round(table["cell"][k], digits or 6) == float(text), table["quantity"][k]


def test_derived_numbers_follow_from_the_formulas(table):
    """SI eq_dimless_params_2, vpc and eq_non_linear_coefficient at the point of the table."""
    assert value(table, "v_p(c_0)/(R_0 β)") == pytest.approx(3.8 * math.exp(-3), rel=1e-12)
    assert value(table, "v_p^c") == pytest.approx(math.exp(3) / 3 * (0.03 + 0.5), rel=1e-12)
    c, D = 3.0, 0.03
    braces = (1.5 + 8 * D + 5 * D + 1) * c**2 - (5 + 12 * D + 3 + 8 * D) * c - (1 + 2 * D)
    nu = (2 * D + 1) * braces / (5 * c**2 * (1 + 12 * D + 6 * D))
    (row,) = (k for k, q in enumerate(table["quantity"]) if q.endswith("infinite pressure"))
    assert table["cell"][row] == pytest.approx(nu, rel=1e-12)


def test_physical_column_is_the_cell_of_the_estimates(table):
    """SI sec_parameters: v_p^c = 1.5 um/s; delta_P R0/(eta_s beta) by hand, 11.1."""
    assert round(value(table, "v_p^c", "physical_cell"), 1) == 1.5
    pressure = value(table, "ΔP R_0/(η_s β)", "physical_cell")
    assert pressure == pytest.approx(300 * 1e-5 / (2.7e-3 * 0.1), rel=1e-12)
    assert value(table, "c_0/c_r", "physical_cell") == pytest.approx(
        1370e12 / (8.5e-3 * 6.02214076e23 * 190e-9), rel=1e-12
    )
    units = dict(zip(table["symbol"], table["physical_cell_unit"], strict=True))
    assert units["v_p^c"] == "um/s"
    assert units["ΔP"] == "Pa"


@pytest.mark.parametrize("name", SYSTEMS)
def test_numbers_without_dimension_do_not_depend_on_units(table, name):
    units = SYSTEMS[name]
    base = Parameters()
    given = {key: getattr(base, key) / units.of(unit) for key, unit in DIMENSIONS.items()}
    found = figures.table.data(Parameters(**given))["parameters"]
    plain = [k for k, unit in enumerate(table["cell_unit"]) if not unit and table["derived"][k]]
    assert len(plain) == 10
    for k in plain:
        if isinstance(table["cell"][k], str):
            assert found["cell"][k] == table["cell"][k]
        else:
            np.testing.assert_allclose(found["cell"][k], table["cell"][k], rtol=1e-9)


def test_a_cell_without_threshold_has_a_table_that_says_so():
    data = figures.table.data(Parameters(law="v_p0*c/c_r"))
    assert value(data["parameters"], "v_p^c") is None
    assert any(note.startswith("threshold: ") for note in data.notes)
    assert value(data["parameters"], "ΔP R_0/(η_s β)") == 300.0
