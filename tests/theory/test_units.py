import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from amoeboid.closed_forms.linear import critical_speed, growth_rate
from amoeboid.model.parameters import DIMENSIONS, PARAMETER_NAMES, Parameters
from amoeboid.model.physical import PAPER_CELL
from amoeboid.model.units import in_unit, magnitude
from amoeboid.validation import InvalidInput

AVOGADRO = 6.02214076e23


def test_the_paper_cell_in_simulation_units():
    p = Parameters.physical()
    scales = p.units
    assert (p.R0, p.beta, p.eta_s, p.c_r) == (1, 1, 1, 1)
    # Numbers per um^2: 8.5e-6 mol/l of monomers in 0.19 um; 1 l = 1e15 um^3.
    reference = 8.5e-6 * AVOGADRO / 1e15 * 0.19
    assert p.c0 == pytest.approx(1370 / reference, rel=1e-12)
    assert pytest.approx(0.03 / (100 * 0.1), rel=1e-12) == p.D
    assert p.delta_P == pytest.approx(300 * 1e-5 / (2.7e-3 * 0.1), rel=1e-12)
    assert p.v_p0 == pytest.approx(1.7 / (10 * 0.1), rel=1e-12)
    assert scales.length == pytest.approx(1e-5)
    assert scales.time == pytest.approx(10)


def test_simulation_units_and_back():
    given = {"alpha": "4.16e-20 Pa m^3", "delta_P": "0.7 kPa", "eta_b": "1 mN s/m"}
    p = Parameters.physical(**given)
    back = p.quantities()
    assert set(back) == set(PARAMETER_NAMES)
    again = Parameters.physical(**back)
    for name in PARAMETER_NAMES:
        if name not in ("law", "stress"):
            assert getattr(again, name) == pytest.approx(getattr(p, name), rel=1e-12)
    assert back["alpha"].to("Pa m^3").magnitude == pytest.approx(4.16e-20)
    assert back["delta_P"].to("Pa").magnitude == pytest.approx(700)


def test_results_do_not_depend_on_the_units_of_the_input():
    metric = Parameters.physical(alpha="4e-20 Pa m^3")
    scales = metric.units
    other = Parameters.physical(
        R0="1e-2 mm", beta="6 / min", alpha="40 zPa m^3", c0="1.37e11 / cm^2"
    )
    assert critical_speed(other) == pytest.approx(critical_speed(metric), rel=1e-12)
    # The scaled model is the same model: lambda in 1/s computed in SI units directly.
    si = {k: metric.quantities()[k].to_base_units().magnitude for k in DIMENSIONS}
    direct = growth_rate(Parameters(**si), 1)
    assert in_unit(float(growth_rate(metric, 1)), "1/T", scales, "1/s") == pytest.approx(
        float(direct), rel=1e-10
    )


def test_conserved_filaments_take_the_time_of_diffusion():
    scales = Parameters.physical(beta="0 / s").units
    assert scales.time == pytest.approx(100 / 0.03)


def test_pint_quantities_are_taken_as_they_are_read():
    registry = pint.application_registry.get()
    assert magnitude("3 umol/l * 190 nm", "1/um^2") == pytest.approx(343.26, rel=1e-4)
    with pytest.raises(InvalidInput, match="must be a number with a unit"):
        Parameters.physical(R0=registry)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"c0": "3 um"}, r"c0 must have the dimension N/L\^2, such as '1370 / um\^2', got '3 um'"),
        ({"v_p0": "2 Pa"}, "v_p0 must have the dimension L/T"),
        ({"R0": "10"}, "R0 must have the dimension L, .* got '10' .dimensionless"),
        ({"alpha": "1 Pa m^2"}, "alpha must have the dimension"),
        ({"D": "1 parrot"}, "D must be a number with a unit"),
        ({"D": "__import__('os')"}, "D must be a number with a unit"),
        ({"D": "1/0 um"}, "D must be a number with a unit"),
        ({"D": 3.0}, "D must be a number with a unit"),
        ({"D": "9**9**9 um^2/s"}, "D must be a number with a unit"),
        ({"D": "9^(9^9) um^2/s"}, "D must be a number with a unit"),
        ({"D": "9^99 um^2/s"}, "D must be a number with a unit"),
        ({"c0": "-1 / um^2"}, "c0 must be a finite number >= 0"),
        ({"v_p0": "1,7 um/s"}, "got '1,7 um/s': write a decimal point, not a comma"),
        ({"c0": "1,370 / um^2"}, "write a decimal point, not a comma"),
        ({"v_p0": "1_7 um/s"}, "'_' has no meaning in a quantity"),
        ({"v_p0": "1 7 um/s"}, "two numbers follow each other"),
        ({"v_p0": "1.7.3 um/s"}, "two numbers follow each other"),
        ({"v_p0": "1.7 um/s 2"}, "two numbers follow each other"),
        ({"v_p0": "1.7 10^-6 m/s"}, "two numbers follow each other"),
        ({"v_p0": "um/s"}, "the number is missing"),
        ({"v_p0": "nan um/s"}, "the number is missing"),
        ({"v_p0": "infinity um/s"}, "the number is missing"),
        ({"v_p0": "3 nan um/s"}, "it is not finite"),
        ({"v_p0": "1e400 um/s"}, "it is not finite"),
        ({"v_p0": "1.7 um/s + 1 um/s"}, "write one number, not a sum or a range"),
        ({"v_p0": "1.5-1.9 um/s"}, "write one number, not a sum or a range"),
        ({"v_p0": "1.7 +/- 0.2 um/s"}, "write one number, not a sum or a range"),
        ({"v_p0": "1.7(2) um/s"}, "operators or brackets are misplaced"),
        ({"v_p0": "1.7 um//s"}, "operators or brackets are misplaced"),
        ({"v_p0": "1.7; um/s"}, "';' has no meaning in a quantity"),
        ({"v_p0": "1.7 um/s # fast"}, "'#' has no meaning in a quantity"),
        ({"c0": "1'370 / um^2"}, "has no meaning in a quantity"),
        ({"v_p0": "\uff11.\uff17 um/s"}, "has no meaning in a quantity"),
        ({"v_p0": "\u0661 um/s"}, "has no meaning in a quantity"),
        ({"v_p0": "1.7 * 10^-12 m/s"}, "powers must be whole numbers of one digit"),
        ({"v_p0": "0x10 um/s"}, "unit is unknown"),
        ({"v_p0": "1.7j um/s"}, "unit is unknown"),
        ({"D": "0.03 um2/s"}, "unit is unknown, .* write squares as um.2"),
        ({"R0": "20 degC"}, "R0 must"),
        ({"R0": "(10 um"}, "R0 must be a number with a unit"),
        ({"R0": ""}, "it ends early"),
        ({"radius": "10 um"}, "unknown parameter 'radius'"),
        ({"beta": "0 / s", "D": "0 um^2/s"}, "beta or D must be > 0"),
    ],
)
def test_wrong_input_is_refused_and_named(given, message):
    with pytest.raises(InvalidInput, match=message):
        Parameters.physical(**given)


@pytest.mark.parametrize(
    ("value", "unit", "message"),
    [
        ([1.0, 2.0], "um", "R0 must be a number with a unit"),
        (float("nan"), "um", "it is not finite"),
        (20.0, "degC", "R0 must have the dimension L"),
    ],
)
def test_a_wrong_quantity_of_pint_is_refused_and_named(value, unit, message):
    with pytest.raises(InvalidInput, match=message):
        Parameters.physical(R0=pint.Quantity(value, unit))


@pytest.mark.parametrize(
    "text",
    [
        "1.7 um/s", "1.7um/s", "1.7 um / s", "1.7\tum/s", "1.7\u00a0um/s", " 1.7 um s^-1 ",
        "1.7 \u00b5m/s", "1.7 \u03bcm/s", "1.7 \u00b5m\u00b7s\u207b\u00b9",
        "1.7e-6 m/s", "1.7E-6 m/s", "+1.7 um/s", "0.85 um/s * 2", "2 * 0.85 um/s", "3.4 um/(2 s)",
        "(1.7 um)/s", "1.7 * 10^-6 m/s", "1.7 micrometer per second", "102 um/min",
        "17000 \u212b/s",
    ],
)  # fmt: skip
def test_the_same_speed_is_read_in_many_ways(text):
    assert magnitude(text, "um/s") == pytest.approx(1.7, rel=1e-12)


@pytest.mark.parametrize("registry", [pint.application_registry.get, pint.UnitRegistry])
def test_the_same_speed_is_read_from_a_quantity_of_any_registry(registry):
    quantities = registry()
    for value, unit in ((1.7, "um/s"), (1.7e-3, "mm/s")):
        quantity = quantities.Quantity(value, unit)
        assert magnitude(quantity, "um/s") == pytest.approx(1.7, rel=1e-12)


@given(
    st.decimals(min_value="0.001", max_value="1000", places=3),
    st.sampled_from(",_'\u2019;:\u066b\u00a0 "),
    st.integers(0, 999),
)
def test_a_number_with_something_in_it_is_never_another_number(number, sign, rest):
    """A comma, or what stands between thousands: pint skips what it does not know."""
    with pytest.raises(InvalidInput, match="must be a number with a unit"):
        magnitude(f"{number}{sign}{rest:03d} um", "um")


def test_magnitude_refuses_another_dimension():
    with pytest.raises(InvalidInput, match="measurable in um"):
        magnitude("3 s", "um")


def test_the_paper_cell_names_every_parameter():
    assert set(PAPER_CELL) == set(PARAMETER_NAMES)
