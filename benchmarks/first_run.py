"""What a user waits for: help, the first and the second `amoeboid run`, programs started together.

    python -m benchmarks.first_run [PROGRAMS]

Wall clock and processor time of whole programs, pictures included, on an empty folder of kernels.
Kernels that came with the package are used; an editable installation has none. Python may keep the
bytecode of what it imports, as it does unless PYTHONDONTWRITEBYTECODE is set.
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
HELP, RUN = ["--help"], ["run"]
SHORT = ["run", "--set=mesh.subdivisions=1", "--set=time.end=0.01", "--json"]


def timed(folder: Path, *runs: list[str]) -> tuple[float, float]:
    """Wall clock and processor time [s] of commands that start together. Raises AssertionError."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    begin, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    started = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *words],
            cwd=folder, env=environment, stdout=subprocess.DEVNULL,
        )
        for words in runs
    ]  # fmt: skip
    assert [run.wait() for run in started] == [0] * len(runs)
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
    return time.perf_counter() - begin, spent


def main(programs: int = 20) -> None:
    """Print a line for each."""
    with tempfile.TemporaryDirectory() as name:
        commands = {"help": HELP, "first run": RUN, "second run": RUN, "third run": RUN}
        for what, words in commands.items():
            seconds = timed(Path(name), words)
            print("{}: {:.2f} s, {:.2f} s of processor time".format(what, *seconds), flush=True)
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
