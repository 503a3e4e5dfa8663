"""`amoeboid run`: a 3D simulation into a folder."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.program import INTERRUPTED
from amoeboid.cli.settings import add_settings, field_table, print_json
from amoeboid.config import Config, anchored, config_from_toml, shortest_step, with_settings
from amoeboid.validation import InvalidInput, is_text

if TYPE_CHECKING:
    from amoeboid.simulation import Step
    from amoeboid.store import Run

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
        help="sections [parameters] [mesh] [initial] [time] [output]; what it leaves out keeps its "
        "default",
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
        "130 interrupted (go on with --resume)"
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
        raise InvalidInput("--resume goes on in its own folder; leave out CONFIG.toml and -o")
    began = time.perf_counter()
    run, first = _resumed(args) if args.resume is not None else _started(args)
    with _failure_recorded(run):
        last, status, why = _simulate(run, first)
        summary = _summary(run, last, time.perf_counter() - began)
        run.write_manifest(status, ended=why, t=last.state.t, summary=summary)
    _draw(run, last)
    if status != "finished":
        print(f"amoeboid run: {status}: {why}", file=sys.stderr)
        print(f"amoeboid run: the last good state is in {run.folder}", file=sys.stderr)
    if args.json:
        print_json(summary | {"status": status})
    else:
        _print_summary(summary, last, why)
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
        "output": str(run.folder),
    }


def _started(args: argparse.Namespace) -> tuple[Run, Step]:
    from amoeboid.simulation import start
    from amoeboid.store import new_folder, new_run, text_of

    config = Config()
    if args.config is not None:
        config = anchored(
            config_from_toml(text_of(args.config), repr(str(args.config))), args.config.parent
        )
    config = with_settings(config, args.settings)
    first = start(config)
    return new_run(new_folder(args.output), config), first


def _resumed(args: argparse.Namespace) -> tuple[Run, Step]:
    from amoeboid.store import resumed_run, stored_config

    config = with_settings(stored_config(args.resume), args.settings)
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
    from amoeboid.simulation import Diverged, evolve

    last, status, why = first, "finished", ""
    if not run.frame_times:
        run.append(first)
        run.save(first)
    try:
        with _interruptible() as interruption, _progress(run) as report:
            for step in evolve(first, run.config.time, [interruption]):
                last, why = step, step.ended or ""
                if run.row_due(step):
                    report(run.append(step))
                if run.frame_due(step):
                    run.save(step)
    except Diverged as error:
        status, why = "diverged", str(error)
    if why == INTERRUPTION:
        status, why = "interrupted", f"stopped at t = {last.state.t:.6g}"
    if run.frame_times[-1][0] < last.state.t:
        if run.rows[-1]["step"] < last.number:
            run.append(last)
        run.save(last)
    return last, status, why


@contextmanager
def _failure_recorded(run: Run) -> Iterator[None]:
    """Note in the folder that its disk was full, or the like, if that is still possible."""
    try:
        yield
    except OSError as error:
        with suppress(OSError):
            run.write_manifest("failed", ended=str(error), t=run.rows[-1]["t"])
        raise


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
    """A progress bar on standard error; yields a function that takes rows of the time series."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("t = {task.completed:.2f} of at most {task.total:g}"),
        BarColumn(bar_width=24),
        TextColumn("dt {task.fields[dt]:.3g}  speed {task.fields[speed]:.4f}  at most"),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        start = run.rows[-1]
        task = progress.add_task(
            "",
            total=run.config.time.end,
            completed=int(start["t"]),
            dt=0.0,
            speed=start["max_retrograde_speed"],
        )

        def report(row: dict[str, float]) -> None:
            speed = row["max_retrograde_speed"]
            progress.update(task, completed=row["t"], dt=row["dt"], speed=speed)

        yield report


def _draw(run: Run, last: Step) -> None:
    from amoeboid.plotting.cell import save_cell_picture
    from amoeboid.plotting.trajectory import save_trajectory_picture

    times, positions = [row["t"] for row in run.rows], [[row[k] for k in "xyz"] for row in run.rows]
    try:
        save_cell_picture(run.folder / "cell.png", last)
        R0 = last.model.parameters.R0
        save_trajectory_picture(run.folder / "trajectory.png", times, positions, R0)
    except (RuntimeError, OSError) as error:
        print(f"amoeboid run: no picture, rendering failed: {error}", file=sys.stderr)


def _stability(last: Step) -> str:
    """Whether the state is steady, and what becomes of small disturbances of it."""
    if last.rest is None:
        return "the state is not steady: it still changes, or grows slowly from rest"
    if last.stability == "unknown":
        return f"the state is steady, but its stability is unknown: {last.stability_problem}"
    growth, error = last.growth or 0.0, last.growth_error or 0.0
    size = f"{abs(growth):.3g} +- {error:.1g} per unit of time"
    if last.stability == "stable":
        return f"the state is steady and stable: its slowest disturbance decays at {size}"
    if last.steady:
        return f"the state is steady but unstable: its fastest disturbance grows, slowly, at {size}"
    return f"the state is unstable: its fastest disturbance grows at {size}"


def _print_summary(summary: dict[str, Any], last: Step, why: str) -> None:
    from rich.console import Console
    from rich.table import Table

    meanings = {
        "max_retrograde_speed": "fastest flow along the surface, front to rear",
        "c_front": "filament concentration at the front",
        "c_rear": "filament concentration at the rear",
        "zeta0": "membrane tension",
        "area_error": "relative change of the membrane area",
    }
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, meaning in meanings.items():
        table.add_row(name, f"{summary[name]:.6g}", meaning)
    console = Console()
    console.print(table)
    console.print(_stability(last), highlight=False)
    console.print(
        f"{why} at t = {last.state.t:.4g}, {summary['steps']} steps, {summary['wall_s']:.2f} s",
        highlight=False,
    )
    console.print(
        f"output in {summary['output']}: cell.png, frames.pvd (ParaView), timeseries.csv",
        highlight=False,
    )
