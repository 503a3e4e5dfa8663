"""Branches that end where their parameter is zero."""

import numpy as np
import pytest

from amoeboid.axisymmetric import paths
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import Options, Unresolved, through


@pytest.fixture(scope="module")
def path():
    """Makes the way of a polarized cell towards friction zero."""
    p = Parameters(D=0.4, v_p0=6.5, gamma_t=0.05)
    options = Options(parameter_scale=0.1, max_step=0.3)
    state = steady_solutions(p, degrees=(1,))[-1]
    start = through(SteadySystem(p, state.n, ("gamma_t",)), state.x, 0.05, -1.0, options)
    return lambda: paths.Path(p, "gamma_t", start, options)


def test_the_last_arc_ends_in_the_state_at_zero(path):
    along = path()
    last = list(along)[-1].b
    assert (along.end, last.parameter, along.last) == (paths.ZERO, 0.0, last)
    x, q = last.x, np.zeros(1)
    assert np.abs(last.system.residual(x, q)).max() < 1e-9


def test_a_state_at_zero_that_is_not_resolved_is_not_sought_in_shorter_steps(path, monkeypatch):
    asked = []

    def unresolved(arc, value, options):
        asked.append(value)
        raise Unresolved(arc.b)

    monkeypatch.setattr(paths, "at_value", unresolved)
    along = path()
    with pytest.raises(Unresolved):
        list(along)
    assert asked == [0.0]
    assert along.unresolved is not None
