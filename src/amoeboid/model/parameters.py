"""The model's parameters, with the paper's symbols and the defaults of its parameter table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import tomli_w
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.polymerization import LawField, refuse_unwritable
from amoeboid.validation import InvalidInput, number, refuse_unknown, toml_document, validate

# Range of `Parameters.rate`: fourth powers of time steps must be numbers.
SLOWEST, FASTEST = 1e-60, 1e60


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

    def __post_init__(self) -> None:
        validate(self)

    def v_p(self, c: ArrayLike) -> Array:
        """Polymerization speed at concentration c [L/T]; main text `vp`."""
        return self.law.value(c, self.v_p0, self.c_r)

    def v_p_derivatives(self, c: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """(v_p, v_p', v_p'', ...) at c, to `order`."""
        return self.law.derivatives(c, self.v_p0, self.c_r, order)

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
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return values | {"law": self.law.name}


PARAMETER_NAMES = tuple(f.name for f in fields(Parameters))


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
