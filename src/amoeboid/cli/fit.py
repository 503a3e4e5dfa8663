"""`amoeboid fit`: parameters of a cell from a table of measurements."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import PLOT_FAILS, add_plot, check_picture, drawn
from amoeboid.cli.progress import shown
from amoeboid.cli.settings import (
    add_parameters,
    number_or_quantity,
    only_parameters,
    print_json,
    real,
    say_parameters,
    whole,
)
from amoeboid.cli.tables import table, width
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.fitting.measurements import Measurements
    from amoeboid.fitting.result import Fit, Interval
    from amoeboid.model.parameters import Parameters


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `fit`."""
    parser.add_argument(
        "data", type=Path, metavar="DATA.csv", help="measurements; headings as u [um/s], see below"
    )
    parser.add_argument(
        "--free", required=True, metavar="NAMES", help="parameters to find, such as D,v_p0,c0,beta"
    )
    add_parameters(parser)
    parser.add_argument(
        "--theta-from",
        default="front",
        choices=("front", "rear", "unknown"),
        help="pole that theta counts from: the front has the low concentration (default: front)",
    )
    parser.add_argument(
        "--bounds",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="seek a parameter in this range (default: a factor of 1000 around its start)",
    )
    parser.add_argument("--level", type=real, default=0.95, help="of intervals (default: 0.95)")
    parser.add_argument(
        "--starts", type=whole, default=3, help="number of starts of the search (default: 3)"
    )
    parser.add_argument("--seed", type=whole, default=0, help="of the further starts (default: 0)")
    add_plot(parser, "the fit")
    parser.epilog = (
        "Columns of DATA.csv: theta [deg]; u [um/s], the retrograde flow from front to rear;\n"
        "c [1/um^2] or c [a.u.]; any observable (zeta0 [mN/m]); u_error [um/s] etc.; cell.\n"
        "Entries may be empty. Without units, numbers are in the units of the parameters. With\n"
        "units the search starts from the paper's cell, and --set takes quantities.\n"
        "Parameters that are not free keep their values: --set them to what is known of the cell.\n"
        f"{PLOT_FAILS}"
    )


def execute(args: argparse.Namespace) -> int:
    """Fit, print, draw."""
    from amoeboid.fitting.fit import fit
    from amoeboid.fitting.measurements import measurements

    check_picture(args.plot)
    if not 0 < args.level < 1:
        raise InvalidInput(f"--level must be a number between 0 and 1, got {args.level:g}")
    data = measurements(args.data, args.theta_from)
    if args.plot is not None and all(q.theta is None for q in data):
        raise InvalidInput("--plot draws profiles, the data have none; leave it out")
    args.physical = args.physical or data.physical
    p = only_parameters(args)
    names = [name.strip() for name in args.free.split(",") if name.strip()]
    with shown() as watch:
        found = fit(
            data,
            names,
            p,
            theta_from=args.theta_from,
            bounds=dict(map(_bounds, args.bounds)),
            starts=args.starts,
            seed=args.seed,
            watch=watch,
        )
        intervals = found.intervals(args.level, watch)
    for note in (*(c.text for c in found.undetermined), *found.problems):
        tell("fit", note)
    if args.json:
        print_json(_document(found, intervals))
    else:
        _say(data, p, found, intervals, args.level)

    def draw(path: Path) -> None:
        from amoeboid.plotting.fits import write_fit

        write_fit(found, path)

    return drawn("fit", args.plot, draw)


def _bounds(text: str) -> tuple[str, tuple[Any, Any]]:
    """{name: (low, high)} of NAME=LOW:HIGH. Raises InvalidInput."""
    name, equals, pair = text.partition("=")
    low, colon, high = pair.partition(":")
    if not equals or not colon:
        raise InvalidInput(f"--bounds takes NAME=LOW:HIGH, got {text!r}")
    try:
        return name.strip(), (number_or_quantity(low), number_or_quantity(high))
    except argparse.ArgumentTypeError as error:
        raise InvalidInput(f"--bounds {name.strip()}: {error}") from None


def _say(
    data: Measurements, p: Parameters, found: Fit, intervals: dict[str, Interval], level: float
) -> None:
    from amoeboid.studies.columns import titled

    say_parameters(p)
    say(found.heading)
    units = found.columns["unit"].values
    rows = []
    for name, unit in zip(found.unknowns, units, strict=True):
        value, error = found.plain(name)
        ends = [_end(end) for end in (intervals[name].low, intervals[name].high)]
        relative = found.relative_errors[name]
        rows.append(
            [
                titled(name, unit if p.units is not None else ""),
                f"{value:.6g}",
                "none" if error is None else f"{error:.2g}",
                "none" if error is None else f"{100 * relative:.2g} %",
                *ends,
            ]
        )
    titles = ["", "estimate", "standard error", "relative", f"{100 * level:g} % from", "to"]
    say(*table(titles, rows, "<", limit=width()))


def _end(value: Any) -> str:
    return "none" if value is None else f"{getattr(value, 'magnitude', value):.6g}"


def _document(found: Fit, intervals: dict[str, Interval]) -> dict[str, Any]:
    estimates = {}
    for name in found.unknowns:
        value, error = found.plain(name)
        interval = intervals[name]
        estimates[name] = {
            "estimate": value,
            "standard_error": error,
            "relative_error": None if error is None else found.relative_errors[name],
            "low": _plain(interval.low),
            "high": _plain(interval.high),
            "quadratic": interval.quadratic,
            "notes": list(interval.notes),
        }
    document: dict[str, Any] = {
        "estimates": estimates,
        "correlation": found.correlation.tolist(),
        "chi2": found.chi2,
        "dof": found.dof,
        "p_value": found.p_value,
        "undetermined": [
            {"powers": c.powers, "relative_sd": c.relative_sd, "exact": c.exact, "text": c.text}
            for c in found.undetermined
        ],
        "converged": found.converged,
        "problems": list(found.problems),
    }
    if found.orientation is not None:
        document["theta_from"] = found.orientation[0]
    if found.problem.start.units is not None:
        units = found.columns["unit"].values
        document["units"] = {
            name: unit for name, unit in zip(found.unknowns, units, strict=True) if unit
        }
    return document


def _plain(value: Any) -> float | None:
    return None if value is None else float(getattr(value, "magnitude", value))
