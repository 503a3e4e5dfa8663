"""`amoeboid theory`: thresholds, growth rates, bifurcation and predicted flow of one point."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say
from amoeboid.cli.settings import add_parameters, only_parameters, print_json
from amoeboid.cli.tables import table, text, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.closed_forms.summary import Summary
    from amoeboid.model.parameters import Parameters

# Dimension and physical unit of what is printed; a key that is missing has no dimension.
UNITS = {
    "v_p0": ("L/T", "um/s"),
    "v_p_critical": ("L/T", "um/s"),
    "thresholds": ("L/T", "um/s"),
    "growth_rates": ("1/T", "1/s"),
    "growth_rates_finite_pressure": ("1/T", "1/s"),
    "frequencies_finite_pressure": ("1/T", "1/s"),
    "first_mode_v_p0": ("L/T", "um/s"),
    "nu": ("L^4/(T N^2)", "um^4/s"),
    "nu_infinite_pressure": ("L^4/(T N^2)", "um^4/s"),
    "nu_5_infinite_pressure": ("L^8/(T N^4)", "um^8/s"),
    "m_2": ("L^2/N", "um^2"),
    "r_2": ("L^4/N^2", "um^4"),
    "amplitude": ("N/L^2", "1/um^2"),
    "max_retrograde_speed": ("L/T", "um/s"),
    "max_retrograde_speed_cubic": ("L/T", "um/s"),
    "max_retrograde_speed_at_v_p0": ("L/T", "um/s"),
    "max_retrograde_speed_next_order": ("L/T", "um/s"),
    "trusted_distance": ("L/T", "um/s"),
    "delta_P_star": ("M/(L T^2)", "Pa"),
    "zeta0": ("M/T^2", "mN/m"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `theory`."""
    add_parameters(parser)
    parser.add_argument(
        "--physical",
        action="store_true",
        help="start from the paper's cell in physical units; --set then takes a number with its "
        "unit ('v_p0=2 um/s', 'c_r=8.5 umol/l * 190 nm'), and results are in um/s, 1/s, Pa",
    )


def execute(args: argparse.Namespace) -> int:
    """Print what the theory says, as a table or as JSON."""
    from amoeboid.closed_forms.summary import summary

    if args.physical:
        from amoeboid.model.parameters import PAPER_CELL, Parameters

        given = _quantities(args.settings)
        p = Parameters.physical(**given)
        result = _in_physical_units(_result(summary(p)), p)
        result["parameters"] = {**PAPER_CELL, **given}
        result["units"] = {key: unit for key, (_, unit) in UNITS.items() if key in result}
    else:
        p = only_parameters(args)
        result = _result(summary(p))
        result["parameters"] = p.as_dict()
    if args.json:
        print_json(result)
    else:
        _print_table(result)
    return 0


def _quantities(settings: list[str]) -> dict[str, str]:
    """{name: text} from name=value settings; values keep their units."""
    quantities = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or not name.strip() or not text.strip():
            raise InvalidInput(f"--set takes name=value, got {setting!r}")
        quantities[name.strip()] = text.strip()
    return quantities


def _result(s: Summary) -> dict[str, Any]:
    """The summary under the keys of the JSON contract, and more."""
    result: dict[str, Any] = {
        "v_p_critical": float(s.thresholds.v_p0[0]) if s.thresholds.v_p0.size else None,
        "growth_rates": {str(degree): rate for degree, rate in s.growth_rates.items()},
        "growth_rates_finite_pressure": {
            str(degree): [rate.real for rate in pair]
            for degree, pair in s.finite_pressure_rates.items()
        },
        "frequencies_finite_pressure": {
            str(degree): abs(pair[0].imag) for degree, pair in s.finite_pressure_rates.items()
        },
        "nu": None,
        "nu_infinite_pressure": None,
        "bifurcation": None,
        "max_retrograde_speed": s.max_retrograde_speed,
        "delta_P_star": None,
        "thresholds": s.thresholds.v_p0.tolist(),
        "first_mode": s.first_mode.l if s.first_mode else None,
        "first_mode_v_p0": s.first_mode.v_p0 if s.first_mode else None,
        "zeta0": s.zeta0,
        "notes": list(s.notes),
    }
    if s.weakly is not None:
        predicted = s.weakly.prediction
        result |= {
            "nu": s.weakly.nu,
            "nu_infinite_pressure": s.weakly.nu_infinite_pressure,
            "nu_5_infinite_pressure": s.weakly.nu_5_infinite_pressure,
            "m_2": s.weakly.m_2,
            "r_2": s.weakly.r_2,
            "bifurcation": s.weakly.bifurcation,
            "bifurcation_infinite_pressure": s.weakly.bifurcation_infinite_pressure,
            "delta_P_star": s.weakly.delta_P_star,
            "trusted_distance": s.weakly.trusted_distance,
        }
        if predicted.state.exists:
            result |= {
                "amplitude": float(predicted.state.amplitude),
                "amplitude_stable": bool(predicted.state.stable),
                "max_retrograde_speed_cubic": float(predicted.max_retrograde_speed),
                "max_retrograde_speed_at_v_p0": float(predicted.max_retrograde_speed_at_v_p0),
                "max_retrograde_speed_next_order": float(predicted.next_order_speed)
                if predicted.next_order.exists
                else None,
                "relative_error": float(predicted.relative_error),
                "in_reach": bool(predicted.in_reach),
                "rho_2": s.weakly.rho_2,
            }
    return result


def _in_physical_units(result: dict[str, Any], p: Parameters) -> dict[str, Any]:
    def converted(value: Any, dimension: str, unit: str) -> Any:
        if isinstance(value, dict):
            return {key: converted(v, dimension, unit) for key, v in value.items()}
        if isinstance(value, list):
            return [converted(v, dimension, unit) for v in value]
        return None if value is None else float(p.quantity(value, dimension).to(unit).magnitude)

    return {
        key: converted(value, *UNITS[key]) if key in UNITS else value
        for key, value in result.items()
    }


# Rows of the table: key of the result, and what it is called.
ROWS = (
    ("thresholds", "thresholds v_p^c (lambda_1 = 0)"),
    ("first_mode", "mode that goes unstable first, l <= 6"),
    ("first_mode_v_p0", "... at v_p0 ="),
    ("delta_P_star", "delta_P* (l = 2 leads below it)"),
    ("zeta0", "membrane tension zeta_0 at rest"),
    ("nu", "cubic coefficient nu at delta_P"),
    ("bifurcation", "bifurcation at delta_P"),
    ("m_2", "second harmonic of c per a^2, m_2"),
    ("r_2", "rho_2 per a^2, r_2"),
    ("nu_infinite_pressure", "nu for delta_P -> infinity"),
    ("nu_5_infinite_pressure", "fifth-order coefficient, delta_P -> infinity"),
    ("bifurcation_infinite_pressure", "bifurcation for delta_P -> infinity"),
    ("trusted_distance", "cubic amplitude good to 10 % within"),
    ("amplitude", "amplitude of the polarized state"),
    ("amplitude_stable", "... is stable"),
    ("max_retrograde_speed_cubic", "its retrograde speed, prefactor at v_p^c"),
    ("max_retrograde_speed_at_v_p0", "... with the prefactor at v_p0"),
    ("max_retrograde_speed_next_order", "... by the next order"),
    ("relative_error", "estimated relative error of the cubic speed"),
    ("in_reach", "... the cubic theory reaches v_p0"),
    ("rho_2", "shape coefficient rho_2, r = R0 (1 + rho_2 P_2)"),
    ("max_retrograde_speed", "predicted max_retrograde_speed"),
)


def _print_table(result: dict[str, Any]) -> None:
    units = result.get("units", {})
    values = ", ".join(f"{name} = {text(v)}" for name, v in result["parameters"].items())
    say(f"Theory at {values}", "")
    say(*_quantities_table(result, units), "")
    say(*_rates_table(result, units), "")
    say(*(f"Note: {note}." for note in result["notes"]))


def _quantities_table(result: dict[str, Any], units: dict[str, str]) -> list[str]:
    rows = [(title, text(result[key]), units.get(key, "")) for key, title in ROWS if key in result]
    return table(("", "", ""), rows, "<<<", width())


def _rates_table(result: dict[str, Any], units: dict[str, str]) -> list[str]:
    unit = f" [{units['growth_rates']}]" if units else ""
    rows = []
    for degree, rate in result["growth_rates"].items():
        pair = result["growth_rates_finite_pressure"].get(degree)
        frequency = result["frequencies_finite_pressure"].get(degree, 0.0)
        shown = "the same" if pair is None else text(pair)
        if frequency:
            shown += f" +- {text(frequency)}i"
        rows.append((degree, text(rate), shown))
    titles = ("l", f"growth rate, delta_P -> infinity{unit}", "slow, fast at delta_P")
    return table(titles, rows, "<<<", width())
