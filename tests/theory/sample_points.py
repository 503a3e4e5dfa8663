"""Random parameter points with different laws, and their values for the symbols of the model."""

import numpy as np

import theory.shell_equations as model
from amoeboid.model.parameters import Parameters

OWN_LAW = "v_p0*(1 + 0.3*c/c_r)*exp(-0.8*c/c_r) + 0.05*v_p0/(1 + (c/c_r)**2)"
LAWS = ("exponential", "inverse", OWN_LAW, "v_p0/(1 + c/c_r)")


def sample_points(number=12, seed=1):
    """Points whose alpha, viscosities, pressure and sizes all differ from 1."""
    rng = np.random.default_rng(seed)
    names = ("R0", "delta_P", "eta_s", "eta_b", "c0", "c_r", "beta", "D", "v_p0", "alpha")
    high = {"delta_P": 20.0, "alpha": 0.2, "D": 0.5}
    return [
        Parameters(
            **{name: rng.uniform(0.3, 1.0) * high.get(name, 2.0) for name in names},
            law=LAWS[i % len(LAWS)],
        )
        for i in range(number)
    ]


def symbol_values(p):
    """{symbol: number} for the derivations of `shell_equations`."""
    names = ("R0", "delta_P", "eta_s", "eta_b", "c0", "beta", "D", "alpha")
    values = {getattr(model, name): getattr(p, name) for name in names}
    return values | dict(zip(model.f, map(float, p.v_p_derivatives(p.c0, 5)), strict=True))
