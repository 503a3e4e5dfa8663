"""`amoeboid run`: a 3D simulation into a folder."""

from __future__ import annotations

import argparse
import math
import shlex
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.exit_codes import INTERRUPTED
from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import drawn
from amoeboid.cli.progress import shown_line
from amoeboid.cli.settings import add_settings, field_table, print_json
from amoeboid.cli.tables import number, table, width
from amoeboid.config import Config, anchored, config_from_toml, shortest_step, with_settings
from amoeboid.validation import InvalidInput, is_text

if TYPE_CHECKING:
    from amoeboid.output.folder import Run
    from amoeboid.simulation.loop import Step

SUMMARY = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "area_error")
FINISHED, DIVERGED = 0, 1
INTERRUPTION = "interrupted"
EXIT_CODES = {"finished": FINISHED, "diverged": DIVERGED, "interrupted": INTERRUPTED}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `run`."""
    parser.add_argument(
        "config",
        nargs="?",
        type=_path,
        metavar="CONFIG.toml",
        help="sections [parameters] [mesh] [initial] [time] [output] [changes] [cue]; what it "
        "leaves out keeps its default",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=_path,
        metavar="DIR",
        help="folder to write to, new or empty (default: amoeboid-run, or the next free number)",
    )
    parser.add_argument(
        "--resume", type=_path, metavar="DIR", help="go on with the run in DIR, to a later time.end"
    )
    add_settings(parser)
    parser.epilog = (
        f"fields, their defaults and meanings:\n{field_table()}\n\n"
        "exit codes: 0 finished, 1 diverged (the last good frame is kept), 2 wrong input,\n"
        "130 interrupted (go on with --resume); pictures are drawn last, and one that fails is a\n"
        "message only"
    )


def _path(text: str) -> Path:
    if not text.strip():
        raise argparse.ArgumentTypeError("a path must not be empty")
    if not is_text(text):
        raise argparse.ArgumentTypeError(f"a path must be text in UTF-8, got {text!r}; rename it")
    return Path(text)


def execute(args: argparse.Namespace) -> int:
    """Run the simulation; returns the exit code."""
    if args.resume is not None and (args.config is not None or args.output is not None):
        raise InvalidInput("--resume continues in its own folder; leave out CONFIG.toml and -o")
    began = time.perf_counter()
    run, first = _resumed(args) if args.resume is not None else _started(args)
    with run.failure_recorded():
        last, status, why = _simulate(run, first)
        summary = _summary(run, last, time.perf_counter() - began)
        run.write_manifest(status, ended=why, t=last.state.t, summary=summary)
    if status != "finished":
        tell("run", f"{status}: {why}")
        tell("run", f"the last good state is in {run.folder}")
    if args.json:
        shape = {} if run.adapted is None else {"initial_shape": run.adapted}
        print_json(summary | shape | {"status": status})
    else:
        _print_summary(summary, last, why)
    _draw(run, last)
    return EXIT_CODES[status]


def _summary(run: Run, last: Step, wall_s: float) -> dict[str, Any]:
    # the latest row is that of `last`: rows are appended step by step
    return {name: run.rows[-1][name] for name in SUMMARY} | {
        "steps": last.number,
        "wall_s": round(wall_s, 3),
        "steady": last.steady,
        "stability": last.stability,
        "stability_problem": last.stability_problem or None,
        "growth_rate": last.growth,
        "growth_rate_error": last.growth_error,
        "rate_of_change": last.rate * last.model.rate,
        "speed_growth": _speed_growth(run.rows, 1.0 / last.model.rate),
        "output": str(run.folder),
    }


def _speed_growth(rows: Sequence[dict[str, float]], unit: float) -> float | None:
    """Relative growth of max_retrograde_speed at the end [1/T], None for a cell without flow.

    Over the last half of a unit of time: the last step may be too short to tell.
    """
    last = rows[-1]
    first = next((row for row in reversed(rows) if row["t"] <= last["t"] - 0.5 * unit), rows[0])
    a, b = (row["max_retrograde_speed"] for row in (first, last))
    if min(a, b) <= 0.0 or not last["t"] > first["t"]:
        return None
    return math.log(b / a) / (last["t"] - first["t"])


def _change(summary: dict[str, Any], why: str, t: float) -> str:
    """How fast a cell that is not steady changes, and how to follow it further."""
    changes = number(summary["rate_of_change"], 3)
    text = f"shape or concentration changes at a relative rate of {changes}"
    growth = summary["speed_growth"]
    if growth is not None:
        word = "grows" if growth > 0 else "falls"
        text += f", max_retrograde_speed {word} at {number(abs(growth), 3)}"
    text += " per unit time"
    if why == "end of time":
        folder = shlex.quote(summary["output"])
        text += f"; to continue: amoeboid run --resume {folder} --set time.end={2 * t:g}"
    return text


def _started(args: argparse.Namespace) -> tuple[Run, Step]:
    from amoeboid.output.folder import new_folder, new_run, text_of
    from amoeboid.simulation.loop import start

    config = Config()
    if args.config is not None:
        config = anchored(
            config_from_toml(text_of(args.config), repr(str(args.config))), args.config.parent
        )
    config = with_settings(config, args.settings)
    first = start(config)
    run = new_run(new_folder(args.output), config, first.adapted)
    _tell_adaptation(first, args.json)
    return run, first


def _tell_adaptation(first: Step, as_json: bool) -> None:
    """What was done to a shape from a file; that it was scaled stands in the JSON object."""
    if first.adapted is None:
        return
    scaling = None if as_json else first.adapted.scaling
    for text in (*first.adapted.repairs, *([scaling] if scaling else [])):
        tell("run", f"initial shape: {text}")


def _resumed(args: argparse.Namespace) -> tuple[Run, Step]:
    from amoeboid.output.folder import has_checkpoint, restarted_run, resumed_run, stored_config

    config = with_settings(stored_config(args.resume), args.settings)
    if not has_checkpoint(args.resume):
        run, first = restarted_run(args.resume, config)
        ended = f"the run in {args.resume} had ended before its first checkpoint: it begins anew"
        tell("run", ended)
        run.begin()
        return run, first
    run, first = resumed_run(args.resume, config)
    if first.steady and config.time.stop_when_steady:
        raise InvalidInput(
            f"the run in {str(args.resume)!r} has ended steady at t = {first.state.t:g}; "
            "to go on, --set time.stop_when_steady=false"
        )
    least = first.state.t + shortest_step(run.config)
    if not run.config.time.end > least:
        raise InvalidInput(
            f"to go on with the run in {str(args.resume)!r} time.end must be > {least:.9g}, got "
            f"{run.config.time.end:.9g}; --set time.end to a later time"
        )
    run.begin()
    return run, first


def _simulate(run: Run, first: Step) -> tuple[Step, str, str]:
    """Step until the end; returns the last good step, the status and why it ended."""
    from amoeboid.simulation.loop import Diverged, evolve

    last, status, why = first, "finished", ""
    if not run.frame_times:
        run.take(first)
    try:
        with _interruptible() as interruption, _progress(run) as report:
            for step in evolve(first, run.config.time, [interruption]):
                last, why = step, step.ended or ""
                report(run.take(step))
    except Diverged as error:
        status, why = "diverged", str(error)
    if why == INTERRUPTION:
        status, why = "interrupted", f"stopped at t = {last.state.t:.6g}"
    run.save(last)
    return last, status, why


@contextmanager
def _interruptible() -> Iterator[Callable[[Step], str | None]]:
    """Let Ctrl-C and SIGTERM (a cluster's time limit) end the run after the present step.

    An exception in the middle of compiled code would be lost or leave half a step. A second
    signal ends the program at once.
    """
    received: list[int] = []

    def take(number: int, _: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)

    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, take) for number in signals]
    try:
        yield lambda _: INTERRUPTION if received else None
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def _progress(run: Run) -> Iterator[Any]:
    """Progress on standard error; yields a function that takes rows of the time series."""
    began, start, end = time.monotonic(), run.rows[-1]["t"], run.config.time.end

    with shown_line() as show:

        def report(row: dict[str, float] | None) -> None:
            if show is None or row is None:
                return
            done = max(row["t"] - start, 0.0) / (end - start)
            left = (time.monotonic() - began) * (1.0 / done - 1.0) if done > 0.0 else math.inf
            show(
                (
                    f"t = {number(row['t'], 4)} of at most {number(end)}",
                    f"speed {number(row['max_retrograde_speed'], 4)}",
                    f"dt {number(row['dt'], 3)}",
                    f"at most {_duration(left)} left",
                )
            )

        yield report


def _duration(seconds: float) -> str:
    """Hours, minutes and seconds."""
    if not seconds < 1e6:
        return "some time"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


def _draw(run: Run, last: Step) -> None:
    from amoeboid.output.folder import POSITION
    from amoeboid.plotting.cell import save_cell_picture
    from amoeboid.plotting.trajectory import save_trajectory_picture

    times = [row["t"] for row in run.rows]
    positions = [[row[k] for k in POSITION] for row in run.rows]
    R0 = last.model.parameters.R0
    drawn("run", run.folder / "cell.png", lambda path: save_cell_picture(path, last))
    drawn(
        "run",
        run.folder / "trajectory.png",
        lambda path: save_trajectory_picture(path, times, positions, R0),
    )


def _stability(last: Step) -> str:
    """Whether the state is steady, and what becomes of small perturbations of it."""
    if last.rest is None:
        return "the state is not steady: it still changes, or grows slowly from rest"
    if last.stability == "unknown":
        return f"the state is steady, but its stability is unknown: {last.stability_problem}"
    growth, error = last.growth or 0.0, last.growth_error or 0.0
    size = f"{number(abs(growth), 3)} +- {number(error, 1)} per unit time"
    if last.stability == "stable":
        return f"the state is steady and stable: its slowest perturbation decays at {size}"
    if last.steady:
        return f"the state is steady but unstable: a perturbation grows, slowly, at {size}"
    return f"the state is unstable: its fastest perturbation grows at {size}"


def _print_summary(summary: dict[str, Any], last: Step, why: str) -> None:
    from amoeboid.observables import UNITS

    meanings = {
        "max_retrograde_speed": "fastest flow along the surface",
        "c_front": "filament concentration at the front",
        "c_rear": "filament concentration at the rear",
        "zeta0": "membrane tension",
        "area_error": "relative change of the membrane area",
    }
    units = {name: "" if UNITS[name] == "1" else UNITS[name] for name in meanings}
    rows = [(name, number(summary[name]), units[name], meanings[name]) for name in meanings]
    say(*table(("", "", "", ""), rows, "<<<<", width()))
    say(_stability(last))
    if last.rest is None:
        say(_change(summary, why, last.state.t))
    t, wall = number(last.state.t, 4), number(summary["wall_s"], 3)
    say(f"{why} at t = {t}, {summary['steps']} steps, {wall} s")
    say(f"output in {summary['output']}: cell.png, frames.pvd (ParaView), timeseries.csv")
