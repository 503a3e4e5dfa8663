"""Kills a run with SIGKILL again and again, resumes it, and compares with one left alone.

    python -m benchmarks.kills [KILLS] [SUBDIVISIONS]

Every file of the two folders must be the same, byte for byte, but for the manifest, which also
tells how long the run took; kills are at random times from the start of the program on.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = "import sys; from amoeboid.cli.program import program; sys.exit(program())"
INTERVAL, END = 0.02, 10.0  # of the frames, and the time of the run
DIFFERING = {"manifest.json", "cell.png", "trajectory.png"}


def command(*arguments: str) -> list[str]:
    """The command as a program of its own."""
    return [sys.executable, "-c", PROGRAM, *arguments]


def killed_runs(
    folder: Path, kills: int, subdivisions: int, end: float = END, seed: int = 0
) -> int:
    """Make a whole run, and killed ones until that many kills have hit; the number of kills.

    Raises AssertionError where a killed run, resumed, has written something else.
    """
    settings = {"mesh.subdivisions": subdivisions, "output.interval": INTERVAL, "time.end": end}
    options = [f"--set={name}={value}" for name, value in settings.items()]
    options += ["--set=time.stop_when_steady=false", "--json"]
    whole = folder / "whole"
    subprocess.run(command("run", *options, "-o", str(whole)), check=True,
                   stdout=subprocess.DEVNULL)  # fmt: skip
    chance, hits = random.Random(seed), 0  # noqa: S311
    for number in range(kills):  # a run may end before it was killed often enough
        target = folder / f"killed-{number}"
        hits += _killed(target, options, kills - hits, chance)
        compare(whole, target)
        if hits == kills:
            break
    return hits


def _killed(target: Path, options: list[str], kills: int, chance: random.Random) -> int:
    """Make a run that is killed up to so many times, and resumed; the number of kills."""
    hits, until_killed = 0, command("run", *options, "-o", str(target))
    while hits < kills and not _finished(target):
        run = subprocess.Popen(until_killed, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        later = _rows(target) + chance.randrange(1, 8)
        while run.poll() is None and _rows(target) < later:
            time.sleep(0.005)
        try:
            run.wait(chance.uniform(0.0, 0.1))
        except subprocess.TimeoutExpired:
            run.kill()
            hits += run.wait() < 0
        until_killed = command("run", "--resume", str(target), "--json")
    if not _finished(target):
        subprocess.run(until_killed, check=True, stdout=subprocess.DEVNULL)
    return hits


def compare(whole: Path, killed: Path) -> None:
    """Assert that two folders hold the same."""
    contents = [
        {str(p.relative_to(root)): p for p in root.rglob("*") if p.is_file()}
        for root in (whole, killed)
    ]
    assert contents[0].keys() == contents[1].keys(), contents[0].keys() ^ contents[1].keys()
    for name in contents[0].keys() - DIFFERING:
        assert contents[0][name].read_bytes() == contents[1][name].read_bytes(), name


def _rows(folder: Path) -> int:
    path = folder / "timeseries.csv"
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def _finished(folder: Path) -> bool:
    """Whether a run has ended and its pictures, which are drawn last, are there."""
    path = folder / "manifest.json"
    drawn = all((folder / name).is_file() for name in ("cell.png", "trajectory.png"))
    return drawn and path.is_file() and '"status": "finished"' in path.read_text()


def main(kills: int = 20, subdivisions: int = 3) -> None:
    """Say how many kills a run has outlived."""
    with tempfile.TemporaryDirectory() as folder:
        hits = killed_runs(Path(folder), kills, subdivisions)
    print(f"{hits} of {kills} kills hit the run; resumed, it wrote the same files bit for bit")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
