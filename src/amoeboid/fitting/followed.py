"""Polarized steady states followed as parameters change, with exact derivatives.

Parameters are measured by y, the logarithm of each over its value at the start: steps in y do not
depend on units, and no parameter changes its sign.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.steady import SteadySolution, steady_state
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import COMPLEX_STEP
from amoeboid.numerics.newton import solve
from amoeboid.validation import InvalidInput

MAX_STEP, MIN_STEP = 0.7, 0.01
"""Longest and shortest step in y from one state to the next."""

MAX_ITERATIONS = 8
"""Of Newton's method from a predicted state: it takes three or four."""

POLARIZED = 1e-3
"""Difference of c between rear and front, over the mean of both, below which a cell is at rest."""

ASTRAY, NOISE = 0.5, 0.02
"""A state lies on the same branch if its c differs from the predicted one by less than this share
of the predicted change, plus this share of the difference between rear and front."""

DIFFERENCE = 1e-4
"""Step in y of the central differences along the exact tangents of a state."""

STATIONS = np.linspace(0.0, np.pi, 33)
"""Scaled arclengths where states are compared."""


@dataclass(frozen=True, eq=False)
class FollowedState:
    """A polarized steady state at start.replace(names: values * exp(y)), its rear at x = 0."""

    start: Parameters
    names: tuple[str, ...]
    y: Array
    solution: SteadySolution

    @cached_property
    def tangents(self) -> Array:
        """d(unknowns)/dy of the state (k, unknowns): exact, from the Jacobian of its equations."""
        p, x = self.solution.parameters, self.solution.x
        system = SteadySystem(p, self.solution.n, self.names)
        q = np.array([p.value(name) for name in self.names])
        right = np.empty((x.size, q.size))
        for k in range(q.size):
            moved = q.astype(complex)
            moved[k] *= 1.0 + 1j * COMPLEX_STEP
            right[:, k] = -system.residual(x, moved).imag / COMPLEX_STEP
        return solve(system.jacobian(x, q), right).T

    def predicted(self, y: Array) -> SteadySolution:
        """The state at y to first order: unconverged, with the parameters of y."""
        p = parameters_at(self.start, self.names, y)
        x = self.solution.x + (y - self.y) @ self.tangents
        return replace(self.solution, parameters=p, x=x, converged=False, residuals=())

    @cached_property
    def neighbors(self) -> list[tuple[SteadySolution, SteadySolution]]:
        """The states DIFFERENCE ahead of and behind this one in each y, along the tangents."""
        steps = DIFFERENCE * np.eye(self.y.size)
        return [(self.predicted(self.y + s), self.predicted(self.y - s)) for s in steps]

    def at(self, y: Array) -> FollowedState | None:
        """The state at y on the same branch, in as many steps as needed.

        None where the branch ends or turns back before: at a fold or at the threshold.
        """
        here, step = self, MAX_STEP
        while True:
            left = y - here.y
            distance = float(np.max(np.abs(left), initial=0.0))
            if distance == 0.0:
                return here
            share = min(1.0, step / distance)
            target = y if share == 1.0 else here.y + share * left
            found = here._next(target)
            if found is not None:
                here = found
            else:
                step = min(step, distance) / 2
                if step < MIN_STEP:
                    return None

    def _next(self, y: Array) -> FollowedState | None:
        try:
            guess = self.predicted(y)
            found = steady_state(guess.parameters, guess, max_iterations=MAX_ITERATIONS)
        except (InvalidInput, np.linalg.LinAlgError):
            return None
        if not found.converged or not polarized(found):
            return None
        before, expected, c = (s.concentration(STATIONS) for s in (self.solution, guess, found))
        allowed = ASTRAY * np.abs(expected - before).max() + NOISE * np.ptp(before)
        if np.abs(c - expected).max() > allowed:
            return None
        return replace(self, y=y, solution=found)


def parameters_at(start: Parameters, names: tuple[str, ...], y: Array) -> Parameters:
    """The parameters at y. Raises InvalidInput where one of them is out of its range."""
    values = {name: start.value(name) * float(np.exp(d)) for name, d in zip(names, y, strict=True)}
    return start.replace(**values)


def polarized(state: SteadySolution) -> bool:
    """Whether a state has its rear at x = 0, and is not at rest."""
    rear, front = state.concentration(np.array([0.0, np.pi]))
    return bool(rear - front > POLARIZED * 0.5 * (rear + front))
