"""`amoeboid run`: a 3D simulation into a folder."""

from __future__ import annotations

import argparse
import shlex
import signal
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from amoeboid.cli import garbage
from amoeboid.cli.documents import text_for
from amoeboid.cli.exit_codes import INTERRUPTED
from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import drawn_together
from amoeboid.cli.settings import (
    add_physical,
    add_settings,
    field_table,
    path,
    print_json,
    say_parameters,
)
from amoeboid.cli.tables import number, table, width
from amoeboid.config import Config, config_of, with_settings
from amoeboid.extras import check
from amoeboid.sections import Mesh
from amoeboid.validation import InvalidInput, refuse_unknown, toml_document

if TYPE_CHECKING:
    from pathlib import Path

    from amoeboid.output.folder import RunFolder
    from amoeboid.plotting.cell_painter import CellPainter
    from amoeboid.runs.advance import Outcome
    from amoeboid.simulation.step import Step

PICTURES = CELL, TRAJECTORY = "cell.png", "trajectory.png"
EXIT_CODES = {"finished": 0, "diverged": 1, "interrupted": INTERRUPTED}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `run`."""
    parser.add_argument(
        "config",
        nargs="?",
        type=path,
        metavar="CONFIG.toml",
        help="configuration with sections [parameters] [mesh] [initial] [time] [output] [noise] "
        "[cue] [environment] [changes]; omitted fields keep their defaults; with `physical = "
        'true` at its head, values have units (R0 = "8 um", end = "15 min")',
    )
    parser.add_argument(
        "-o",
        "--output",
        type=path,
        metavar="DIR",
        help="new or empty folder for the output (default: amoeboid-run, or amoeboid-run-2, ...)",
    )
    parser.add_argument(
        "--resume", type=path, metavar="DIR", help="continue the run in DIR to a later time.end"
    )
    parser.add_argument(
        "--until",
        dest="until",
        action="append",
        default=[],
        metavar="CONDITION",
        help="also end the run when this condition holds ('polarity > 0.5', 'c_front < 0.1*c0 "
        "and t > 5', for a cell with units \"t > '5 min'\"); repeatable",
    )
    parser.add_argument(
        "--observe",
        action="append",
        default=[],
        metavar="SCRIPT.py:NAME",
        help="also record this observable, which your script registers (the script is executed); "
        "repeatable",
    )
    add_settings(parser)
    add_physical(parser)
    parser.epilog = (
        "examples:\n"
        "  amoeboid run -o cell --set D=0.4 --set v_p0=6\n"
        "  amoeboid run --resume cell --set time.end=300\n"
        "  amoeboid run --physical --set 'R0=8 um' --set 'v_p0=1.3 um/s' --set 'time.end=15 min'"
        "\n\n"
        f"fields, their defaults and meanings:\n{field_table()}\n"
        "Automatic values follow from the parameters; rate is the fastest of beta, D/R0^2 and "
        "v_p(c0)/R0. L, T, M and N are the units of length, time, mass and filament number.\n\n"
        "exit codes:\n"
        "  0    finished\n"
        "  1    diverged; the last good frame is kept\n"
        "  2    wrong input\n"
        "  130  interrupted; continue with --resume\n"
        "Pictures are drawn last. A picture that cannot be drawn gives a message only."
    )


def execute(args: argparse.Namespace) -> int:
    """Run the simulation; returns the exit code."""
    with garbage.imports():
        from amoeboid.plotting.cell_painter import CellPainter
        from amoeboid.runs.advance import FINISHED, Outcome, advance_in_folder, concluded
        from amoeboid.runs.interruption import interruptible
        from amoeboid.runs.progress import reported

    if args.resume is not None and (args.config is not None or args.output is not None):
        raise InvalidInput("--resume continues in its own folder; leave out CONFIG.toml and -o")
    check("a simulation needs", "numba", "PIL")
    began = time.perf_counter()
    with garbage.imports():
        import amoeboid.numerics.dispatchers  # noqa: F401  (with numba)
    if args.observe:
        from amoeboid.cli.scripts import observed_names
        from amoeboid.observables import OBSERVABLES

        refuse_unknown(observed_names(args.observe), OBSERVABLES, "observable")
    run, first, ended = _resumed(args) if args.resume is not None else (*_started(args), "")
    p = run.config.parameters
    if not args.json:
        say_parameters(p)
    start, end = first.state.t, run.config.time.end
    signals = (signal.SIGINT, signal.SIGTERM)  # of a user; of a cluster at its time limit
    with CellPainter() as painter:
        if ended:  # and was killed before it had told so
            outcome = Outcome(first, FINISHED, ended)
            summary = concluded(run, outcome, began)
        else:
            with interruptible(signals) as interruption, reported(start, end, p) as report:
                outcome, summary = advance_in_folder(run, first, [interruption], report, began)
        _tell_results(run, outcome, summary, args.json)
        _draw(run, outcome.last, painter)
    return EXIT_CODES[outcome.status]


def _tell_results(run: RunFolder, outcome: Outcome, summary: dict[str, Any], as_json: bool) -> None:
    from amoeboid.runs.advance import FINISHED

    last, status, why = outcome.last, outcome.status, outcome.ended
    if status != FINISHED:
        tell("run", f"{status}: {why}")
        tell("run", f"the last good state is in {run.folder}")
    if EXIT_CODES[status] == INTERRUPTED:
        tell("run", f"to continue: {_resuming(run)}")
    if as_json:
        shape = {} if run.adapted is None else {"initial_shape": run.adapted}
        print_json(summary | shape | {"status": status})
    else:
        _print_summary(run, summary, last, why if status == FINISHED else status)


def _resuming(run: RunFolder) -> str:
    """The command that continues a run."""
    return f"amoeboid run --resume {shlex.quote(str(run.folder))}"


def _change(run: RunFolder, summary: dict[str, Any], why: str, t: float) -> str:
    """How fast a cell that is not steady changes, and how to follow it further."""
    from amoeboid.runs.words import change, per_time
    from amoeboid.simulation.events import END_OF_TIME
    from amoeboid.studies.columns import text

    p = run.config.parameters
    words = change(summary, per_time(p))
    if why == END_OF_TIME:
        later = shlex.quote(f"time.end={text(p, 2 * t, 'T')}")
        words += f"; to continue: {_resuming(run)} --set {later}"
    return words


def _started(args: argparse.Namespace) -> tuple[RunFolder, Step]:
    from amoeboid.output.folder import new_folder, new_run
    from amoeboid.simulation.loop import start

    document, folder = {}, None
    if args.config is not None:
        text, folder = text_for(args.config, "run"), args.config.parent
        document = toml_document(text, repr(str(args.config)))
    config = config_of(document, args.settings, args.physical, folder)
    config = _until(config, args.until)
    first = start(config)
    run = new_run(new_folder(args.output), config, first.adapted)
    _tell_adaptation(config, first, args.json)
    return run, first


def _until(config: Config, conditions: Sequence[str]) -> Config:
    until = (*config.time.until, *conditions)
    return replace(config, time=replace(config.time, until=until))


def _tell_adaptation(config: Config, first: Step, as_json: bool) -> None:
    """What was done to a shape from a file; that it was scaled stands in the JSON object.

    With the number of nodes, which `mesh.subdivisions` decides only for a repaired surface.
    """
    if first.adapted is None:
        return
    in_vain = config.mesh != Mesh()
    if not config.initial.repair and (in_vain or not as_json):
        why = "; mesh.subdivisions has no effect without initial.repair=true" if in_vain else ""
        tell("run", f"initial shape: {len(first.state.r)} nodes, those of the file{why}")
    scaling = None if as_json else first.adapted.scaling
    for text in (*first.adapted.repairs, *([scaling] if scaling else [])):
        tell("run", f"initial shape: {text}")


def _resumed(args: argparse.Namespace) -> tuple[RunFolder, Step, str]:
    """The run, its last step, and why it ended if it was killed after that, before all was told."""
    from amoeboid.output.folder import has_checkpoint, restarted_run, resumed_run, stored_config
    from amoeboid.runs.continuing import ended_already, least_end
    from amoeboid.simulation.events import END_OF_TIME

    config = stored_config(args.resume)
    if args.physical and config.parameters.units is None:
        raise InvalidInput(
            f"--physical needs a run with units, that in {str(args.resume)!r} has none; leave it "
            "out"
        )
    config = _until(with_settings(config, args.settings), args.until)
    if not has_checkpoint(args.resume):
        run, first = restarted_run(args.resume, config)
        ended = f"the run in {args.resume} had ended before its first checkpoint; it restarts"
        tell("run", ended)
        run.begin()
        return run, first, ""
    run, first = resumed_run(args.resume, config)
    done = ended_already(first, run.config.time)
    untold = not (args.settings or args.until) and _untold(args.resume)

    def shown(t: float) -> Any:
        return config.parameters.quantity(t, "T")

    least = least_end(first, run.config.time)
    ended = done or ("" if run.config.time.end > least else END_OF_TIME)
    if done is not None and not untold:
        remedy = "time.stop_when_steady=false" if done == "steady" else "time.until=[]"
        raise InvalidInput(
            f"the run in {str(args.resume)!r} has ended {done} at t = {shown(first.state.t):g}; to "
            f"continue, --set {remedy}"
        )
    if ended and not untold:
        raise InvalidInput(
            f"to continue the run in {str(args.resume)!r}, time.end must be > {shown(least):.9g}, "
            f"got {shown(run.config.time.end):.9g}; --set time.end to a later time"
        )
    run.begin()
    return run, first, ended


def _untold(folder: Path) -> bool:
    """Whether a run was killed before its summary was written or its pictures were drawn."""
    from amoeboid.output.folder import RUNNING
    from amoeboid.output.manifest import stored_manifest
    from amoeboid.runs.advance import FINISHED

    drawn = all((folder / name).exists() for name in PICTURES)
    return stored_manifest(folder).get("status") in ({RUNNING} if drawn else {RUNNING, FINISHED})


def _draw(run: RunFolder, last: Step, painter: CellPainter) -> None:
    import numpy as np

    from amoeboid.plotting.cell import save_cell_picture
    from amoeboid.plotting.trajectory import save_trajectory_picture
    from amoeboid.runs.words import environment
    from amoeboid.simulation.timeseries import position_columns
    from amoeboid.studies.columns import magnitude, unit

    p, names = run.config.parameters, position_columns(run.units)
    times = magnitude(p, np.array([row["t"] for row in run.rows]), "T")
    positions = magnitude(p, np.array([[row[k] for k in names] for row in run.rows]), "L")
    R0 = magnitude(p, p.R0, "L")
    units = ("", "") if p.units is None else (unit(p, "L"), unit(p, "T"))
    drawn_together(
        "run",
        {
            run.folder / TRAJECTORY: lambda file: save_trajectory_picture(
                file, times, positions, R0, units, environment(run.config)
            ),
            run.folder / CELL: lambda file: save_cell_picture(file, last, painter),
        },
    )


def _print_summary(run: RunFolder, summary: dict[str, Any], last: Step, why: str) -> None:
    from amoeboid.observables import units as observable_units
    from amoeboid.runs.words import per_time, stability
    from amoeboid.studies.columns import magnitude, text, unit

    meanings = {
        "max_retrograde_speed": "fastest flow along the surface",
        "c_front": "filament concentration at the front",
        "c_rear": "filament concentration at the rear",
        "zeta0": "membrane tension",
        "area_error": "relative change of the membrane area",
    }
    p, known = run.config.parameters, observable_units(meanings)
    units = {name: unit(p, dimension) for name, dimension in known.items()}
    rows = [(name, number(summary[name]), units[name], meanings[name]) for name in meanings]
    say(*table(("", "", "", ""), rows, "<<<<", width()))
    say(stability(last, per_time(p), float(magnitude(p, 1.0, "1/T"))))
    if last.rest is None:
        say(_change(run, summary, why, last.state.t))
    t, wall = text(p, last.state.t, "T", ".4g"), number(summary["wall_s"], 3)
    say(f"{why} at t = {t}, {summary['steps']} steps, {wall} s")
    say(f"output in {summary['output']}: cell.png, frames.pvd (ParaView), timeseries.csv")
