"""Steady states, their stability and branches: solved for, against a run that waits for them.

python -m benchmarks.speed.solved 3 4 5 6    # this alone, figure 3D; one line of JSON a mesh
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.config import Config, Mesh
from amoeboid.meshes.cells import InitialCell
from amoeboid.model.parameters import Parameters
from amoeboid.runs.branches import branch
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.steady_cell import steady_state
from amoeboid.simulation import step_length
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step import Step
from amoeboid.studies.states import SteadyState
from amoeboid.surface.stability import Growth, leading_growth_rate

# The neighbouring state has this much more v_p0, as a share.
NEARBY = 0.01


def solved_against_run(config: Config, subdivisions: int) -> dict[str, Any]:
    """Processor times [s] to a steady state of `config` on one mesh, and ratios.

    `run`: steps from a small perturbation until nothing changes; `wait`: from the steady state of
    v_p0 to that of 1.01 v_p0; `stability`: the growth rate at the end. `solved`, `neighbour` and
    `branch` (figure 3B, with its fold): the same by accelerated iterations, from an axisymmetric
    state laid on the mesh and from the state of v_p0.
    """
    p, mesh = config.parameters, Icosphere(subdivisions)
    nearby = replace(p, v_p0=(1.0 + NEARBY) * p.v_p0)
    config = replace(config, mesh=Mesh(subdivisions=subdivisions))
    fastest = max(steady_solutions(p, (1,)).states, key=lambda state: state.max_retrograde_speed)
    laid = SteadyState(fastest).as_initial(mesh)
    steady_state(p, start=laid).growth(0.02)  # compiles what was not compiled before
    cell, solved = _timed(lambda: steady_state(p, start=laid))
    _, neighbour = _timed(lambda: steady_state(nearby, start=cell))
    end, run = _timed(lambda: _still(config, None))
    other = replace(config, parameters=nearby)
    _, wait = _timed(lambda: _still(other, cell.as_initial()))
    growth, stability = _timed(lambda: leading_growth_rate(end.model, end.state, end.flow))
    times = {
        "run": run,
        "solved": solved,
        "wait": wait,
        "neighbour": neighbour,
        "stability": stability,
    }
    return {
        "nodes": mesh.n_nodes,
        "cpu_s": times,
        "steps": end.number,
        "iterations": cell.iterations,
        "growth_rate": growth.rate,
        "ratios": {
            "state": run / solved,
            "state and stability": (run + stability) / (solved + stability),
            "neighbour": wait / neighbour,
        },
    }


def branch_of_figure_3b(subdivisions: int) -> dict[str, Any]:
    """Processor time [s] of the branch from v_p0 = 8 through its fold to the sphere."""
    p, mesh = Parameters(D=0.4), Icosphere(subdivisions)
    start_cell = steady_state(replace(p, v_p0=8.0), mesh=mesh)
    found, seconds = _timed(
        lambda: branch(p, "v_p0", 0.0, 8.0, through=start_cell, stability=False)
    )
    return {
        "nodes": mesh.n_nodes,
        "cpu_s": seconds,
        "points": len(found),
        "fold": found.folds[0].number if found.folds else None,
    }


def _timed(task: Callable[[], Any]) -> tuple[Any, float]:
    began = time.process_time()
    found = task()
    return found, time.process_time() - began


def _still(config: Config, cell: InitialCell | None) -> Step:
    """The end of a run that nothing changes any more, without its stability."""
    known = step_length.leading_growth_rate
    step_length.leading_growth_rate = lambda *_: Growth(-1.0, 0.0)
    try:
        *_, last = evolve(start(config, cell), config.time)
    finally:
        step_length.leading_growth_rate = known
    return last


def main(subdivisions: list[int]) -> None:
    """Print what is measured on every mesh as soon as it is."""
    for n in subdivisions:
        config = Config(parameters=Parameters(D=0.4, v_p0=6.0))
        print(json.dumps({**solved_against_run(config, n), "branch": branch_of_figure_3b(n)}))
        sys.stdout.flush()


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]])
