"""Reference states along polarized branches, by a parametrization and a search of their own.

c at the rear plus 2 zeta_0 grows all along the branches of l = 1 of these cells, from the sphere
through their folds (c alone turns at delta_P = 1): states are found at given values of that sum,
the amplitude, and the amplitude at which v_p0 has a value by a root search.
"""

from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from amoeboid.axisymmetric.onset import branch_tangent, onset_speed
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.axisymmetric.unknowns import mode_count, resampled
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import Options, parameter_derivative
from amoeboid.numerics.continuation import follow

CELLS = {
    "exponential": Parameters(D=0.4),
    "inverse": Parameters(D=0.4, law="inverse"),
    "beta = 0": Parameters(beta=0.0),
    "alpha > 0": Parameters(D=0.4, alpha=0.1),
    "delta_P = 1": Parameters(D=0.4, delta_P=1.0),
    "D = 1": Parameters(D=1.0),
    "supercritical": Parameters(D=0.03),
    "supercritical, inverse": Parameters(D=0.03, law="inverse"),
}


def rear(x):
    """c at the pole x = 0, of n modes."""
    n = mode_count(x)
    return float(np.sum(x[2 * n - 1 : 3 * n - 1]))


def measure(x):
    """c at the pole x = 0 plus 2 zeta_0."""
    return rear(x) + 2.0 * float(x[-3])


class Reference:
    """The branch of l = 1 in v_p0 of one cell, up to `factor` times its threshold."""

    def __init__(self, p, factor=1.0):
        self.p, self.threshold = p, onset_speed(p)
        self.modes = 128 if p.delta_P < 10 else 64
        self.system = SteadySystem(p.replace(v_p0=self.threshold), self.modes, ("v_p0",))
        options = Options(parameter_scale=self.threshold, max_step=0.1)
        start = branch_tangent(p, "v_p0", self.threshold, options, n=self.modes)
        self.points = [start]
        for point in follow(start, options):
            if not point.fold:
                self.points.append(point)
            if point.parameter_tangent > 0 and point.parameter > 1.05 * factor * self.threshold:
                break
        self.at_rest = measure(start.x)
        self.amplitudes = np.array([measure(q.x) for q in self.points]) - self.at_rest
        assert np.all(np.diff(self.amplitudes) > 0)
        self.speeds = np.array([q.parameter for q in self.points])

    def at_amplitude(self, amplitude):
        """(x, v_p0) at an amplitude, by Newton's method from the neighbors on the branch."""
        k = int(np.clip(np.searchsorted(self.amplitudes, amplitude), 1, len(self.points) - 1))
        a, b = self.points[k - 1], self.points[k]
        share = (amplitude - self.amplitudes[k - 1]) / np.diff(self.amplitudes)[k - 1]
        first, second = (resampled(q.x, mode_count(q.x), self.modes) for q in (a, b))
        x = first + share * (second - first)
        q = np.array([a.parameter + share * (b.parameter - a.parameter)])
        for _ in range(12):
            f, jacobian = self.system.residual_and_jacobian(x, q)
            matrix = np.zeros((x.size + 1, x.size + 1))
            matrix[:-1, :-1] = jacobian
            matrix[:-1, -1] = parameter_derivative(self.system, x, q)
            matrix[-1, 2 * self.modes - 1 : 3 * self.modes - 1] = 1.0
            matrix[-1, -4] = 2.0
            step = np.linalg.solve(matrix, -np.append(f, measure(x) - self.at_rest - amplitude))
            x, q = x + step[:-1], q + step[-1:]
            if np.abs(step[:-1] / self.system.scale).max() < 1e-11:
                break
        return x, float(q[0])

    def fold(self):
        """(amplitude, v_p0) at the lowest v_p0 of the branch, the threshold if it only rises."""
        k = int(np.argmin(self.speeds))
        if k == 0:
            return 0.0, self.threshold
        step = 1e-4 * self.amplitudes[k]

        def slope(a):
            return self.at_amplitude(a + step)[1] - self.at_amplitude(a - step)[1]

        low, high = self.amplitudes[k - 1], self.amplitudes[k + 1]
        low = low if low > 0 else 0.1 * self.amplitudes[k]
        amplitude = brentq(slope, low, high, xtol=1e-6 * high)
        return amplitude, self.at_amplitude(amplitude)[1]

    def states(self, v_p0):
        """x of all polarized states at v_p0, by bisection in the amplitude."""
        bottom = self.fold()[0]
        tiny = 1e-4 * self.p.c0  # below, rounding divided by the amplitude is seen in v_p0
        nodes = [tiny, *([bottom] if bottom > 0 else []), self.amplitudes[-1]]
        found = []
        for a, b in pairwise(nodes):
            values = [self.threshold if c == tiny else self.at_amplitude(c)[1] for c in (a, b)]
            if (values[0] - v_p0) * (values[1] - v_p0) >= 0:
                continue

            def distance(c, values=values, a=a):
                return (values[0] if c == a else self.at_amplitude(c)[1]) - v_p0

            root = brentq(distance, a, b, xtol=1e-13 * b, rtol=1e-14)
            found.append(self.at_amplitude(root)[0])
        return found


def spaced(low, high, count=25, nearest=1e-6):
    """Values between low and high, geometrically denser towards both."""
    near = np.geomspace(nearest, 0.5, (count + 1) // 2)
    shares = np.concatenate([near, 1 - near[-2::-1]])
    return low + (high - low) * shares
