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
        "data", type=Path, metavar="DATA.csv", help="measurements; see the columns below"
    )
    parser.add_argument(
        "--free", required=True, metavar="NAMES", help="parameters to find, such as D,v_p0,c0,beta"
    )
    add_parameters(parser)
    parser.add_argument(
        "--theta-from",
        default="front",
        choices=("front", "rear", "unknown"),
        help="pole from which theta is measured; the front has the low concentration (default: "
        "front)",
    )
    parser.add_argument(
        "--bounds",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="range in which a parameter is sought (default: a factor of 1000 to either side of "
        "its start)",
    )
    parser.add_argument(
        "--level", type=real, default=0.95, help="confidence level of the intervals (default: 0.95)"
    )
    parser.add_argument(
        "--starts",
        type=whole,
        default=3,
        help="number of starting points of the search (default: 3)",
    )
    parser.add_argument(
        "--seed", type=whole, default=0, help="seed of the random starting points (default: 0)"
    )
    add_plot(parser, "the fit")
    parser.epilog = (
        "columns of DATA.csv (entries may be empty):\n"
        "  theta [deg]               angle from the pole of --theta-from\n"
        "  u [um/s]                  retrograde flow, positive from front to rear\n"
        "  c [1/um^2] or c [a.u.]    filament concentration\n"
        "  zeta0 [mN/m], ...         any other observable\n"
        "  u_error [um/s], ...       standard deviation of that quantity\n"
        "  cell                      label, if there are several cells\n"
        "Columns without units are in the units of the parameters. With units, the search "
        "starts from the paper's cell, and --set takes values with units.\n"
        "Parameters that are not free keep their values: set the known ones with --set.\n"
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
        raise InvalidInput("--plot draws profiles, and the data have none; leave it out")
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
