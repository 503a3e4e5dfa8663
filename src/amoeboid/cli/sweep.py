"""`amoeboid sweep`: a solver at many points, from a file."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.cli.documents import text_for
from amoeboid.cli.exit_codes import FAILURE
from amoeboid.cli.output import say, tell
from amoeboid.cli.pictures import PLOT_FAILS, add_plot, check_picture, drawn
from amoeboid.cli.settings import add_json, print_json, whole
from amoeboid.extras import needed
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from amoeboid.sweeps.document import SweepDocument
    from amoeboid.sweeps.result import Sweep

SHARD = re.compile(r"(\d{1,9})/(\d{1,9})", re.ASCII)
MAX_TOLD = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `sweep`."""
    parser.add_argument(
        "document", nargs="?", type=Path, metavar="SWEEP.toml", help="description of the sweep"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: the name of the file without .toml); the same "
        "command continues an unfinished sweep",
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument(
        "--workers", type=whole, metavar="N", help="compute in N processes (default: 1)"
    )
    how.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="compute on a Dask scheduler, such as tcp://10.0.0.1:8786",
    )
    how.add_argument(
        "--shard",
        type=shard,
        metavar="K/N",
        help="compute only part K of N, as one job of an array of jobs that share DIR",
    )
    how.add_argument(
        "--merge", type=Path, metavar="DIR", help="merge the results of all shards into one table"
    )
    parser.add_argument(
        "--retry", action="store_true", help="recompute the points that failed in an earlier call"
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="print the number of points and compute none"
    )
    add_plot(parser, "the results")
    parser.add_argument(
        "--show", metavar="NAME", help="quantity that --plot draws (default: max_retrograde_speed)"
    )
    add_json(parser)
    parser.epilog = (
        "tables of SWEEP.toml (see docs/sweeps.md):\n"
        "  [base]    parameters that stay the same\n"
        "  [vary]    parameters that vary: lists, {linspace = [4, 8, 41]} or {logspace = "
        "[0.01, 1, 20]}\n"
        "  [solver]  name = theory, steady, branch, simulate or motility, and its options\n"
        "  [record]  names = the numbers to keep\n"
        "  [sobol]   count and seed of random points, instead of a grid\n"
        "  [refine]  label and depth: refine the grid where the label changes\n"
        "DIR/sweep.nc holds all results with their units, and the status of every point. A "
        "point that fails is listed with the reason; the other points are computed.\n"
        "Exit code 0: finished, also if some points failed. 1: --merge found missing points.\n"
        f"{PLOT_FAILS}"
    )


def shard(text: str) -> tuple[int, int]:
    """Part K of N. Raises ArgumentTypeError."""
    found = SHARD.fullmatch(text.strip())
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise argparse.ArgumentTypeError(
            f"must be K/N with 1 <= K <= N, such as 3/10, got {text!r}"
        )
    return int(found[1]), int(found[2])


def execute(args: argparse.Namespace) -> int:
    """Compute or merge, print, draw."""
    check_picture(args.plot)
    if args.merge is not None:
        return _merged(args)
    if args.document is None:
        raise InvalidInput("sweep needs SWEEP.toml or --merge DIR, got neither; give one")
    if args.workers is not None and args.workers < 1:
        raise InvalidInput(f"--workers must be >= 1, got {args.workers}")
    document = _read(args.document)
    if args.dry_run:
        return _counted(args, document)
    folder = args.output or Path(args.document.stem)
    if folder == args.document:
        raise InvalidInput(f"the folder must differ from the file, got {str(folder)!r}")
    found = _computed(args, document, folder)
    return _told(args, found, folder)


def _read(path: Path) -> SweepDocument:
    from amoeboid.sweeps.document import sweep_document

    return sweep_document(text_for(path, "sweep"), repr(str(path)), path.parent)


def _computed(args: argparse.Namespace, document: SweepDocument, folder: Path) -> Sweep:
    from amoeboid.sweeps.sweep import sweep

    with _executor(args.scheduler) as executor:
        try:
            return sweep(
                document.points,
                document.solver,
                record=document.record,
                executor=executor,
                workers=args.workers,
                folder=folder,
                shard=args.shard,
                retry=args.retry,
                progress=True,
            )
        except KeyboardInterrupt:
            tell(
                "sweep", f"finished points are kept in {str(folder)!r}; the same command continues"
            )
            raise


@contextmanager
def _executor(scheduler: str | None) -> Iterator[Any]:
    """An executor on a cluster of Dask; None without a scheduler. Raises InvalidInput."""
    if scheduler is None:
        yield None
        return
    distributed = needed("distributed", "--scheduler needs")
    try:
        client = distributed.Client(scheduler, timeout=20)
    except (OSError, ValueError, TimeoutError) as error:
        raise InvalidInput(
            f"--scheduler must be the address of a running Dask scheduler, got {scheduler!r}: "
            f"{' '.join(str(error).split())}"
        ) from None
    with client:
        yield client.get_executor()


def _counted(args: argparse.Namespace, document: SweepDocument) -> int:
    from amoeboid.sweeps.refinement import Refinement

    points = document.points
    if isinstance(points, Refinement):
        count, more = len(points.grid), " and more where the label changes"
    else:
        count, more = len(points), ""
    if args.json:
        print_json({"points": count})
    else:
        say(f"{count} points{more}")
    return 0


def _merged(args: argparse.Namespace) -> int:
    from amoeboid.sweeps.folder import TABLE
    from amoeboid.sweeps.result import load_sweep

    if args.document is not None:
        raise InvalidInput(
            f"--merge takes only the folder, got {str(args.document)!r} as well; leave it out"
        )
    found = load_sweep(args.merge)
    found.save(args.merge / TABLE)
    code = _told(args, found, args.merge)
    if found.missing:
        tell("sweep", found.missing)
    return code or (FAILURE if found.missing else 0)


def _told(args: argparse.Namespace, found: Sweep, folder: Path) -> int:
    """Print what was computed; the exit code."""
    failed = [{**failure.values, "why": failure.why} for failure in found.failed]
    if args.json:
        counts = {name: found.counts.get(name, 0) for name in ("incomplete", "missing")}
        answers = found.done - len(failed)
        print_json({"output": str(folder), "done": answers, "failed": failed, **counts})
    else:
        counted = ", ".join(f"{n} {status}" for status, n in sorted(found.counts.items()))
        say(f"{len(found)} points: {counted}; {folder}")
        say(*(f"failed: {failure!r}" for failure in found.failed[:MAX_TOLD]))
        if len(failed) > MAX_TOLD:
            say(f"... and {len(failed) - MAX_TOLD} more, see `why` in the table")

    def draw(path: Path) -> None:
        from amoeboid.plotting.sweeps import write_sweep

        write_sweep(found, path, args.show)

    return drawn("sweep", args.plot, draw)
