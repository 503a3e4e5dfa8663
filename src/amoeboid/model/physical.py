"""The cell of the paper's estimates, and what makes a cell of quantities with units."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

from amoeboid.model.specified import declared_dimension
from amoeboid.model.units import Units, customary_unit, measured
from amoeboid.validation import InvalidInput

# The cell of the paper's estimates (SI, section on parameters): the last column of its table, with
# c_r = mu h for 8.5 umol/l of monomers in a cortex of 190 nm, and eta_b = eta_s.
PAPER_CELL: dict[str, str] = {
    "R0": "10 um",
    "delta_P": "300 Pa",
    "eta_s": "2.7 mPa s m",
    "eta_b": "2.7 mPa s m",
    "c0": "1370 / um^2",
    "c_r": "8.5 umol/l * 190 nm",
    "beta": "0.1 / s",
    "D": "0.03 um^2/s",
    "v_p0": "1.7 um/s",
    "alpha": "0 Pa m^3",
    "chi": "0 Pa m^3",
    "kappa": "0 pN um",
    "gamma_t": "0 Pa s/um",
    "gamma_n": "0 Pa s/um",
    "gamma_c": "0 Pa s/um",
    "gamma_share": "0",
    "law": "exponential",
    "stress": "none",
}

EXAMPLES = {
    "L": "10 um",
    "M/(L T^2)": "300 Pa",
    "M/T": "2.7 mPa s m",
    "N/L^2": "1370 / um^2",
    "1/T": "0.1 / s",
    "T": "300 s",
    "L^2/T": "0.03 um^2/s",
    "L/T": "1.7 um/s",
    "M L^2/(T^2 N)": "4e-20 Pa m^3",
    "M L^2/T^2": "0.2 pN um",
    "M/(L^2 T)": "1 Pa s/um",
    "1": "0.5",
}


SI = Units(length=1.0, time=1.0, mass=1.0, filaments=1.0)
"""The base units of SI."""


def own_number(name: str, value: Any, units: Units, spec: Any, named: Mapping[str, Any]) -> Any:
    """A parameter of a law or stress in the units of a cell; numbers are so already."""
    if isinstance(value, int | float):
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        pass
    dimension = declared_dimension(spec, named, name.partition(".")[2])
    if dimension is None:
        raise InvalidInput(
            f"{name} must be a number in the units of the cell (R0, 1/beta, eta_s, c_r R0^2), "
            f"because its dimension is unknown, got {value!r}"
        )
    return measured(name, value, dimension, EXAMPLES[dimension]) / units.of(dimension)


def own_units(si: Mapping[str, float]) -> Units:
    """The units of a cell, from its parameters in SI base units. Raises InvalidInput."""
    if si["beta"] > 0:
        time = 1 / si["beta"]
    elif si["D"] > 0:
        time = si["R0"] * si["R0"] / si["D"]
    else:
        raise InvalidInput("beta or D must be > 0 to set the unit of time, both are 0; raise one")
    return Units(
        length=si["R0"],
        time=time,
        mass=si["eta_s"] * time,
        filaments=si["c_r"] * si["R0"] * si["R0"],
    )


def number_in(units: Units, given: Any, dimension: str, label: str) -> float:
    """The number in these units that a quantity of a dimension stands for.

    0 and a share of dimension "1" need no unit.

    Raises InvalidInput, with `label`, for a number without a unit and for another dimension.
    """
    if isinstance(given, Real) and not isinstance(given, bool) and (given == 0 or dimension == "1"):
        return float(given)
    example = EXAMPLES.get(dimension, f"1 {customary_unit(dimension)}")
    return measured(label, given, dimension, example) / units.of(dimension)
