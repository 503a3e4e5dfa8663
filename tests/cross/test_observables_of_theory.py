"""The observables of the closed forms are those of the axisymmetric solver at small amplitude."""

import numpy as np
import pytest

from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.closed_forms.flow import Harmonics, max_retrograde_speed, rho_2, sphere_velocities
from amoeboid.closed_forms.linear import base_tension, critical_speed
from amoeboid.model.parameters import Parameters


def slightly_polarized(p, above):
    """The polarized state just above threshold, and the first harmonics of its concentration."""
    p = p.replace(v_p0=float(critical_speed(p)) * (1 + above))
    state = max(steady_solutions(p, (1,)), key=lambda s: s.max_retrograde_speed)
    a = 0.5 * (state.c_rear - state.c_front)
    b = 0.5 * (state.c_rear + state.c_front) - p.c0
    return p, state, Harmonics(a=a, b=b)


@pytest.mark.parametrize("delta_P", [20.0, 300.0])
def test_deformation_speed_and_tension_tend_to_those_of_the_theory(delta_P):
    amplitudes, errors = [], []
    for above in (4e-3, 1e-3):
        p, state, c = slightly_polarized(Parameters(D=0.03, delta_P=delta_P), above)
        migration = sphere_velocities(p, c.a, [0.0]).migration
        amplitudes.append(c.a / p.c0)
        errors.append(
            [
                state.deformation / abs(float(rho_2(p, c))) - 1,
                state.max_retrograde_speed / float(max_retrograde_speed(p, c)) - 1,
                state.cortex_drag_speed / abs(float(migration)) - 1,
                state.zeta0 / float(base_tension(p)) - 1,
                state.polarity / (c.a / (3 * p.c0)) - 1,
            ]
        )
    errors = np.abs(errors)
    order = np.log(errors[0] / errors[1]) / np.log(amplitudes[0] / amplitudes[1])
    print(amplitudes, errors, order)
    # what is left out of the deformation, rho_3, is of the next order, of the rest of the second
    assert np.all(errors[:, 0] < 0.4 * np.array(amplitudes))
    assert np.all(errors[1, 1:] < 0.02)
    assert np.all(order[1:] > 1.6)
