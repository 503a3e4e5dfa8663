"""Every number printed in the paper: as printed, as derived, and the erratum where they differ.

"SI" is the paper's supplement; names in backquotes are LaTeX labels. A printed number stands for
the interval that rounds to it. Titles of errata are headings of docs/errata.md.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from amoeboid.closed_forms.amplitude import bifurcation, cubic_coefficient
from amoeboid.closed_forms.branch import next_steady_amplitude, prediction
from amoeboid.closed_forms.dimensionless import dimensionless, viscosity_ratio
from amoeboid.closed_forms.linear import critical_speed, finite_pressure_rates, thresholds
from amoeboid.closed_forms.monomers import ExponentialDecay, monomer_ratio, speed_coefficients
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.config import Config, Mesh, figure_3d, resolved
from amoeboid.model.parameters import PAPER_CELL, Parameters
from amoeboid.model.units import in_unit, magnitude

ERRATA = Path(__file__).parents[2] / "docs" / "errata.md"
TABLE = Parameters()


@dataclass(frozen=True)
class Printed:
    """value: as printed, a text so that its digits count; where: the place; derived: our value."""

    value: str
    where: str
    derived: Callable[[], float]
    erratum: str = ""

    @property
    def rounding(self):
        mantissa, _, exponent = self.value.partition("e")
        decimals = len(mantissa.partition(".")[2])
        return 0.5 * 10.0 ** (int(exponent or 0) - decimals)


def cell(quantity="critical", **changes):
    """A result for the paper's cell, in um/s."""
    p = Parameters.physical(**changes)
    rigid = infinite_pressure(p)  # the paper's amplitude equation
    speed = {
        "critical": lambda: critical_speed(p),
        "at threshold": lambda: prediction(rigid).max_retrograde_speed,
        "at v_p0": lambda: prediction(rigid).max_retrograde_speed_at_v_p0,
    }[quantity]
    return in_unit(float(speed()), "L/T", p.units, "um/s")


def elastic_resistance():
    """G h/c0 in Pa m^3."""
    return magnitude("300 Pa * 190 nm / (1370 / um^2)", "Pa m^3")


def in_vitro():
    """The fit of the growth in the microwell, in um, s and monomers per um^3."""
    return ExponentialDecay(
        B=magnitude("1.184 um/min", "um/s"),
        C=magnitude("1.248 / hour", "1/s"),
        mu_0=magnitude("3 umol/l", "1/um^3"),
    )


H = 0.19  # um, cortex thickness
FORMULA = "The threshold with elastic resistance"
STIFFNESS = "The size of the elastic resistance"

RESULTS = [
    Printed("0.19", "SI table: v_p bar", lambda: float(dimensionless(TABLE).v_p)),
    Printed("0.03", "SI table: D bar", lambda: float(dimensionless(TABLE).D)),
    Printed("3", "SI table: c0 bar", lambda: float(dimensionless(TABLE).c0)),
    Printed("1", "SI table: eta bar", lambda: float(viscosity_ratio(TABLE))),
    Printed("1.5", "SI, parameters: v_p^c in um/s", cell),
    Printed("0.17", "SI, parameters: v_0 in um/s", lambda: cell("at threshold")),
    Printed("0.17", "the same with the prefactor of `eq_v0_epsilon`, at v_p0",
            lambda: cell("at v_p0"), "The prefactor of the flow speed"),
    Printed("560", "SI, monomers: 6700 filaments in 12 um^2", lambda: 10 * round(6700 / 12 / 10)),
    Printed("32.2", "SI `eqV1Numbers`: V_1 in nm/s",
            lambda: 1e3 * speed_coefficients(in_vitro(), H, 560.0)[1]),
    Printed("0", "SI `eqV1`: V_0", lambda: speed_coefficients(in_vitro(), H, 560.0)[0]),
    Printed("0.61", "main text and SI `eqRatioInVitro`",
            lambda: float(monomer_ratio(in_vitro().mu_0, H, 560.0))),
    Printed("0.71", "main text and SI `eqRatioInVivo`",
            lambda: float(monomer_ratio(magnitude("8.5 umol/l", "1/um^3"), H, 1370.0))),
    Printed("1.4e-19", "SI, elastic resistance: alpha in Pa m^3", elastic_resistance, STIFFNESS),
    Printed("1.77", "SI, elastic resistance: v_p^c in um/s",
            lambda: cell(alpha=f"{elastic_resistance()} Pa m^3"), FORMULA),
    Printed("21", "SI, elastic resistance: increase of v_p^c in percent",
            lambda: 100 * (cell(alpha=f"{elastic_resistance()} Pa m^3") / cell() - 1), FORMULA),
]  # fmt: skip


@pytest.mark.parametrize("number", RESULTS, ids=lambda n: n.where)
def test_printed_result(number):
    off = abs(number.derived() - float(number.value))
    slack = 1e-12 * abs(float(number.value))
    if number.erratum:
        assert off > number.rounding, "no longer differs: drop the erratum"
        assert f"## {number.erratum}\n" in ERRATA.read_text(encoding="utf-8")
    else:
        assert off <= number.rounding + slack


# Derived values to more digits than the paper prints; each from this code's closed forms, which
# tests/theory derives from the model. They guard against drift.
VALUES = [
    ("exponential", {"D": 0.03}, 3.54844485643, -0.0130014430014),
    ("exponential", {"D": 0.4}, 6.02566107696, 0.0951219512195),
    ("inverse", {"D": 0.03}, 1.59, -0.0789264069264),
    ("inverse", {"D": 0.4}, 2.7, 0.0253658536585),
    ("exponential", {"D": 0.03, "beta": 0.0}, 0.200855369232, 0.00407407407407),
]


@pytest.mark.parametrize(("law", "changes", "v_p_critical", "nu"), VALUES)
def test_thresholds_and_nu_to_twelve_digits(law, changes, v_p_critical, nu):
    p = Parameters(law=law, **changes)
    assert critical_speed(p) == pytest.approx(v_p_critical, rel=3e-12)
    assert cubic_coefficient(infinite_pressure(p)) == pytest.approx(nu, rel=3e-12)


def test_other_values_to_many_digits():
    assert finite_pressure_rates(TABLE, 2)[0].real == pytest.approx(-0.327339486538, rel=3e-12)
    assert cell() == pytest.approx(1.46060025, abs=5e-9)
    assert 1e3 * speed_coefficients(in_vitro(), H, 560.0)[1] == pytest.approx(32.19309, abs=5e-6)
    assert monomer_ratio(magnitude("8.5 umol/l", "1/um^3"), H, 1370.0) == pytest.approx(
        0.709909, abs=5e-7
    )
    assert monomer_ratio(in_vitro().mu_0, H, 560.0) == pytest.approx(0.612968, abs=5e-7)
    assert elastic_resistance() == pytest.approx(4.16e-20, abs=5e-23)
    stiff = cell(alpha=f"{elastic_resistance()} Pa m^3")
    assert stiff == pytest.approx(1.614, abs=5e-4)
    assert 100 * (stiff / cell() - 1) == pytest.approx(10.5, abs=0.05)


def test_the_printed_1_77_and_21_percent_come_from_the_missing_factor():
    # Twice the elastic term of the correct threshold, with the correct alpha.
    wrong = cell() + 2 * (cell(alpha=f"{elastic_resistance()} Pa m^3") - cell())
    assert wrong == pytest.approx(1.77, abs=0.005)
    assert 100 * (wrong / cell() - 1) == pytest.approx(21, abs=0.5)
    # With the printed alpha instead, neither formula gives 1.77.
    assert cell(alpha="1.4e-19 Pa m^3") > 1.9


INPUTS = {
    "R0": 1.0, "delta_P": 300.0, "eta_s": 1.0, "eta_b": 1.0, "c0": 3.0, "c_r": 1.0,
    "beta": 1.0, "D": 0.03, "v_p0": 3.8,
}  # fmt: skip


@pytest.mark.parametrize(("name", "printed"), INPUTS.items())
def test_simulation_column_of_the_table(name, printed):
    assert getattr(TABLE, name) == printed


# (parameter, low, high, unit) of the last column of SI table `tab_params`, and single values.
RANGES = [
    ("R0", 10, 10, "um"),
    ("delta_P", 300, 700, "Pa"),
    ("eta_s", 2.7, 2.7, "mPa s m"),
    ("eta_b", 2.7, 2.7, "mPa s m"),
    ("c0", 100, 1400, "1/um^2"),
    ("beta", 0.1, 0.1, "1/s"),
    ("D", 0.03, 0.03, "um^2/s"),
    ("v_p0", 5e-3, 3, "um/s"),
]


@pytest.mark.parametrize(("name", "low", "high", "unit"), RANGES)
def test_paper_cell_lies_in_the_physical_column(name, low, high, unit):
    value = magnitude(PAPER_CELL[name], unit)
    assert low * (1 - 1e-12) <= value <= high * (1 + 1e-12)


def test_thresholds_of_the_cell_lie_in_the_range_of_polymerization_speeds():
    for alpha in ("0 Pa m^3", f"{elastic_resistance()} Pa m^3"):
        assert 5e-3 < cell(alpha=alpha) < 3
    p = Parameters.physical()
    assert bifurcation(p) == "supercritical"


def test_monomers_of_the_table_bracket_those_of_the_estimates():
    # 8.5 to 1200 umol/l in the table; 8.5 in vivo and 3 in vitro in the text.
    assert magnitude("8.5 umol/l * 190 nm", "1/um^2") == pytest.approx(
        magnitude(PAPER_CELL["c_r"], "1/um^2")
    )
    assert magnitude("3 umol/l", "1/um^3") < magnitude("8.5 umol/l", "1/um^3")


def test_physical_and_simulation_columns_are_different_cells():
    """Erratum "Two columns, two cells": bars of the physical column against the simulated ones."""
    assert "## Two columns, two cells\n" in ERRATA.read_text(encoding="utf-8")
    low = Parameters.physical()
    high = Parameters.physical(delta_P="700 Pa")
    assert dimensionless(low).delta_P == pytest.approx(11.1, abs=0.05)
    assert dimensionless(high).delta_P == pytest.approx(25.9, abs=0.05)
    assert dimensionless(TABLE).delta_P == 300
    assert pytest.approx(0.003) == dimensionless(low).D
    assert dimensionless(low).c0 == pytest.approx(1.41, abs=0.005)


def test_figure_3_of_the_main_text():
    # A: D = 0.03 supercritical; B: D = 0.4 subcritical; D: D = 0.4, v_p0 = 6.
    assert bifurcation(Parameters(D=0.03)) == "supercritical"
    assert bifurcation(Parameters(D=0.4)) == "subcritical"
    assert (figure_3d().D, figure_3d().v_p0) == (0.4, 6.0)
    # beta = 0, otherwise as in A: the SI finds it subcritical.
    assert bifurcation(Parameters(beta=0.0)) == "subcritical"
    # The inverse law polarizes earlier than the exponential one (SI, last figure).
    assert critical_speed(Parameters(law="inverse")) < critical_speed(Parameters())


def test_numerical_settings_of_the_SI():
    # 642 nodes; starts of 3 (upper branch) and 0.03 (lower branch and supercritical case).
    assert 10 * 4 ** Mesh().subdivisions + 2 == 642
    assert resolved(Config()).initial.perturbation == 3.0
    barrier = float(next_steady_amplitude(Parameters(D=0.4, v_p0=5.9)).amplitude)
    assert 0.03 < barrier < 3.0
    # Time step 1e-5: an explicit step must resolve the fastest shape mode that 642 nodes carry.
    spacing = math.sqrt(4 * math.pi / 642 * 2 / math.sqrt(3))
    fastest = finite_pressure_rates(Parameters(), int(np.pi / spacing))[1].real
    assert 1e-5 < 2 / -fastest < 1e-4


def test_mode_1_is_not_always_first():
    """Erratum "Which mode goes first"; the SI says that l = 1 always does."""
    assert "## Which mode goes first\n" in ERRATA.read_text(encoding="utf-8")
    soft = Parameters(delta_P=0.5)
    below = float(thresholds(soft).v_p0[0]) * 0.9
    assert finite_pressure_rates(soft.replace(v_p0=below), 2)[0].real > 0
