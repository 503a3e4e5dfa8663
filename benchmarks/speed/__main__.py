"""`python -m benchmarks.speed`: timings of the 3D solver, as ratios."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from amoeboid.cli.exit_codes import FAILURE, USER_MISTAKE
from amoeboid.cli.output import say, tell
from amoeboid.cli.settings import WHOLE_NUMBER, add_settings, print_json
from amoeboid.cli.tables import number, table, width
from amoeboid.config import FILES, Config, resolved, with_settings
from amoeboid.validation import InvalidInput


def parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speed", formatter_class=argparse.RawDescriptionHelpFormatter
    )
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
    parser.add_argument(
        "--solved-subdivisions",
        type=_subdivisions,
        nargs="+",
        default=[3],
        metavar="N",
        help="meshes on which steady states are solved for, against a run (default 3)",
    )
    parser.epilog = (
        "Measured: the time of a step and of its phases on every mesh; the time of a run to its\n"
        "end (default: figure 3D on 642 nodes; --set changes it) against the explicit scheme of\n"
        "the paper, extrapolated from a number of its steps; steady states, their stability and\n"
        "the branch of figure 3B by accelerated iterations against runs; a single force balance\n"
        "against NGSolve, if that is installed (pip install 'amoeboid[peers]')."
    )
    return parser


def _subdivisions(text: str) -> int:
    return _integer(text, 1, 6)


def _count(text: str) -> int:
    return _integer(text, 1, 10**6)


def _integer(text: str, least: int, most: int) -> int:
    value = int(text) if WHOLE_NUMBER.fullmatch(text.strip()) else least - 1
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(
            f"must be an integer from {least} to {most}, got {text[:40]!r}"
        )
    return value


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print; returns the exit code."""
    try:
        return measure(parser().parse_args(argv))
    except InvalidInput as error:
        tell("", error)
        return USER_MISTAKE


def measure(args: argparse.Namespace) -> int:
    """Measure and print what the arguments ask for. Raises InvalidInput."""
    config = with_settings(Config(), args.settings)
    _check(resolved(config))
    from benchmarks.speed.machine import machine
    from benchmarks.speed.peers import Disagreement, compared_with_ngsolve
    from benchmarks.speed.sizes import growth_exponents, step_times
    from benchmarks.speed.solved import branch_of_figure_3b, solved_against_run
    from benchmarks.speed.steady_state import time_to_steady_state

    from amoeboid.simulation.step_length import Diverged

    try:
        sizes = []
        # ascending: the peak memory is that of the process so far
        for subdivisions in sorted(set(args.subdivisions)):
            tell("", f"steps on {10 * 4**subdivisions + 2} nodes")
            sizes.append(step_times(config, subdivisions, args.steps))
        tell("", "the run to its end, and the explicit scheme beside it")
        steady_state = time_to_steady_state(config, args.explicit_steps)
        solved, branches = [], []
        for subdivisions in sorted(set(args.solved_subdivisions)):
            tell("", f"steady states on {10 * 4**subdivisions + 2} nodes, solved for and by a run")
            solved.append(solved_against_run(config, subdivisions))
            branches.append(branch_of_figure_3b(subdivisions))
        peers = []
        for subdivisions in sorted(set(args.peer_subdivisions)):
            tell("", f"a force balance on {10 * 4**subdivisions + 2} nodes against NGSolve")
            peers.append(compared_with_ngsolve(config.parameters, subdivisions, args.repetitions))
    except (Diverged, Disagreement) as error:
        tell("", error)
        return FAILURE
    result = {
        "machine": machine(),
        "sizes": sizes,
        "growth_exponents": growth_exponents(sizes),
        "steady_state": steady_state,
        "solved": solved,
        "branches": branches,
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
                "the benchmark times spheres of several mesh sizes, "
                f"initial.{name} must be left out, got {path!r}; amoeboid run times that start"
            )
    if config.time.scheme == "explicit":
        raise InvalidInput(
            "the benchmark times the explicit scheme beside the other one, time.scheme must be "
            "semi-implicit, got 'explicit'; leave it out"
        )


def _print(result: dict[str, Any]) -> None:
    say("best (median) time of a step and of its phases, ms", *_sizes_table(result["sizes"]))
    for growth in result["growth_exponents"]:
        say(
            f"from {growth['from_nodes']} to {growth['to_nodes']} nodes: time of a step grows as "
            f"nodes^{number(growth['exponent'], 3)}"
        )
    _print_run(result["steady_state"])
    _print_solved(result["solved"], result["branches"])
    for peer in result["peers"]:
        say("", f"one force balance on {peer['nodes']} nodes, {peer['peer']} over amoeboid:")
        if "missing" in peer:
            say(f"  not measured: {peer['missing']}")
        else:
            ratios = ", ".join(f"{name} {number(r, 3)}" for name, r in peer["ratios"].items())
            say(f"  {ratios}  (solutions differ by {number(peer['difference'], 2)})")


def _print_run(run: dict[str, Any]) -> None:
    default, explicit = run["default"], run["explicit"]
    say(
        "",
        f"run on {run['nodes']} nodes to t = {number(default['t'])} ({default['ended']}):",
        f"  {default['scheme']}: {number(default['wall_s'], 3)} s measured, {default['steps']} "
        f"steps; {number(default['start_s'], 3)} s more for the initial state",
    )
    if run["ratio"] is None:
        say(f"  explicit: not measured, {explicit['why']}")
    else:
        say(
            f"  explicit: {number(explicit['wall_s'], 4)} s extrapolated, {explicit['steps']} steps"
            f" of {number(1e3 * explicit['s_per_step'], 3)} ms ({explicit['steps_measured']} "
            "measured)",
            f"  ratio {number(run['ratio'], 4)}, in processor time {number(run['cpu_ratio'], 4)}",
        )


def _print_solved(solved: list[dict[str, Any]], branches: list[dict[str, Any]]) -> None:
    for one, found in zip(solved, branches, strict=True):
        times = ", ".join(f"{name} {number(s, 3)}" for name, s in one["cpu_s"].items())
        ratios = ", ".join(f"{name} {number(r, 3)}" for name, r in one["ratios"].items())
        say(
            "",
            f"steady states on {one['nodes']} nodes, s of processor time: {times}",
            f"  run of {one['steps']} steps over {one['iterations']} iterations: {ratios}",
            f"  branch of figure 3B: {number(found['cpu_s'], 3)} s, {found['points']} points, fold "
            f"at {'none' if found['fold'] is None else number(found['fold'], 8)}",
        )


def _sizes_table(sizes: list[dict[str, Any]]) -> list[str]:
    titles = ["", *(f"{size['nodes']} nodes" for size in sizes)]
    phases = [
        (f"  {name}", [size["phases"][name] for size in sizes]) for name in sizes[0]["phases"]
    ]
    timings = [("step", [size["step"] for size in sizes]), *phases]
    rows = [[name, *map(_milliseconds, values)] for name, values in timings]
    memory = (size["peak_memory_MiB"] for size in sizes)
    rows.append(["peak memory, MiB", *("-" if m is None else number(m, 4) for m in memory)])
    return table(titles, rows, "<", width())


def _milliseconds(timing: dict[str, float]) -> str:
    return f"{number(1e3 * timing['best_s'], 3)} ({number(1e3 * timing['median_s'], 3)})"


if __name__ == "__main__":
    sys.exit(main())
