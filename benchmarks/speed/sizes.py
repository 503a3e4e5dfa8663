"""Time per step and per phase on meshes of several sizes."""

from __future__ import annotations

import math
import sys
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

from benchmarks.speed.stopwatch import PHASES, Timing, phases_timed

from amoeboid import observables
from amoeboid.config import Config, Mesh
from amoeboid.simulation import loop

# The first steps after a start are shorter, and compile what was not compiled before.
WARM_UP = 3


def step_times(config: Config, subdivisions: int, steps: int) -> dict[str, Any]:
    """Time of one accepted step, observables included, on one mesh [s].

    Phases are those of `stopwatch.PHASES`; their best times need not add up to the best step.
    """
    config = replace(config, mesh=Mesh(subdivisions=subdivisions))
    # nothing may end the run before the last step is measured
    time = replace(config.time, end=1e6 / config.parameters.rate, stop_when_steady=False)
    first = loop.start(config)
    rejected, phases, totals = 0, [], []
    with phases_timed() as watch:
        run = loop.evolve(first, time)
        for number in range(WARM_UP + steps):
            watch.read()
            with watch.phase("control"):
                step = next(run)
            observables.observed(step.cell)
            seconds = watch.read()
            if number == WARM_UP - 1:
                rejected = step.rejected
            if number >= WARM_UP:
                phases.append(seconds)
                totals.append(sum(seconds.values()))
    return {
        "subdivisions": subdivisions,
        "nodes": first.model.mesh.n_nodes,
        "step": asdict(Timing.of(totals)),
        "phases": {name: _phase(name, phases) for name in PHASES},
        "rejected": step.rejected - rejected,
        "peak_memory_MiB": peak_memory(),
    }


def _phase(name: str, steps: list[dict[str, float]]) -> dict[str, float]:
    timing = Timing.of([seconds.get(name, 0.0) for seconds in steps])
    return {"best_s": timing.best_s, "median_s": timing.median_s}


def growth_exponents(sizes: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Exponents k of time ~ nodes**k between successive sizes, from the best steps."""
    exponents = []
    for small, large in pairwise(sizes):
        times = large["step"]["best_s"] / small["step"]["best_s"]
        exponents.append(
            {
                "from_nodes": small["nodes"],
                "to_nodes": large["nodes"],
                "exponent": math.log(times) / math.log(large["nodes"] / small["nodes"]),
            }
        )
    return exponents


def peak_memory() -> float | None:
    """Largest memory of this process so far [MiB]; None where the system does not tell."""
    if sys.platform == "win32":
        return None
    import resource

    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    unit = 1 if sys.platform == "darwin" else 1024
    return float(largest * unit / 2**20)
