"""The options that every command shares: `--set` and `--json`."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from amoeboid.cli.output import say
from amoeboid.cli.tables import width
from amoeboid.config import Config, with_settings
from amoeboid.model.cues import Cue
from amoeboid.model.parameters import RELATIONS, Parameters
from amoeboid.sections import Initial, Mesh, Noise, Output, Time
from amoeboid.validation import InvalidInput, is_text, rule

ANY_FIELD = ", or any other field of the configuration, such as time.end=50"

# nan and inf are numbers that every option refuses with its own range.
NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf)", re.ASCII)
QUANTITY = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)? ?[A-Za-z\u00b5\u03bc(*/].*")
WHOLE_NUMBER = re.compile(r"[+-]?\d{1,18}", re.ASCII)


def add_settings(parser: argparse.ArgumentParser, others: str = ANY_FIELD) -> None:
    """Add `--set name=value` (repeatable) and `--json`."""
    parser.add_argument(
        "--set",
        dest="settings",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="set a parameter: D=0.03, law=inverse, 'law=v_p0/(1+(c/c_r)**n)' with law.n=3, "
        f"'stress=k*c**2' with stress.k=0.3{others}; repeatable",
    )
    add_json(parser)


def add_json(parser: argparse.ArgumentParser) -> None:
    """Declare --json."""
    parser.add_argument(
        "--json", action="store_true", help="print only one JSON object on standard output"
    )


def real(text: str) -> float:
    """An option's number as people write it; `float` takes 1_000 and digits of any script too."""
    if not NUMBER.fullmatch(text.strip()):
        raise argparse.ArgumentTypeError(
            f"must be a number such as 0.03 or 1e-6, with a decimal point, got {text[:40]!r}"
        )
    return float(text)


def whole(text: str) -> int:
    """An option's whole number."""
    if not WHOLE_NUMBER.fullmatch(text.strip()):
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text[:40]!r}")
    return int(text)


def path(text: str) -> Path:
    """An option's path."""
    if not text.strip():
        raise argparse.ArgumentTypeError("a path must not be empty")
    if not is_text(text):
        raise argparse.ArgumentTypeError(
            f"a path must be UTF-8 text, got {text!r}; rename the file"
        )
    return Path(text)


def number_or_quantity(text: str) -> float | str:
    """An option's number, or a quantity with a unit such as "2 um/s", as it is written."""
    return text.strip() if QUANTITY.fullmatch(text.strip()) else real(text)


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """The same for a command that uses parameters alone, and `--physical`."""
    add_settings(parser, "")
    add_physical(parser)


def add_physical(parser: argparse.ArgumentParser) -> None:
    """Declare --physical."""
    parser.add_argument(
        "--physical",
        action="store_true",
        help="start from the paper's cell in physical units; --set then needs values with units "
        "('v_p0=2 um/s', 'c_r=8.5 umol/l * 190 nm'), and results are in um/s, 1/s, Pa, ...",
    )


def add_observables(parser: argparse.ArgumentParser) -> None:
    """Add `--observe NAME` (repeatable)."""
    parser.add_argument(
        "--observe",
        action="append",
        default=[],
        metavar="NAME",
        help="also show an observable: its name (polarity, reduced_volume, ...), or "
        "SCRIPT.py:NAME for one that your script registers (the script is executed); "
        "repeatable",
    )


def observables_shown(args: argparse.Namespace, p: Parameters) -> tuple[str, ...]:
    """The observables that tables show, those of `--observe` last. Raises InvalidInput."""
    from amoeboid.cli.scripts import observed_names
    from amoeboid.studies import observed
    from amoeboid.studies.states import shown

    return tuple(dict.fromkeys((*shown(p), *observed.checked(observed_names(args.observe)))))


def only_parameters(args: argparse.Namespace) -> Parameters:
    """The parameters that `--set` gives, starting from the paper's parameter table.

    With `--physical` they start from the paper's cell, and values have units. Raises InvalidInput
    for any other field of the configuration: it would change nothing.
    """
    return parameters_from(args.settings, args.physical, Parameters())


def parameters_from(settings: Sequence[str], physical: bool, base: Parameters) -> Parameters:
    """The same from `base`, or from the paper's cell. Raises InvalidInput.

    Of a base in physical units all values have units, with `physical` or without.
    """
    if physical or base.units is not None:
        return Parameters.physical(**(_own_quantities(base) | quantities(settings)))
    start = Config(parameters=base)
    for setting in settings:
        section, dot, _ = setting.partition("=")[0].strip().partition(".")
        if dot and section not in ("parameters", *RELATIONS):
            with_settings(start, [setting])  # what is no field at all is refused as such
            raise InvalidInput(
                f"--set takes only parameters here, got {setting!r}, which only `amoeboid run` "
                "uses; leave it out"
            )
    return with_settings(start, settings).parameters


def _own_quantities(base: Parameters) -> dict[str, Any]:
    """What is not as in the paper's cell, of parameters in physical units; else nothing."""
    if base.units is None:
        return {}
    usual = Parameters.physical().quantities()
    return {name: q for name, q in base.quantities().items() if q != usual.get(name)}


def quantities(settings: Sequence[str]) -> dict[str, str]:
    """{name: text} from name=value settings; values keep their units. Raises InvalidInput."""
    found = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or not name.strip() or not text.strip():
            raise InvalidInput(f"--set takes name=value, got {setting!r}")
        found[name.strip()] = text.strip()
    return found


def say_parameters(p: Parameters, varied: Sequence[str] = ()) -> None:
    """Print the parameters that count, in one line or, where it is too narrow, in several.

    `varied`: names whose values differ from row to row of what follows.
    """
    line = p.description
    for name in varied:
        line = re.sub(rf"\b{re.escape(name)} = [^,]*", f"{name} varies", line, count=1)
    say(*in_lines(line.split(", ")), "")


def in_lines(parts: Sequence[str]) -> list[str]:
    """Parts with commas between them, in as few lines as they fit in; none is cut."""
    limit = width()
    lines = [parts[0]]
    for part in parts[1:]:
        longer = f"{lines[-1]}, {part}"
        if limit is None or len(longer) < limit:
            lines[-1] = longer
        else:
            lines[-1] += ","
            lines.append(part)
    return lines


def print_json(result: dict[str, Any]) -> None:
    """Print one JSON object; NaN or infinity in it is an internal error."""
    say(json.dumps(result, allow_nan=False))


def _about(f: Field[Any]) -> str:
    """Meaning, dimension and range of a field; "finite number" and "left out" go without saying."""
    dimension = f.metadata.get("unit", "")
    shown = f" [{dimension}]" if dimension not in ("", "1") else ""
    accepted = rule(f).removesuffix(", or left out").removeprefix("a finite number").strip()
    return f"{f.metadata['doc']}{shown}{f' ({accepted})' if accepted else ''}"


def field_table() -> str:
    """All fields of the configuration with defaults, ranges and meanings, for help texts."""
    rows = []
    default = Config()
    for section in (Parameters, Mesh, Initial, Time, Output, Noise, Cue):
        name = section.__name__.lower()
        prefix = "" if section is Parameters else f"{name}."
        for f in fields(section):
            if "kind" in f.metadata:
                value = getattr(getattr(default, name), f.name)
                if value is None:
                    value = "automatic" if "automatic" in f.metadata else "none"
                elif value == ():
                    value = "none"
                rows.append(f"  {prefix + f.name:24}{value!s:18}{_about(f)}")
        if section is Parameters:
            rows.append(
                f"  {'law':24}{'exponential':18}polymerization law: exponential, inverse, "
                "or an expression in c"
            )
            rows.append(
                f"  {'stress':24}{'none':18}active isotropic stress in addition to chi and alpha: "
                "none, saturating, or an expression in c"
            )
            rows.append(
                f"  {'law.NAME, stress.NAME':24}{'':18}parameters of the law or stress, such as n "
                "of law=v_p0/(1+(c/c_r)**n)"
            )
    rows.append(
        f"  {'environment.medium':24}{'cortex':18}environment in which the path of the cell is "
        "recorded: fluid, matrix, patch:30, channel:30, ... (see `amoeboid motility --help`)"
    )
    rows.append(
        f"  {'changes.NAME':24}{'none':18}time course of a parameter or of cue.strength (a list "
        f"of [time, value] for jumps, or {{ramp = [[time, value], ...]}} for straight lines)"
    )
    return "\n".join(rows)
