"""Time to the steady state: the default scheme measured whole, the explicit one extrapolated."""

from __future__ import annotations

import time
from collections.abc import Sequence
from statistics import mean
from typing import Any

from amoeboid.config import EXPLICIT_STEP, Config
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step import Step
from amoeboid.surface.explicit import explicit_step
from amoeboid.surface.stepping import StepFailed

# Places along the trajectory where the explicit scheme is timed, and steps there that do not count.
PLACES = 5
WARM_UP = 50


def time_to_steady_state(config: Config, explicit_steps: int) -> dict[str, Any]:
    """Wall-clock and processor times [s] to the end of the run of `config`, and their ratios.

    On a busy machine processor times are the ones to compare.

    The default scheme runs to its end, without output. The explicit scheme is started from
    `PLACES` states of that run and makes `explicit_steps` steps in all; its mean time per step
    times the number of its steps to the same end is what it would take. Where its step is too
    long for the shape, the entry says so and the ratios are None. Raises Diverged.
    """
    next(evolve(start(config), config.time))  # compiles what was not compiled before
    began = time.perf_counter()
    first = start(config)
    started, cpu_started = time.perf_counter(), time.process_time()
    steps = list(evolve(first, config.time))
    ended, cpu_ended = time.perf_counter(), time.process_time()
    last = steps[-1]
    default = {
        "scheme": config.time.scheme,
        "how": "measured",
        "start_s": started - began,
        "wall_s": ended - started,
        "cpu_s": cpu_ended - cpu_started,
        "steps": last.number,
        "t": last.state.t,
        "ended": last.ended,
        "steady": last.steady,
    }
    try:
        explicit = _extrapolated([first, *steps], explicit_steps)
        ratios = {"ratio": "wall_s", "cpu_ratio": "cpu_s"}
        ratio = {name: explicit[key] / default[key] for name, key in ratios.items()}
    except StepFailed as error:
        why = f"the step {EXPLICIT_STEP:g}/rate of the explicit scheme is too long here: {error}"
        explicit, ratio = {"scheme": "explicit", "how": "not measured", "why": why}, {}
    return {
        "nodes": first.model.mesh.n_nodes,
        "default": default,
        "explicit": explicit,
        "ratio": ratio.get("ratio"),
        "cpu_ratio": ratio.get("cpu_ratio"),
    }


def _extrapolated(steps: Sequence[Step], count: int) -> dict[str, Any]:
    dt = EXPLICIT_STEP / steps[0].model.rate
    each = max(1, count // PLACES)
    t_end = steps[-1].state.t
    places = [next(s for s in steps if s.state.t >= k * t_end / PLACES) for k in range(PLACES)]
    seconds, cpu_seconds = [], []
    for place in places:
        model, state, flow = place.model, place.state, None
        for _ in range(WARM_UP):
            state, flow = explicit_step(model, state, dt, flow)
        began, cpu_began = time.perf_counter(), time.process_time()
        for _ in range(each):
            state, flow = explicit_step(model, state, dt, flow)
        seconds.append((time.perf_counter() - began) / each)
        cpu_seconds.append((time.process_time() - cpu_began) / each)
    needed = round(t_end / dt)
    return {
        "scheme": "explicit",
        "how": "extrapolated",
        "dt": dt,
        "steps_measured": each * PLACES,
        "s_per_step": mean(seconds),
        "s_per_step_range": [min(seconds), max(seconds)],
        "steps": needed,
        "wall_s": mean(seconds) * needed,
        "cpu_s": mean(cpu_seconds) * needed,
    }
