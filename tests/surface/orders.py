"""Orders of convergence in time, measured."""

import numpy as np


def measured_orders(ends, counts):
    """Order in dt of everything a step finds, against the last end."""
    *ends, (last, last_flow) = ends
    quantities = {
        "c": lambda s, f: s.c - last.c,
        "shape": lambda s, f: np.einsum("vi,vi->v", s.r - last.r, last_flow.normals),
        "v": lambda s, f: f.v - last_flow.v,
        "position": lambda s, f: s.position - last.position,
        "zeta0": lambda s, f: s.zeta0 - last.zeta0,
    }
    orders = {}
    for name, error in quantities.items():
        errors = [np.abs(error(s, f)).max() for s, f in ends]
        orders[name] = -np.polyfit(np.log(counts[:-1]), np.log(errors), 1)[0]
        print(name, errors, orders[name])
    return orders
