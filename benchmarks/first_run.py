"""What a user waits for: the first and the second `amoeboid run`, and programs that start together.

    python -m benchmarks.first_run [PROGRAMS]

Wall clock and processor time of whole programs, pictures included, on an empty folder of kernels.
Kernels that came with the package are used; an editable installation has none.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = "import sys; from amoeboid.cli.program import program; sys.exit(program())"
SHORT = ["--set=mesh.subdivisions=1", "--set=time.end=0.01", "--json"]


def timed(folder: Path, *runs: list[str]) -> tuple[float, float]:
    """Wall clock and processor time [s] of runs that start together. Raises AssertionError."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    begin, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    started = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, "run", *options],
            cwd=folder, env=environment, stdout=subprocess.DEVNULL,
        )
        for options in runs
    ]  # fmt: skip
    assert [run.wait() for run in started] == [0] * len(runs)
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
    return time.perf_counter() - begin, spent


def main(programs: int = 20) -> None:
    """Print a line for each."""
    with tempfile.TemporaryDirectory() as name:
        for what in ("first run", "second run"):
            print("{}: {:.1f} s, {:.1f} s of processor time".format(what, *timed(Path(name), [])))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        together = timed(folder, *([*SHORT, f"-o=run{k}"] for k in range(programs)))
        alone = timed(folder, [*SHORT, "-o=again"])
    print(
        "{} short runs together: {:.1f} s, {:.1f} s of processor time".format(programs, *together)
    )
    share = together[1] - programs * alone[1]
    print(f"of which {share:.1f} s are more than {programs} times that of one that finds kernels")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
