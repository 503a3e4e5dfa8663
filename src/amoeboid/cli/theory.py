"""`amoeboid theory`: thresholds, growth rates, bifurcation and predicted flow of one point."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say
from amoeboid.cli.settings import add_parameters, in_lines, only_parameters, print_json, quantities
from amoeboid.cli.tables import table, text, width

if TYPE_CHECKING:
    from amoeboid.studies.theory import Theory

# Names of the JSON document that differ from those of `Theory`.
KEYS = {"threshold": "v_p_critical"}

# Entries that the table has also where there is no such number.
ALWAYS = ("thresholds", "max_retrograde_speed")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `theory`."""
    add_parameters(parser)
    parser.epilog = (
        "examples:\n"
        "  amoeboid theory --set D=0.4 --set v_p0=6\n"
        "  amoeboid theory --physical --set 'v_p0=2 um/s'"
    )


def execute(args: argparse.Namespace) -> int:
    """Print what the theory says, as a table or as JSON."""
    from amoeboid.studies.theory import theory

    found = theory(only_parameters(args))
    parameters = _parameters(args, found)
    if args.json:
        print_json(_document(found) | parameters)
    else:
        _print_tables(found, parameters["parameters"])
    return 0


def _parameters(args: argparse.Namespace, found: Theory) -> dict[str, Any]:
    if not args.physical:
        return {"parameters": found.parameters.as_dict()}
    from amoeboid.model.physical import PAPER_CELL

    units = {KEYS.get(name, name): found.unit(name) for name, _ in found.numbers()}
    return {
        "parameters": {**PAPER_CELL, **quantities(args.settings)},
        "units": {name: unit for name, unit in units.items() if unit},
    }


def _document(found: Theory) -> dict[str, Any]:
    """The theory under the keys of the JSON contract; null where it has no such number."""
    document: dict[str, Any] = {
        KEYS.get(name, name): found.plain(name) for name, _ in found.numbers()
    }
    for name, value in document.items():
        if isinstance(value, dict):
            document[name] = {str(degree): v for degree, v in value.items()}
    return document | {"notes": list(found.notes)}


def _print_tables(found: Theory, parameters: dict[str, Any]) -> None:
    values = [f"{name} = {text(v)}" for name, v in parameters.items()]
    say(*in_lines([f"Theory at {values[0]}", *values[1:]]), "")
    units = found.parameters.units is not None
    rows = []
    for name, number in found.numbers():
        value = found.plain(name)
        if name in ALWAYS or not (value is None or isinstance(value, dict) or name in KEYS):
            shown = units and value is not None
            rows.append((number.title, text(value), found.unit(name) if shown else ""))
    say(*table(("", "", ""), rows, "<<<", width()), "")
    say(*_rates_table(found, f" [{found.unit('growth_rates')}]" if units else ""), "")
    say(*(f"Note: {note}." for note in found.notes))


def _rates_table(found: Theory, unit: str) -> list[str]:
    rows = []
    pairs = found.plain("growth_rates_finite_pressure")
    frequencies = found.plain("frequencies_finite_pressure")
    for degree, rate in found.plain("growth_rates").items():
        shown = "the same" if degree not in pairs else text(pairs[degree])
        if frequencies.get(degree, 0.0):
            shown += f" +- {text(frequencies[degree])}i"
        rows.append((str(degree), text(rate), shown))
    titles = ("l", f"growth rate, delta_P -> infinity{unit}", "slow, fast at delta_P")
    return table(titles, rows, "<<<", width())
