"""`amoeboid bench`: timings of the 3D solver, as ratios."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from amoeboid.cli.settings import add_settings, print_json
from amoeboid.config import FILES, Config, resolved, with_settings
from amoeboid.validation import InvalidInput


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `bench`."""
    add_settings(parser)
    parser.add_argument(
        "--subdivisions",
        type=_subdivisions,
        nargs="+",
        default=[3, 4, 5],
        metavar="N",
        help="meshes to time steps on, 10 * 4**N + 2 nodes each (default 3 4 5: 642, 2562, 10242; "
        "6 is 40962)",
    )
    parser.add_argument(
        "--steps", type=_count, default=10, metavar="K", help="steps to time on each mesh (10)"
    )
    parser.add_argument(
        "--explicit-steps",
        type=_count,
        default=1000,
        metavar="K",
        help="steps of the explicit scheme to time (1000)",
    )
    parser.add_argument(
        "--repetitions",
        type=_count,
        default=10,
        metavar="K",
        help="repetitions of the single force balance (10)",
    )
    parser.add_argument(
        "--peer-subdivisions",
        type=_subdivisions,
        nargs="+",
        default=[3, 4],
        metavar="N",
        help="meshes for the comparison with NGSolve (default 3 4)",
    )
    parser.epilog = (
        "Measured: the time of a step and of its phases on every mesh; the time of a run to its\n"
        "end (default: figure 3D on 642 nodes; --set changes it) against the explicit scheme of\n"
        "the paper, extrapolated from a number of its steps; a single force balance against\n"
        "NGSolve, if that is installed (pip install 'amoeboid[peers]')."
    )


def _subdivisions(text: str) -> int:
    return _integer(text, 1, 6)


def _count(text: str) -> int:
    return _integer(text, 1, 10**6)


def _integer(text: str, least: int, most: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(
            f"must be an integer from {least} to {most}, got {text[:40]!r}"
        )
    return value


def execute(args: argparse.Namespace) -> int:
    """Measure and print."""
    config = with_settings(Config(), args.settings)
    _check(resolved(config))
    from amoeboid.benchmarks.machine import machine
    from amoeboid.benchmarks.peers import Disagreement, compared_with_ngsolve
    from amoeboid.benchmarks.sizes import growth_exponents, step_times
    from amoeboid.benchmarks.steady_state import time_to_steady_state
    from amoeboid.simulation import Diverged

    try:
        sizes = []
        # ascending: the peak memory is that of the process so far
        for subdivisions in sorted(set(args.subdivisions)):
            _say(f"steps on {10 * 4**subdivisions + 2} nodes")
            sizes.append(step_times(config, subdivisions, args.steps))
        _say("the run to its end, and the explicit scheme beside it")
        steady_state = time_to_steady_state(config, args.explicit_steps)
        peers = []
        for subdivisions in sorted(set(args.peer_subdivisions)):
            _say(f"a force balance on {10 * 4**subdivisions + 2} nodes against NGSolve")
            peers.append(compared_with_ngsolve(config.parameters, subdivisions, args.repetitions))
    except (Diverged, Disagreement) as error:
        print(f"amoeboid bench: {error}", file=sys.stderr)
        return 1
    result = {
        "machine": machine(),
        "sizes": sizes,
        "growth_exponents": growth_exponents(sizes),
        "steady_state": steady_state,
        "peers": peers,
    }
    if args.json:
        print_json(result)
    else:
        _print(result)
    return 0


def _check(config: Config) -> None:
    """Raise InvalidInput for what cannot be compared."""
    for name in FILES:
        path = getattr(config.initial, name)
        if path is not None:
            raise InvalidInput(
                f"bench times spheres of several mesh sizes, initial.{name} must be left out, got "
                f"{path!r}; to time that start, use amoeboid run"
            )
    if config.time.scheme == "explicit":
        raise InvalidInput(
            "bench times the explicit scheme beside the other one, time.scheme must be "
            "semi-implicit, got 'explicit'; leave it out"
        )


def _say(what: str) -> None:
    print(f"amoeboid bench: {what}", file=sys.stderr, flush=True)


def _print(result: dict[str, Any]) -> None:
    from rich.console import Console

    console = Console(highlight=False)
    console.print(_sizes_table(result["sizes"]))
    for growth in result["growth_exponents"]:
        console.print(
            f"from {growth['from_nodes']} to {growth['to_nodes']} nodes: time of a step grows as "
            f"nodes^{growth['exponent']:.2f}"
        )
    _print_run(console, result["steady_state"])
    for peer in result["peers"]:
        console.print(
            f"\none force balance on {peer['nodes']} nodes, {peer['peer']} over amoeboid:"
        )
        if "missing" in peer:
            console.print(f"  not measured: {peer['missing']}", markup=False, soft_wrap=True)
        else:
            ratios = ", ".join(f"{name} {ratio:.3g}" for name, ratio in peer["ratios"].items())
            apart = f"solutions differ by {peer['difference']:.1e}"
            console.print(f"  {ratios}  ({apart})", soft_wrap=True)


def _print_run(console: Any, run: dict[str, Any]) -> None:
    default, explicit = run["default"], run["explicit"]
    lines = [
        f"\nrun on {run['nodes']} nodes to t = {default['t']:.4g} ({default['ended']}):",
        f"  {default['scheme']}: {default['wall_s']:.3g} s measured, {default['steps']} steps; "
        f"{default['start_s']:.3g} s more for the initial state",
    ]
    if run["ratio"] is None:
        lines.append(f"  explicit: not measured, {explicit['why']}")
    else:
        lines += [
            f"  explicit: {explicit['wall_s']:.4g} s extrapolated, {explicit['steps']} steps of "
            f"{1e3 * explicit['s_per_step']:.3g} ms ({explicit['steps_measured']} measured)",
            f"  ratio {run['ratio']:.0f}, in processor time {run['cpu_ratio']:.0f}",
        ]
    console.print("\n".join(lines), markup=False, soft_wrap=True)


def _sizes_table(sizes: list[dict[str, Any]]) -> Any:
    from rich.table import Table

    table = Table(title="best (median) time of a step and of its phases, ms")
    table.add_column("")
    for size in sizes:
        table.add_column(f"{size['nodes']} nodes", justify="right")
    table.add_row("step", *(_milliseconds(size["step"]) for size in sizes))
    for phase in sizes[0]["phases"]:
        table.add_row(f"  {phase}", *(_milliseconds(size["phases"][phase]) for size in sizes))
    memory = (size["peak_memory_MiB"] for size in sizes)
    table.add_row("peak memory, MiB", *("-" if m is None else f"{m:.0f}" for m in memory))
    return table


def _milliseconds(timing: dict[str, float]) -> str:
    return f"{1e3 * timing['best_s']:.3g} ({1e3 * timing['median_s']:.3g})"
