"""The model's parameters, with the paper's symbols and the defaults of its parameter table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from amoeboid.display import html_table, shown
from amoeboid.model.material import Material
from amoeboid.model.physical import PAPER_CELL, SI, number_in, own_number, own_units
from amoeboid.model.polymerization import NAMED_LAWS, LawField, law
from amoeboid.model.specified import declared_dimension, refuse_unwritable
from amoeboid.model.stress import (
    NAMED_STRESSES,
    StressField,
    stress,
)
from amoeboid.model.units import Units, customary_unit, quantity
from amoeboid.toml import toml_text
from amoeboid.validation import InvalidInput, number, refuse_unknown, toml_document, validate

# Range of `Parameters.rate`: fourth powers of time steps must be numbers.
SLOWEST, FASTEST = 1e-60, 1e60


class ParameterPoint(Material):
    """Parameters as plain attributes, unchecked; some may be complex."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self.__dict__.update(values)

    def replaced(self, values: Mapping[str, Any]) -> ParameterPoint:
        """The same with other values, also of `law.n`."""
        if values.keys() <= DIMENSIONS.keys():
            return ParameterPoint({**self.__dict__, **values})
        plain, own = _split(values)
        relations = {
            kind: getattr(self, kind).with_values(own[kind]) for kind in RELATIONS if own[kind]
        }
        return ParameterPoint(self.__dict__ | relations | plain)


@dataclass(frozen=True, kw_only=True)
class Parameters(Material):
    """One parameter point; any consistent units, defaults in the paper's simulation units.

    Dimensions: L length, T time, M mass, N number of filaments. Law and stress may have parameters
    of their own; their names are `law.n`, `stress.k`. Raises InvalidInput for a value outside its
    range, a wrong type, NaN or infinity.

    >>> from amoeboid.model.polymerization import Custom
    >>> p = Parameters(law=Custom("v_p0/(1 + (c/c_r)**n)", n=3), chi=0.3)
    >>> p.replace(**{"law.n": 4, "chi": 0.2}).value("law.n")
    4.0
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
    chi: float = number(0.0, "contractility per filament", "M L^2/(T^2 N)", ge=0)
    kappa: float = number(0.0, "bending stiffness of the membrane", "M L^2/T^2", ge=0)
    gamma_t: float = number(
        0.0, "friction coefficient of the surface, tangential", "M/(L^2 T)", ge=0
    )
    gamma_n: float = number(0.0, "friction coefficient of the surface, normal", "M/(L^2 T)", ge=0)
    gamma_c: float = number(0.0, "friction coefficient of the cortex, isotropic", "M/(L^2 T)", ge=0)
    gamma_share: float = number(
        0.0, "fraction of the friction that is proportional to c", ge=0, le=1
    )
    law: LawField = LawField()  # a Law, its name or expression, or a Python function
    stress: StressField = StressField()  # the same, a Stress
    units: Units | None = field(default=None, compare=False, repr=False)
    """Size of the units in SI base units, where the parameters were given in physical ones."""

    def __post_init__(self) -> None:
        validate(self)
        if self.units is not None and not isinstance(self.units, Units):
            raise InvalidInput(
                f"units must be None or Units, got {self.units!r}; for quantities with units start "
                "from Parameters.physical"
            )

    @classmethod
    def physical(cls, **quantities: Any) -> Parameters:
        """A cell from quantities with units: texts such as "10 um", or pint's own.

        What is left out is as in `PAPER_CELL`, the cell of the paper's estimates. The units of the
        numbers are those of the cell: length R0, time 1/beta (R0^2/D without turnover), mass
        eta_s/beta, filaments c_r R0^2; `units` holds their size, and `quantity` converts results
        back. Numbers in an expression and own parameters of law and stress are in the units of the
        cell; those whose dimension a class declares are quantities.
        Raises InvalidInput for an unknown name, a text that is no quantity, or a wrong dimension,
        naming the parameter.

        >>> cell = Parameters.physical(R0="10 um", v_p0="1.7 um/s")
        >>> cell.R0, f"{cell.quantity(cell.v_p0, 'L/T'):.2f~P}"
        (1.0, '1.70 µm/s')
        """
        given = {**PAPER_CELL, **quantities}
        plain, own = _split(given)
        relations: dict[str, Any] = {kind: plain.pop(kind) for kind in RELATIONS}
        si: dict[str, Any] = {
            name: number_in(SI, value, DIMENSIONS[name], name) for name, value in plain.items()
        }
        cls(**si)  # refuses values out of range in the user's own numbers
        units = own_units(si)
        values = {name: si[name] / units.of(DIMENSIONS[name]) for name in si}
        # By definition; dividing would leave rounding.
        values |= {"R0": 1.0, "eta_s": 1.0, "c_r": 1.0}
        for kind, (make, _) in RELATIONS.items():
            relations[kind] = make(relations[kind], _own(kind, own[kind], units, relations[kind]))
        return cls(**values, **relations, units=units)

    def quantity(self, value: Any, dimension: str) -> Any:
        """A number of a dimension such as "L/T" in the units of the cell.

        A quantity of pint if the parameters were given in physical units, else `value` itself.
        """
        return value if self.units is None else quantity(value, dimension, self.units)

    def quantities(self) -> dict[str, Any]:
        """All parameters by name, with their units if they were given in physical ones."""
        return {
            name: self.quantity(value, dimension) if (dimension := self.dimension(name)) else value
            for name, value in self.as_dict().items()
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all numbers, those of law and stress with a dot: `law.n`."""
        own = [f"{kind}.{name}" for kind in RELATIONS for name in getattr(self, kind).own]
        return (*DIMENSIONS, *own)

    def value(self, name: str) -> float:
        """The number of a name, in the units of the parameters; also of `law.n`.

        Raises InvalidInput for a name that is not among `names`.
        """
        refuse_unknown([name], self.names, "parameter")
        kind, dot, own = name.partition(".")
        return float(getattr(self, kind).own[own]) if dot else float(getattr(self, name))

    def value_in(self, name: str, units: Units | None) -> float:
        """The number of a name in the units of another cell.

        As it is where one of both has no units, or the number no known dimension.

        >>> cells = [Parameters.physical(R0=f"{size} um") for size in (10, 20)]
        >>> [cell.value_in("R0", cells[0].units) for cell in cells]
        [1.0, 2.0]
        """
        value, dimension = self.value(name), self.dimension(name)
        if self.units is None or units is None or units == self.units or dimension is None:
            return value
        return value * self.units.of(dimension) / units.of(dimension)

    def dimension(self, name: str) -> str | None:
        """Dimension of the parameter `name`, as "L^2/T"; None if a law or stress declares none."""
        kind, dot, own = name.partition(".")
        return declared_dimension(getattr(self, kind), {}, own) if dot else DIMENSIONS.get(name)

    def point(self, values: Mapping[str, Any] | None = None) -> ParameterPoint:
        """The parameters with `values` of some names in their place, unchecked, even complex."""
        names = (*DIMENSIONS, *RELATIONS)
        return ParameterPoint({name: getattr(self, name) for name in names}).replaced(values or {})

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
                "one of beta, D and v_p(c0) must be > 0, all are 0, so nothing would ever "
                "change; raise one"
            )
        if not SLOWEST <= max(rates) <= FASTEST:
            raise InvalidInput(
                f"the fastest of beta, D/R0^2 and v_p(c0)/R0 must be {SLOWEST:g} to {FASTEST:g}, "
                f"got {max(rates):g}; choose other units"
            )
        return max(rates)

    def replace(self, **changes: Any) -> Parameters:
        """A copy with some parameters changed, also `law.n`.

        `changes`: values by name; a cell with physical units takes quantities such as "2 um/s",
        plain numbers are in its units. Raises InvalidInput for an unknown name, or a value out of
        range.
        """
        if self.units is not None:
            changes = {name: self._number(name, value) for name, value in changes.items()}
        return replace(self, **_with_relations(changes, self))

    def _number(self, name: str, value: Any) -> Any:
        """The value of a parameter in the units of the cell, from a quantity or a plain number."""
        dimension = DIMENSIONS.get(name)
        if self.units is None or dimension is None or isinstance(value, int | float | np.number):
            return value
        return number_in(self.units, value, dimension, name)

    def as_dict(self) -> dict[str, float | str]:
        """Plain numbers, and names of law and stress with their own numbers, in a fixed order."""
        values: dict[str, float | str] = {name: getattr(self, name) for name in DIMENSIONS}
        for kind in RELATIONS:
            relation = getattr(self, kind)
            values |= {kind: relation.name}
            values |= {f"{kind}.{name}": value for name, value in relation.own.items()}
        return values

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
            return f"Parameters.physical({_keywords(self._telling())})"
        told = dict.fromkeys(name.partition(".")[0] for name in self._telling())
        values = {name: getattr(self, name) for name in told}
        values |= {k: v.name for k, v in values.items() if k in RELATIONS and not v.own}
        return f"Parameters({_keywords(values)})"

    def _repr_html_(self) -> str:
        meanings = {f.name: f.metadata.get("doc", "") for f in fields(self)}
        rows = []
        for name, value in self.as_dict().items():
            dimension = self.dimension(name)
            number, unit = value, dimension or ""
            if dimension and self.units is not None:
                number, unit = self.quantity(value, dimension).magnitude, customary_unit(dimension)
            kind = name.partition(".")[0]
            meaning = meanings.get(name) or MEANINGS[kind]
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
"""What a configuration may name; law and stress have numbers of their own besides."""

DIMENSIONS = {f.name: f.metadata["unit"] for f in fields(Parameters) if "kind" in f.metadata}
"""Dimension of each parameter, such as "L^2/T"; law and stress have none."""

MEANINGS = {"law": "polymerization law", "stress": "active isotropic stress"}
"""What law and stress are, and their own numbers belong to."""

RELATIONS: dict[str, tuple[Any, Mapping[str, Any]]] = {
    "law": (law, NAMED_LAWS),
    "stress": (stress, NAMED_STRESSES),
}
"""The constitutive relations of a cell: what makes one of a specification, and the named ones."""


def _keywords(values: Mapping[str, Any]) -> str:
    """Arguments as Python takes them; names with a dot, as law.n, from a dictionary."""
    plain = [f"{name}={value!r}" for name, value in values.items() if "." not in name]
    dotted = {name: value for name, value in values.items() if "." in name}
    return ", ".join([*plain, *([f"**{dotted!r}"] if dotted else [])])


def _split(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Parameters of the cell, and those of law and stress: {"law": {"n": 3}, "stress": {}}."""
    plain: dict[str, Any] = {}
    own: dict[str, dict[str, Any]] = {kind: {} for kind in RELATIONS}
    for name, value in values.items():
        kind, dot, parameter = name.partition(".")
        if dot and kind in RELATIONS:
            own[kind][parameter] = value
        else:
            plain[name] = value
    refuse_unknown(plain, PARAMETER_NAMES, "parameter")
    return plain, own


def _with_relations(values: Mapping[str, Any], base: Parameters) -> dict[str, Any]:
    """`values` by field: parameters of law and stress, given by name, are part of these."""
    plain, own = _split(values)
    for kind, (make, _) in RELATIONS.items():
        if own[kind]:
            spec = plain.get(kind, getattr(base, kind))
            numbers = own[kind] if base.units is None else _own(kind, own[kind], base.units, spec)
            plain[kind] = make(spec, numbers)
    return plain


def _own(kind: str, values: Mapping[str, Any], units: Units, spec: Any) -> dict[str, Any]:
    """Own parameters of a law or stress as numbers in the units of a cell. Raises InvalidInput."""
    _, named = RELATIONS[kind]
    return {
        name: own_number(f"{kind}.{name}", value, units, spec, named)
        for name, value in values.items()
    }


def refuse_no_parameters(found: Any) -> None:
    """Raise InvalidInput for anything but Parameters, and tell where its parameters may be."""
    if not isinstance(found, Parameters):
        own = isinstance(getattr(found, "parameters", None), Parameters)
        remedy = "; give its .parameters" if own else ""
        raise InvalidInput(f"p must be amoeboid.Parameters(...), got {found!r:.200}{remedy}")


def parameters_from(mapping: Mapping[str, Any]) -> Parameters:
    """Parameters from names and values; those not named keep the paper's table values.

    Raises InvalidInput for an unknown name or a value that is refused.
    """
    return Parameters().replace(**mapping)


def parameters_to_toml(p: Parameters) -> str:
    """The parameters as TOML text; `parameters_from_toml` reads them back equal.

    A cell with physical units is written in numbers of its own units; their size is left out.
    Raises InvalidInput for a law or a stress that a text cannot hold.

    >>> p = Parameters(D=0.4)
    >>> parameters_from_toml(parameters_to_toml(p)) == p
    True
    """
    refuse_unwritable_relations(p)
    return toml_text(p.as_dict())


def refuse_unwritable_relations(p: Parameters) -> None:
    """Raise InvalidInput for a law or a stress that a text cannot hold."""
    for kind, (make, _) in RELATIONS.items():
        refuse_unwritable(getattr(p, kind), make)


def parameters_from_toml(text: str) -> Parameters:
    """Parameters from TOML text. Raises InvalidInput if it is not valid TOML."""
    return parameters_from(toml_document(text, "the parameters"))
