"""Steady states of the free-shape axisymmetric cell at delta_P = 300, parameter table otherwise.

From a spectral axisymmetric solver, independent of the triangulated shell; all digits converged.
Keys: (D, v_p0).
"""

SPECTRAL = {
    (0.4, 6.0): {
        "max_retrograde_speed": 1.834173,
        "c_front": 0.774928,
        "c_rear": 13.138030,
        "zeta0": 155.064706,
    },
    (0.03, 3.6): {"max_retrograde_speed": 0.166174},
    (0.03, 3.8): {"max_retrograde_speed": 0.341712},
}
