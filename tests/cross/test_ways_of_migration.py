"""Straight or turning migration, as the linear stability of the straight cell has it."""

import numpy as np
import pytest

from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import unstable_modes
from amoeboid.config import Config, Initial, Mesh, Time
from amoeboid.model.parameters import Parameters
from amoeboid.observables import reduced_volume
from amoeboid.simulation.loop import evolve, start


@pytest.mark.slow
@pytest.mark.parametrize(
    ("delta_P", "v_p0", "begin", "end", "turns"),
    [(11.0, 6.5, 30.0, 50.0, False), (30.0, 10.0, 8.0, 20.0, True)],
)
def test_a_cell_turns_where_its_straight_motion_is_unstable(delta_P, v_p0, begin, end, turns):
    """From noise. Angle by which the way has turned after `begin`, in a plane or not."""
    p = Parameters(D=0.4, delta_P=delta_P, v_p0=v_p0)
    straight = max(steady_solutions(p, (1,)), key=lambda state: state.c_rear)
    assert (unstable_modes(straight)[1] > 0) == turns
    config = Config(
        parameters=p,
        mesh=Mesh(subdivisions=2),
        initial=Initial(perturbation=0.0, noise=0.3, seed=1),
        time=Time(end=end),
    )
    *steps, last = evolve(start(config), config.time)
    assert last.ended in ("end of time", "steady")
    times = np.array([s.state.t for s in (*steps, last)])
    way = np.array([s.state.position for s in (*steps, last)])
    even = np.arange(begin, last.state.t, 0.25)
    u = np.diff(np.column_stack([np.interp(even, times, x) for x in way.T]), axis=0)
    speed = np.linalg.norm(u, axis=1) / 0.25
    assert speed.min() > 1
    cosine = np.einsum("ti,ti->t", u[1:], u[:-1]) / (speed[1:] * speed[:-1] * 0.25**2)
    angle = np.arccos(np.clip(cosine, -1, 1)).sum()
    print(delta_P, v_p0, last.ended, angle, speed.mean())
    assert angle > np.pi if turns else angle < 0.1
    # nearly round all the time
    assert reduced_volume(last.cell) > 0.98
