"""Steady states of the axisymmetric solver that the 3D shell is compared with."""

from functools import cache

from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import unstable_modes


@cache
def polarized(p):
    """The fastest axisymmetric steady state at p that no perturbation with m <= 3 destroys."""
    states = [s for s in steady_solutions(p) if s.max_retrograde_speed > 1e-3 * p.rate * p.R0]
    stable = [s for s in states if not any(unstable_modes(s).values())]
    return max(stable, key=lambda s: s.max_retrograde_speed)


OBSERVED = ("max_retrograde_speed", "c_front", "c_rear", "zeta0")
