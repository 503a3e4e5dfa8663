"""The closed forms that the axisymmetric solver is compared with, one place to replace.

Growth rate: SI `lambdal` in its general form; 2 x 2 matrix of (rho_l, c_l) at finite delta_P and
the amplitude coefficient nu: general forms for an arbitrary law (derived from SI
`eq_coeff_cdot_actin_non_linear_1` and `_2`).
"""

import numpy as np

from amoeboid.parameters import Parameters


def effective_slope(p: Parameters) -> float:
    """g_1 = v_p'(c0) + alpha R0 / (2 (eta_s + eta_b))."""
    return float(p.v_p_derivatives(p.c0, 1)[1]) + p.alpha * p.R0 / (2 * (p.eta_s + p.eta_b))


def growth_rate_1(p: Parameters) -> float:
    """lambda_1, SI `lambda1`."""
    return -2 * p.c0 * effective_slope(p) / p.R0 - 2 * p.D / p.R0**2 - p.beta


def matrix(p: Parameters, l: int) -> np.ndarray:  # noqa: E741
    """Rates of (c_l, rho_l) for l >= 2 at any delta_P."""
    S, L, g = p.eta_s + p.eta_b, l * (l + 1), effective_slope(p)
    f0 = float(p.v_p(p.c0))
    relax = f0 + p.delta_P * p.R0**2 / 8 * (L / p.eta_s + (L - 2) / S)
    return np.array(
        [
            [
                -L * p.D / p.R0**2 - p.beta - 2 * p.c0 * g / p.R0,
                p.c0 * (L - 2) / p.R0 * (p.delta_P * p.R0**2 / (4 * S) - f0),
            ],
            [g / p.R0, -relax / p.R0],
        ]
    )


def critical_speed(p: Parameters) -> float:
    """v_p^c of the exponential law, SI `eq_vpc_compress` with the factor 1/2 in the alpha term."""
    elastic = p.alpha * p.c0 * p.R0 / (2 * (p.eta_s + p.eta_b))
    return p.c_r / p.c0 * np.exp(p.c0 / p.c_r) * (p.D / p.R0 + p.beta * p.R0 / 2 + elastic)


def nu(p: Parameters) -> float:
    """Cubic coefficient of the amplitude equation at threshold, delta_P -> infinity, any law."""
    _, _, f2, f3 = (float(f) for f in p.v_p_derivatives(p.c0, 3))
    S = p.eta_s + p.eta_b
    G = S / (5 * p.eta_s + 3 * p.eta_b)
    R, g = p.R0, -(2 * p.D / p.R0 + p.beta * p.R0) / (2 * p.c0)
    lambda_2 = 3 * G * (2 * p.D / R**2 + p.beta) - 6 * p.D / R**2 - p.beta
    cubic = -(p.c0 * f3 + 2 * G * f2) / (5 * R)
    mixed = (1 - 3 * G) * g - 2 * p.c0 * f2
    return cubic + 4 / (5 * R**2) * mixed * (p.c0 * G * f2 + g) / lambda_2
