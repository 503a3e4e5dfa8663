"""`amoeboid motility`: migration velocity of a cell in environments."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import add_parameters, only_parameters, print_json, say_parameters
from amoeboid.cli.tables import table, text, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.studies.migration import Migration

USUAL = "fluid,matrix,patch:30,channel:30"
# Numbers of each environment in the JSON document, under their names there.
KEYS = {
    "velocity": "speed",
    "velocity_over_max_retrograde_speed": "velocity_over_max_retrograde_speed",
    "vector": "velocity",
    "angular_velocity": "angular_velocity",
    "power": "power",
    "efficiency": "efficiency",
    "error": "error",
}
# How fast a cell with gamma_t, gamma_n or gamma_c moves by them.
OWN = (
    "With the friction of its own force balance the cell moves at {}.",
    "The environments above exclude this friction and do not act back on the flow.",
)
SHOWN = ("velocity", "velocity_over_max_retrograde_speed", "power", "efficiency", "error")
TITLES = {"velocity_over_max_retrograde_speed": "of max_retrograde_speed"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `motility`."""
    parser.add_argument(
        "state",
        nargs="?",
        type=Path,
        metavar="STATE",
        help="folder of a run, whose last cell is used, or a surface with vectors (.vtp); "
        "default: the fastest stable axisymmetric state of the parameters",
    )
    parser.add_argument(
        "--in",
        dest="environments",
        default=USUAL,
        metavar="LIST",
        help=f"environments, separated by commas (default: {USUAL})",
    )
    add_parameters(parser)
    parser.add_argument(
        "--flow", metavar="NAME", help="for a surface: name of the vector array with the flow"
    )
    parser.add_argument(
        "--units",
        metavar="LENGTH,TIME",
        help="for a surface: units of length and time of its numbers, such as um,s",
    )
    parser.epilog = (
        "environments (join several with +, as in patch:20+fluid):\n"
        "  fluid:VISCOSITY        unbounded viscous fluid\n"
        "  matrix:TANGENTIAL      drag along the surface (:normal=N for the drag along its normal, "
        ":per_filament=true for drag in proportion to c)\n"
        "  patch:HALF_ANGLE       adhesive patch on a substrate; half angle in degrees\n"
        "  plates:HALF_ANGLE      two parallel plates\n"
        "  channel:HALF_WIDTH     channel around the cell; half width of the contact in "
        "degrees\n"
        "  cortex                 uniform drag on the cortex\n"
        "Append :coupled=0.2 if only this share of the surface moves with the cortex. With "
        "--physical and for a run with units, values need units: --in 'fluid:1 mPa s'.\n"
        "columns:\n"
        "  velocity     towards the front, where the concentration is low\n"
        "  power        power that the surroundings dissipate\n"
        "  efficiency   towing power divided by this power\n"
        "  error        numerical error of the velocity\n"
        "examples:\n"
        "  amoeboid motility --set D=0.4 --set v_p0=6 --in fluid,patch:30\n"
        "  amoeboid motility --physical --set 'v_p0=2 um/s' --in 'fluid:1 mPa s'"
    )


def execute(args: argparse.Namespace) -> int:
    """Find the cell, print its velocities."""
    from amoeboid.studies.migration import migrations

    names = [name.strip() for name in args.environments.split(",")]
    if not all(names):
        raise InvalidInput(f"--in takes environments such as {USUAL}, got {args.environments!r}")
    if args.state is None or Path(args.state).is_dir():
        for option in ("flow", "units"):
            if getattr(args, option) is not None:
                raise InvalidInput(f"--{option} needs a surface with vectors (.vtp); leave it out")
    if args.state is not None and (args.settings or args.physical):
        raise InvalidInput(
            "--set and --physical choose a steady state; a run or a surface has its own "
            "parameters; leave them out"
        )
    state, parameters = _state(args)
    with shown():
        found = dict(zip(names, migrations(state, names), strict=True))
    own = _own_velocity(state, parameters)
    if args.json:
        print_json(_document(found) | own)
        return 0
    if parameters is not None:
        say_parameters(parameters)
    if not next(iter(found.values())).polarized:
        from amoeboid.studies.migration import UNPOLARIZED

        say(UNPOLARIZED)
        return 0
    _print_table(found)
    if own:
        unit = next(iter(found.values())).unit("speed")
        speed = f"{text(own['friction_velocity'])} {unit}".rstrip()
        say("", *(line.format(speed) for line in OWN))
    return 0


def _own_velocity(state: Any, parameters: Any) -> dict[str, float]:
    """The velocity towards the front by the friction of the force balance itself, if it has some.

    As programs read it: a number in the unit of the other velocities.
    """
    if parameters is None or not parameters.has_friction:
        return {}
    from amoeboid.studies.migration import friction_speed

    return {"friction_velocity": friction_speed(state)}


def _state(args: argparse.Namespace) -> tuple[Any, Any]:
    """What moves, and its parameters if it has some."""
    if args.state is None:
        from amoeboid.studies.states import steady_states

        p = only_parameters(args)
        with shown() as watch:
            found = steady_states(p, (1,), watch)
        for problem in found.problems:
            tell("motility", problem)
        stable = [state for state in found if state.stable]
        if not stable:
            tell("motility", "no stable state was found; results are for the fastest unstable one")
        return (stable or found)[-1], p
    if args.state.is_dir():
        from amoeboid.runs.stored import load

        run = load(args.state)
        return run.final, run.parameters
    if not args.state.exists():
        raise InvalidInput(
            "STATE must be the folder of a run or a surface with vectors (.vtp), got "
            f"{str(args.state)!r}, which does not exist; for a steady state give its parameters "
            "with --set"
        )
    from amoeboid.motility.cells import MeasuredCell

    length, time = _units(args.units)
    return MeasuredCell.from_file(str(args.state), args.flow, length=length, time=time), None


def _units(given: str | None) -> tuple[str | None, str | None]:
    if given is None:
        return None, None
    parts = [part.strip() for part in given.split(",")]
    if len(parts) != 2 or not all(parts):
        raise InvalidInput(f"--units takes a length and a time such as um,s, got {given!r}")
    return parts[0], parts[1]


def _document(found: dict[str, Migration]) -> dict[str, Any]:
    one = next(iter(found.values()))
    document: dict[str, Any] = {
        "environments": {
            name: {key: _number(m.number(source)) for key, source in KEYS.items()}
            for name, m in found.items()
        },
        "polarized": one.polarized,
        "front": one.front.tolist(),
        "squirmer_modes": one.number("squirmer_modes"),
        "beta": one.number("beta"),
    }
    sources = {**KEYS, "squirmer_modes": "squirmer_modes"}
    units = {key: unit for key, source in sources.items() if (unit := one.unit(source))}
    return document | ({"units": units} if units else {})


def _number(value: Any) -> Any:
    """A number as JSON has it: an infinite one is null."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _print_table(found: dict[str, Migration]) -> None:
    one = next(iter(found.values()))
    titles = ["environment"]
    for key in SHOWN:
        unit = one.unit(KEYS[key])
        titles.append(f"{TITLES.get(key, key)} [{unit}]" if unit else TITLES.get(key, key))
    rows: list[Sequence[str]] = [
        [name, *(text(m.number(KEYS[key])) for key in SHOWN)] for name, m in found.items()
    ]
    say(*table(titles, rows, "<", width()), "")
    modes = one.number("squirmer_modes")
    unit = one.unit("squirmer_modes")
    listed = ", ".join(text(mode) for mode in modes)
    say(f"Squirmer modes B_1 to B_{len(modes)}: {listed}{f' {unit}' if unit else ''}")
    say(f"beta = B_2/|B_1| = {text(one.number('beta'))}")
