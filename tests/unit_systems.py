"""One cell in several systems of units, and documents of the command line compared in them."""

from __future__ import annotations

import math
from typing import Any

from amoeboid.model.parameters import DIMENSIONS, Parameters
from amoeboid.model.units import Units

SI = Units(length=1e5, time=0.1, mass=3.7e2, filaments=1e-5)
SYSTEMS = {
    "of the paper's simulations": Units(length=1.0, time=1.0, mass=1.0, filaments=1.0),
    "SI": SI,  # R0 = 1e-5, beta = 0.1, eta_s = 2.7e-3/10, c0 = 3e15 for the paper's point
    "um, s, pN s^2/um": Units(length=0.1, time=0.1, mass=3.7e-4, filaments=1e-5),
    "nm, ms, single filaments": Units(length=1e-4, time=1e-4, mass=3.7e-10, filaments=1e-5),
    "mm, h, kg, mol": Units(length=1e2, time=360.0, mass=3.7e2, filaments=6.022e18),
}
"""Sizes of the units, in those of the paper's simulations."""

DIMENSION_OF_KEY = {
    **DIMENSIONS,
    "max_retrograde_speed": "L/T",
    "max_retrograde_speed_cubic": "L/T",
    "max_retrograde_speed_at_v_p0": "L/T",
    "max_retrograde_speed_next_order": "L/T",
    "v_p_critical": "L/T",
    "thresholds": "L/T",
    "first_mode_v_p0": "L/T",
    "trusted_distance": "L/T",
    "c_front": "N/L^2",
    "c_rear": "N/L^2",
    "amplitude": "N/L^2",
    "zeta0": "M/T^2",
    "nu": "L^4/(T N^2)",
    "nu_infinite_pressure": "L^4/(T N^2)",
    "nu_5_infinite_pressure": "L^8/(T N^4)",
    "m_2": "L^2/N",
    "r_2": "L^4/N^2",
    "delta_P_star": "M/(L T^2)",
    "growth_rate": "1/T",
    "growth_rate_error": "1/T",
    "rate_of_change": "1/T",
    "speed_growth": "1/T",
    "cortex_drag_speed": "L/T",
    "filament_number": "N",
    "growth_rates": "1/T",
    "growth_rates_finite_pressure": "1/T",
    "frequencies_finite_pressure": "1/T",
} | dict.fromkeys(
    (
        "area_error", "deformation", "first_mode", "m", "modes", "relative_error", "rho_2", "steps",
        "unstable_modes",
    ),
    "",
)  # fmt: skip

NOT_COMPARED = {"parameters", "output", "wall_s", "notes", "problems", "message"}


def settings(p: Parameters, units: Units) -> list[str]:
    """The options --set that give the cell p, in units of these sizes."""
    values = {name: getattr(p, name) / units.of(unit) for name, unit in DIMENSIONS.items()}
    given = [f"{name}={value!r}" for name, value in values.items()] + [f"law={p.law.name}"]
    return [word for setting in given for word in ("--set", setting)]


def differences(
    found: Any, expected: Any, units: Units, tolerance: float, key: str = "", path: str = ""
) -> list[str]:
    """Where a document in other units is not the expected one, in words."""
    if key in NOT_COMPARED:
        return []
    if isinstance(expected, dict) and isinstance(found, dict) and found.keys() == expected.keys():
        pairs = [(k if not k.isdigit() else key, k, found[k], expected[k]) for k in expected]
    elif isinstance(expected, list) and isinstance(found, list) and len(found) == len(expected):
        pairs = [(key, str(k), *both) for k, both in enumerate(zip(found, expected, strict=True))]
    elif isinstance(expected, float) and isinstance(found, float):
        size = found * units.of(DIMENSION_OF_KEY[key])
        same = math.isclose(size, expected, rel_tol=tolerance, abs_tol=1e-3 * tolerance)
        return [] if same else [f"{path}: {size!r} is not {expected!r}"]
    else:
        return [] if found == expected else [f"{path}: {found!r} is not {expected!r}"]
    return [
        text
        for k, step, a, b in pairs
        for text in differences(a, b, units, tolerance, k, f"{path}/{step}")
    ]
