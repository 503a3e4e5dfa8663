"""The model's parameters, with the paper's symbols and the defaults of its parameter table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import tomli_w
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.display import html_table, shown
from amoeboid.model.polymerization import LawField, refuse_unwritable
from amoeboid.model.units import Units, customary_unit, measured, quantity
from amoeboid.validation import InvalidInput, number, refuse_unknown, toml_document, validate

# Range of `Parameters.rate`: fourth powers of time steps must be numbers.
SLOWEST, FASTEST = 1e-60, 1e60


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
    "law": "exponential",
}

EXAMPLES = {
    "L": "10 um",
    "M/(L T^2)": "300 Pa",
    "M/T": "2.7 mPa s m",
    "N/L^2": "1370 / um^2",
    "1/T": "0.1 / s",
    "L^2/T": "0.03 um^2/s",
    "L/T": "1.7 um/s",
    "M L^2/(T^2 N)": "4e-20 Pa m^3",
}


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One parameter point; any consistent units, defaults in the paper's simulation units.

    Dimensions: L length, T time, M mass, N number of filaments. Raises InvalidInput for a value
    outside its range, a wrong type, NaN or infinity.
    """

    R0: float = number(1.0, "radius of the undeformed cell", "L", gt=0)
    delta_P: float = number(300.0, "pressure inside minus outside", "M/(L T^2)", ge=0)
    eta_s: float = number(1.0, "surface shear viscosity of the cortex", "M/T", gt=0)
    eta_b: float = number(1.0, "surface bulk viscosity of the cortex", "M/T", ge=0)
    c0: float = number(3.0, "homeostatic filament concentration", "N/L^2", ge=0)
    c_r: float = number(1.0, "reference filament concentration", "N/L^2", gt=0)
    beta: float = number(1.0, "filament turnover rate", "1/T", ge=0)
    D: float = number(0.03, "filament diffusion coefficient", "L^2/T", ge=0)
    v_p0: float = number(3.8, "polymerization speed scale", "L/T", ge=0)
    alpha: float = number(0.0, "elastic resistance per filament", "M L^2/(T^2 N)", ge=0)
    law: LawField = LawField()  # a Law, or its name or expression
    units: Units | None = field(default=None, compare=False, repr=False)
    """Size of the units in SI base units, where the parameters were given in physical ones."""

    def __post_init__(self) -> None:
        validate(self)

    @classmethod
    def physical(cls, **quantities: Any) -> Parameters:
        """A cell from quantities with units: texts such as "10 um", or pint's own.

        What is left out is as in `PAPER_CELL`, the cell of the paper's estimates. The units of the
        numbers are those of the cell: length R0, time 1/beta (R0^2/D without turnover), mass
        eta_s/beta, filaments c_r R0^2; `units` holds their size, and `quantity` converts results
        back. Raises InvalidInput for an unknown name, a text that is no quantity, or a wrong
        dimension, naming the parameter.

        >>> cell = Parameters.physical(R0="10 um", v_p0="1.7 um/s")
        >>> cell.R0, f"{cell.quantity(cell.v_p0, 'L/T'):.2f}"
        (1.0, '1.70 µm/s')
        """
        refuse_unknown(quantities, PARAMETER_NAMES, "parameter")
        given = {**PAPER_CELL, **quantities}
        law = given.pop("law")
        si: dict[str, Any] = {
            name: measured(name, value, DIMENSIONS[name], EXAMPLES[DIMENSIONS[name]])
            for name, value in given.items()
        }
        cls(law=law, **si)  # refuses values out of range in the user's own numbers
        units = _own_units(si)
        values = {name: si[name] / units.of(DIMENSIONS[name]) for name in si}
        # By definition; dividing would leave rounding.
        values |= {"R0": 1.0, "eta_s": 1.0, "c_r": 1.0}
        return cls(**values, law=law, units=units)

    def quantity(self, value: Any, dimension: str) -> Any:
        """A number of a dimension such as "L/T" in the units of the cell.

        A quantity of pint if the parameters were given in physical units, else `value` itself.
        """
        return value if self.units is None else quantity(value, dimension, self.units)

    def quantities(self) -> dict[str, Any]:
        """All parameters by name, with their units if they were given in physical ones."""
        values = {name: self.quantity(getattr(self, name), d) for name, d in DIMENSIONS.items()}
        return values | {"law": self.law.name}

    def v_p(self, c: ArrayLike) -> Array:
        """Polymerization speed at concentration c [L/T]; main text `vp`."""
        return self.law.value(c, self.v_p0, self.c_r)

    def v_p_derivatives(self, c: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """(v_p, v_p', v_p'', ...) at c, to `order`."""
        return self.law.derivatives(c, self.v_p0, self.c_r, order)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all numbers."""
        return tuple(DIMENSIONS)

    def value(self, name: str) -> float:
        """The number of a name. Raises InvalidInput for a name that is not among `names`."""
        refuse_unknown([name], self.names, "parameter")
        return float(getattr(self, name))

    def dimension(self, name: str) -> str | None:
        """Dimension of a number such as "L^2/T"; None for one that has none."""
        return DIMENSIONS.get(name)

    @property
    def rate(self) -> float:
        """The fastest of turnover, diffusion over R0 and treadmilling over R0 [1/T].

        The unit in which fast, slow and steady are measured. Raises InvalidInput if nothing
        ever happens, or if it is so fast or slow that powers of a time step are no numbers.
        """
        rates = (self.beta, self.D / self.R0 / self.R0, abs(float(self.v_p(self.c0))) / self.R0)
        if not math.isfinite(max(rates)):
            raise InvalidInput(
                f"beta, D/R0^2 and v_p(c0)/R0 must be finite, got {', '.join(map(str, rates))}"
            )
        if max(rates) == 0.0:
            raise InvalidInput(
                "nothing would ever change: one of beta, D and v_p(c0) must be > 0, all are 0"
            )
        if not SLOWEST <= max(rates) <= FASTEST:
            raise InvalidInput(
                f"the fastest of beta, D/R0^2 and v_p(c0)/R0 must be {SLOWEST:g} to {FASTEST:g}, "
                f"got {max(rates):g}; choose other units"
            )
        return max(rates)

    def replace(self, **changes: Any) -> Parameters:
        """A copy with some parameters changed; unknown names are refused."""
        refuse_unknown(changes, PARAMETER_NAMES, "parameter")
        return replace(self, **changes)

    def as_dict(self) -> dict[str, float | str]:
        """Plain numbers and the law's name, in the order of the fields."""
        values = {name: getattr(self, name) for name in PARAMETER_NAMES}
        return values | {"law": self.law.name}

    @property
    def description(self) -> str:
        """The parameters that count: D, v_p0, and what is not as in the paper's table.

        >>> Parameters(v_p0=6.0).description
        "D = 0.03, v_p0 = 6, all else as in the paper's table"
        """
        kept = "the paper's table" if self.units is None else "the paper's cell"
        named = [f"{name} = {text}" for name, text in self._telling().items()]
        return ", ".join([*named, f"all else as in {kept}"])

    def __repr__(self) -> str:
        if self.units is not None:
            parts = (f"{name}={text!r}" for name, text in self._telling().items())
            return f"Parameters.physical({', '.join(parts)})"
        values = self.as_dict()
        parts = (f"{name}={values[name]!r}" for name in self._telling())
        return f"Parameters({', '.join(parts)})"

    def _repr_html_(self) -> str:
        meanings = {f.name: f.metadata.get("doc", "") for f in fields(self)}
        rows = []
        for name, value in self.as_dict().items():
            dimension = self.dimension(name)
            number, unit = value, dimension or ""
            if dimension and self.units is not None:
                number, unit = self.quantity(value, dimension).magnitude, customary_unit(dimension)
            meaning = meanings.get(name) or "constitutive relation of the cortex"
            rows.append((name, shown(number), unit, meaning))
        return html_table("Parameters", rows, ("name", "value", "unit", "meaning"))

    def _telling(self) -> dict[str, str]:
        """D, v_p0 and what differs from the paper's values, as texts."""
        usual = (Parameters() if self.units is None else Parameters.physical())._texts()
        own = self._texts()
        return {
            name: text
            for name, text in own.items()
            if name in ("D", "v_p0") or text != usual.get(name)
        }

    def _texts(self) -> dict[str, str]:
        """All parameters as results show them."""
        return {name: shown(value) for name, value in self.quantities().items()}


PARAMETER_NAMES = tuple(f.name for f in fields(Parameters) if f.name != "units")

DIMENSIONS = {f.name: f.metadata["unit"] for f in fields(Parameters) if "kind" in f.metadata}
"""Dimension of each parameter, such as "L^2/T"; the law has none."""


def _own_units(si: Mapping[str, float]) -> Units:
    if si["beta"] > 0:
        time = 1 / si["beta"]
    elif si["D"] > 0:
        time = si["R0"] ** 2 / si["D"]
    else:
        raise InvalidInput("beta and D must not both be 0: one of them sets the unit of time")
    return Units(
        length=si["R0"],
        time=time,
        mass=si["eta_s"] * time,
        filaments=si["c_r"] * si["R0"] ** 2,
    )


def parameters_from(mapping: Mapping[str, Any]) -> Parameters:
    """Parameters from names and values; those not named keep the paper's table values.

    Raises InvalidInput for an unknown name or a value that is refused.
    """
    refuse_unknown(mapping, PARAMETER_NAMES, "parameter")
    return Parameters(**mapping)


def parameters_to_toml(p: Parameters) -> str:
    """The parameters as TOML text; `parameters_from_toml` reads them back equal.

    Raises InvalidInput for a law that a text cannot hold.
    """
    refuse_unwritable(p.law)
    return tomli_w.dumps(p.as_dict())


def parameters_from_toml(text: str) -> Parameters:
    """Parameters from TOML text. Raises InvalidInput if it is not valid TOML."""
    return parameters_from(toml_document(text, "the parameters"))
