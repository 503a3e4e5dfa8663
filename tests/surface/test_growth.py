"""Small perturbations grow as linear theory says, the better the finer the mesh."""

from dataclasses import replace

import numpy as np
import pytest

from amoeboid.closed_forms.linear import finite_pressure_rates, growth_rate
from amoeboid.meshes.geometry import geometry
from amoeboid.model.parameters import Parameters
from amoeboid.surface.initial import sphere
from amoeboid.surface.stepping import semi_implicit_step
from surface.shapes import observed_orders

AMPLITUDE = 1e-4
# Steps until the fast mode of the shape has decayed, twice; l = 1 has no such mode.
STEPS = {1: 16, 2: 100, 3: 100}


def exact_rates(p, l):
    """Growth rates at the pressure of p, slowest first; the shape of l = 1 is a translation."""
    return np.array([growth_rate(p, 1)]) if l == 1 else finite_pressure_rates(p, l).real


def measured_growth_rate(p, l, subdivisions, dt):
    """Rate at which the P_l part of the concentration grows, once the shape follows it.

    Two runs from +P_l and -P_l: half their difference is free of the mesh's own small flow.
    """
    model, rest = sphere(p, subdivisions)
    z = rest.r[:, 2] / np.linalg.norm(rest.r, axis=1)
    pattern = np.polynomial.legendre.Legendre.basis(l)(z)
    runs = [(replace(rest, c=rest.c + sign * AMPLITUDE * pattern),) for sign in (1, -1)]
    amplitudes = []
    for _ in range(STEPS[l]):
        runs = [(semi_implicit_step(model, past, dt)[0], *past[:1]) for past in runs]
        areas = geometry(runs[0][0].r, model.mesh.faces).node_areas
        difference = 0.5 * (runs[0][0].c - runs[1][0].c)
        amplitudes.append((areas * pattern) @ difference / (areas @ pattern**2))
    first, last = STEPS[l] // 2, STEPS[l] - 1
    return np.log(amplitudes[last] / amplitudes[first]) / ((last - first) * dt)


def extrapolated_growth_rate(p, l, subdivisions):
    """The same in the limit dt -> 0: the second-order error of the step taken off.

    The step resolves the fast mode, and the measurement waits until that has died out.
    """
    fastest = max([100.0, *np.abs(exact_rates(p, l)[1:])])
    coarse, fine = (measured_growth_rate(p, l, subdivisions, x / fastest) for x in (0.3, 0.15))
    return (4 * fine - coarse) / 3


@pytest.mark.parametrize("l", [1, *(pytest.param(l, marks=pytest.mark.slow) for l in (2, 3))])
def test_growth_rates_converge_to_linear_theory(l):
    p = Parameters()
    exact = exact_rates(p, l)[0]
    found = [extrapolated_growth_rate(p, l, n) for n in (2, 3)]
    errors = np.array(found) - exact
    print(f"l = {l}: exact {exact:.6f}, 162 nodes {found[0]:.6f}, 642 nodes {found[1]:.6f}")
    assert np.all(np.abs(observed_orders((162, 642), errors) - 2) < 0.2), errors
    assert abs(errors[-1]) < 0.02 * l * p.beta


@pytest.mark.slow
@pytest.mark.parametrize("l", [1, 2, 3])
@pytest.mark.parametrize(
    "p",
    [
        Parameters(),
        Parameters(law="inverse", v_p0=1.7, alpha=0.1, eta_b=2.0),
    ],
    ids=["table", "inverse law, elastic"],
)
def test_growth_rates_are_second_order_on_three_meshes(p, l):
    exact = exact_rates(p, l)[0]
    found = [extrapolated_growth_rate(p, l, n) for n in (2, 3, 4)]
    errors = np.array(found) - exact
    print(f"l = {l}: exact {exact:.6f}, found {found}")
    assert np.all(np.abs(observed_orders((162, 642, 2562), errors) - 2) < 0.2), errors
