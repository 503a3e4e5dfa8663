"""Linear theory of the homogeneous sphere, for comparison (SI `lambdal`).

The matrix acts on (dc_l, rho_l) with r = R0 (1 + rho_l P_l) and is exact at any delta_P; its
derivation is that of SI `eq_c_evolution_SI` with the tension force kept.
"""

import numpy as np


def finite_pressure_rates(p, l):
    """Growth rates (slow, fast) of degree l >= 2; for l = 1 the one of the concentration."""
    f0, f1 = (float(x) for x in p.v_p_derivatives(p.c0, 1))
    S, L = p.eta_s + p.eta_b, l * (l + 1)
    g1 = f1 + p.alpha * p.R0 / (2 * S)
    if l == 1:
        return np.array([-2 * p.c0 * g1 / p.R0 - 2 * p.D / p.R0**2 - p.beta])
    matrix = np.array(
        [
            [
                -L * p.D / p.R0**2 - p.beta - 2 * p.c0 * g1 / p.R0,
                p.c0 * (L - 2) / p.R0 * (p.delta_P * p.R0**2 / (4 * S) - f0),
            ],
            [
                g1 / p.R0,
                -(f0 + p.delta_P * p.R0**2 / 8 * (L / p.eta_s + (L - 2) / S)) / p.R0,
            ],
        ]
    )
    return np.sort(np.linalg.eigvals(matrix).real)[::-1]
