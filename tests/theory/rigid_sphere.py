"""The rigid-sphere model (delta_P -> infinity) as a Legendre-Galerkin system, to integrate in time.

Independent of the theory module: the tangential force balance is assembled and solved in modes,
products are taken at Gauss nodes, and the concentration keeps modes 1 .. N.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve


@dataclass(frozen=True)
class RigidSphere:
    """Modes 1 .. N of c; P and slope are P_l and dP_l/dx at the nodes."""

    p: object
    x: np.ndarray
    weights: np.ndarray
    P: np.ndarray
    slope: np.ndarray

    @cached_property
    def degrees(self):
        return np.arange(1, len(self.P) + 1)

    @cached_property
    def projection(self):
        """Modes 1 .. N of a function of its values at the nodes, as a matrix."""
        return (self.weights * self.P) * (2 * self.degrees[:, None] + 1) / 2

    @cached_property
    def divergence(self):
        """Modes of -div(c v), from c times the sum of t_l dP_l/dx at the nodes, as a matrix."""
        slopes = self.weights * (1 - self.x**2) * self.slope
        return slopes * (2 * self.degrees[:, None] + 1) / (2 * self.p.R0)

    def concentration(self, modes):
        return self.p.c0 + modes @ self.P

    def flow_slopes(self, c):
        """Modes t_l of the tangential cortex flow t_l dP_l/dtheta from the force balance.

        div sigma . e_theta = 0 with v_c . n = -v_p: the mode l of
        (eta_b + 2 eta_s) lap t + 2 eta_s t/R0^2 - 2 (eta_s + eta_b) v_p/R0 - alpha c.
        """
        p, l = self.p, self.degrees
        L = l * (l + 1)
        source = 2 * (p.eta_s + p.eta_b) * p.v_p(c) / p.R0 + p.alpha * c
        return (self.projection @ source) / ((2 * p.eta_s - L * (p.eta_b + 2 * p.eta_s)) / p.R0)

    def rate(self, modes):
        p, l = self.p, self.degrees
        c = self.concentration(modes)
        advection = self.divergence @ (c * (self.flow_slopes(c) @ self.slope))
        return advection - (l * (l + 1) * p.D / p.R0**2 + p.beta) * modes

    def rate_counting_advection_twice(self, modes):
        """What nodes moving with v see with the Eulerian equation: -v.grad c once more."""
        c = self.concentration(modes)
        slopes, gradient = self.flow_slopes(c) @ self.slope, modes @ self.slope
        extra = self.projection @ ((1 - self.x**2) * slopes * gradient) / self.p.R0
        return self.rate(modes) - extra

    def max_speed(self, modes):
        """Largest tangential speed over the sphere."""
        theta = np.linspace(0, np.pi, 2001)
        unit = np.eye(len(self.P) + 1)[1:]
        slope = np.array([legendre.legval(np.cos(theta), legendre.legder(e)) for e in unit])
        flow_slopes = self.flow_slopes(self.concentration(modes))
        return np.abs(np.sin(theta) * (flow_slopes @ slope)).max()


def rigid_sphere(p, number=12):
    x, weights = legendre.leggauss(4 * number)
    unit = np.eye(number + 1)[1:]
    P = np.array([legendre.legval(x, e) for e in unit])
    slope = np.array([legendre.legval(x, legendre.legder(e)) for e in unit])
    return RigidSphere(p, x, weights, P, slope)


def normal_form_coefficients(p, amplitude, rate=RigidSphere.rate):
    """(nu, nu_5) of a' = nu a^3 + nu_5 a^5 + ..., measured on time integrations at the threshold.

    Each run starts with the first mode alone; once the slaved modes have settled, its growth a'/a^3
    is read off. Runs of several amplitudes give the polynomial in a^2.
    """
    system = rigid_sphere(p)
    second = np.eye(len(system.P))[1]
    settle = 30 / abs(system.rate(1e-6 * second)[1] / 1e-6)
    squared, ratio = [], []
    for factor in (1.0, 0.85, 0.7, 0.55, 0.4, 0.25):
        start = factor * amplitude * np.eye(len(system.P))[0]
        run = solve_ivp(
            lambda _, m: rate(system, m), (0, settle), start, "LSODA", rtol=1e-12, atol=1e-15
        )
        assert run.success
        settled = run.y[:, -1]
        squared.append(settled[0] ** 2)
        ratio.append(rate(system, settled)[0] / settled[0] ** 3)
    fit = np.polynomial.Polynomial.fit(squared, ratio, 3).convert().coef
    return fit[0], fit[1]


def steady_state(p, guess):
    """Modes of the steady state next to `guess` (amplitudes of the first modes)."""
    system = rigid_sphere(p, 20)
    start = np.zeros(len(system.P))
    start[: len(guess)] = guess
    found, info, _, message = fsolve(system.rate, start, full_output=True, xtol=1e-13)
    assert np.abs(info["fvec"]).max() < 1e-10, message
    return system, found
