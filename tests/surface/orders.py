"""Orders of convergence in time, measured, and what short steps come to."""

import numpy as np

from amoeboid.surface.stepping import semi_implicit_step


def measured_orders(runs, counts):
    """Order in dt of everything a step finds, against the last run.

    A run is a list of (state, flow) at times that all of them share; the largest error counts.
    """
    *runs, last = runs
    quantities = {
        "c": lambda s, f, at, flow: s.c - at.c,
        "shape": lambda s, f, at, flow: np.einsum("vi,vi->v", s.r - at.r, flow.normals),
        "v": lambda s, f, at, flow: f.v - flow.v,
        "position": lambda s, f, at, flow: s.position - at.position,
        "zeta0": lambda s, f, at, flow: s.zeta0 - at.zeta0,
    }
    orders = {}
    for name, error in quantities.items():
        errors = [
            max(np.abs(error(*a, *b)).max() for a, b in zip(run, last, strict=True)) for run in runs
        ]
        orders[name] = -np.polyfit(np.log(counts[:-1]), np.log(errors), 1)[0]
        print(name, errors, orders[name])
    return orders


def in_short_steps(model, state, length, count):
    """State and flow after `length`, in so many steps that their own errors do not count."""
    history = (state,)
    for _ in range(count):
        state, flow, _ = semi_implicit_step(model, history, length / count, tolerance=1e-9)
        history = (state, *history[:2])
    return state, flow
