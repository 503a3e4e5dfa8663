"""Surroundings that a cell can push itself off: a fluid, a matrix, patches, a channel, several.

An environment says what power it takes up when the surface of a cell moves; everything else
follows from that (`balance`). One of your own, here a matrix that is denser far from the axis of
the cell, is a class with one method:

    @dataclass(frozen=True)
    class Denser(am.Environment):
        def dissipation(self, surface):
            points = surface.everywhere
            gamma = 1 + (points.x[:, 0]**2 + points.x[:, 1]**2)
            return points.drag(gamma, gamma)

    am.migrate(state, Denser())
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np

from amoeboid.arrays import Array
from amoeboid.display import short_repr
from amoeboid.model.units import Units, measured
from amoeboid.motility.surfaces import (
    RIGID,
    Surroundable,
)
from amoeboid.validation import InvalidInput

VISCOSITY, FRICTION = "M/(L T)", "M/(L^2 T)"
EXAMPLES = {VISCOSITY: "1 mPa s", FRICTION: "1 Pa s/um"}
# The viscosity and the friction of an environment that is given none, where cells have units.
WATER, SOFT = "1 mPa s", "1 Pa s/um"


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Base of all environments; `coupled`: the share of the surface that moves with the cortex.

    Transmembrane proteins couple the outside of a cell to its cortex. With a share below 1 the
    surroundings feel that share of the tangential flow; normal motion they feel in full.
    """

    __repr__ = short_repr

    coupled: float = 1.0
    name: ClassVar[str] = ""

    def __post_init__(self) -> None:
        _check_share(self.coupled)

    def dissipation(self, surface: Surroundable) -> Array:
        """Power (9, 9) that is taken up from the nine ways in which a surface moves.

        An entry has the unit of a power for speeds of the two ways: [M L^2/T^3] for the flow of the
        cell, which has a velocity; see `amoeboid.motility.surfaces`.
        """
        raise NotImplementedError

    def felt(self, surface: Surroundable) -> Array:
        """Shares (3,) of tangential flow, normal motion and cortex flow that it feels [1]."""
        return np.array([self.coupled, 1.0, 0.0])

    def free(self, surface: Surroundable) -> Array:
        """The k rigid motions (k, 6) that it leaves to the cell, orthonormal [1]."""
        return np.eye(RIGID)

    def uncertainty(self, surface: Surroundable) -> Array:
        """Error (6,) of force [M L/T^2] and torque that the flow of the cell meets, if known."""
        return np.zeros(RIGID)

    def of(self, units: Units | None) -> Environment:
        """This environment with its quantities as numbers in these units.

        Raises InvalidInput for a quantity without units of the cell, and the other way round.
        """
        return self._with(units, _number)

    def settled(self, units: Units | None) -> Environment:
        """The same, with numbers left as they are: those of a run are in its own units."""
        return self._with(units, _number_or_kept)

    def _with(self, units: Units | None, convert: Callable[..., float]) -> Environment:
        """This environment with `convert`ed values of the fields that have a dimension."""
        changes = {
            f.name: convert(f"{self.name}.{f.name}", getattr(self, f.name), f.metadata, units)
            for f in fields(self)
            if "dimension" in f.metadata
        }
        return replace(self, **changes) if changes else self

    @property
    def parts(self) -> tuple[Environment, ...]:
        """The environments that act at once: this one alone."""
        return (self,)


def dimensional(dimension: str, usual: str) -> dict[str, str]:
    """About a field with a dimension; `usual` is its physical value where None is given."""
    return {"dimension": dimension, "usual": usual}


def _number(label: str, given: Any, about: Any, units: Units | None) -> float:
    dimension = about["dimension"]
    if units is None:
        given = 1.0 if given is None else given
        if isinstance(given, bool) or not isinstance(given, int | float | np.number):
            raise InvalidInput(
                f"{label} must be a plain number, got {given!r}; quantities with units need a "
                "cell with units, from Parameters.physical (--physical)"
            )
        value = float(given)
    else:
        given = about["usual"] if given is None else given
        plain = isinstance(given, int | float | np.number) and not isinstance(given, bool)
        if plain and given == 0:
            return 0.0
        if plain:
            raise InvalidInput(
                f"{label} must have a unit, since the cell has units, such as "
                f"{EXAMPLES[dimension]!r}, got {given:g}"
            )
        value = measured(label, given, dimension, EXAMPLES[dimension]) / units.of(dimension)
    if not (math.isfinite(value) and value >= 0.0):
        raise InvalidInput(f"{label} must be >= 0 and finite, got {given!r}")
    return value


def _number_or_kept(label: str, given: Any, about: Any, units: Units | None) -> float:
    plain = isinstance(given, int | float | np.number) and not isinstance(given, bool)
    return _number(label, given, about, None if plain else units)


def _check_share(share: Any) -> None:
    number = isinstance(share, int | float | np.number) and not isinstance(share, bool)
    if not number or not 0.0 <= share <= 1.0:
        raise InvalidInput(
            f"coupled must be a fraction of the surface from 0 to 1, got {share!r}; 1 couples all "
            "of it"
        )


@dataclass(frozen=True, repr=False)
class Fluid(Environment):
    """A viscous fluid at rest far away, without inertia.

    `viscosity` [M/(L T)]: a quantity such as "1 mPa s" for a cell with units (water by default),
    else a number. The velocity does not depend on it.
    """

    viscosity: Any = field(default=None, metadata=dimensional(VISCOSITY, WATER))
    name: ClassVar[str] = "fluid"

    def dissipation(self, surface: Surroundable) -> Array:
        """Power taken up by the fluid outside."""
        return float(self.viscosity) * surface.fluid

    def uncertainty(self, surface: Surroundable) -> Array:
        """The difference between the reciprocal theorem and the force on the flow itself."""
        return float(self.viscosity) * surface.fluid_error @ self.felt(surface)[:2]


@dataclass(frozen=True, repr=False)
class Matrix(Environment):
    """A matrix that drags each point of the surface by itself.

    `tangential`, `normal` [M/(L^2 T)]: drag per area and velocity along the surface and along its
    normals; `normal` is as `tangential` if left out. `per_filament`: they are those where c = c0,
    the mean over the surface, and in proportion to c.
    """

    tangential: Any = field(default=None, metadata=dimensional(FRICTION, SOFT))
    normal: Any = field(default=None, metadata=dimensional(FRICTION, SOFT))
    per_filament: bool = False
    name: ClassVar[str] = "matrix"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.per_filament, bool):
            raise InvalidInput(
                f"matrix.per_filament must be true or false, got {self.per_filament!r}"
            )

    def _with(self, units: Units | None, convert: Callable[..., float]) -> Matrix:
        """This matrix with `convert`ed drags."""
        about = dimensional(FRICTION, SOFT)
        given = self.tangential if self.normal is None else self.normal
        tangential = convert("matrix.tangential", self.tangential, about, units)
        normal = convert("matrix.normal", given, about, units)
        if tangential == 0.0 == normal:
            raise InvalidInput(
                "a matrix must have some drag, got tangential = normal = 0; raise one of them"
            )
        return replace(self, tangential=tangential, normal=normal)

    def dissipation(self, surface: Surroundable) -> Array:
        """Power taken up at all points. Raises InvalidInput for `per_filament` without c."""
        points = surface.everywhere
        share = np.ones_like(points.c)
        if self.per_filament:
            if not surface.has_concentration:
                raise InvalidInput(
                    "per_filament must be false for a surface without a concentration c; give c, "
                    "or leave it out"
                )
            share = points.c * (points.weights.sum() / (points.weights @ points.c))
        return points.drag(self.tangential * share, self.normal * share)


@dataclass(frozen=True, repr=False)
class CortexDrag(Environment):
    """Drag on the velocity of the cortex, v_c instead of v, the same at all points.

    `friction` [M/(L^2 T)]: a quantity such as "1 Pa s/um" for a cell with units, else a number; the
    velocity does not depend on it.

    It is what `cortex_drag_speed` and the columns `cortex_drag_x, ...` of a run assume.
    """

    friction: Any = field(default=None, metadata=dimensional(FRICTION, SOFT))
    name: ClassVar[str] = "cortex"

    def felt(self, surface: Surroundable) -> Array:
        """The flow of the cortex alone. Raises InvalidInput where it is not known."""
        if not surface.has_cortex:
            raise InvalidInput(
                "the environment 'cortex' needs the flow of the cortex, which is unknown for a "
                "measured surface; use another, such as 'fluid' or 'matrix'"
            )
        return np.array([0.0, 0.0, self.coupled])

    def dissipation(self, surface: Surroundable) -> Array:
        """Power taken up at all points."""
        return surface.everywhere.drag(self.friction, self.friction)


class Mixed(Environment):
    """Several environments at once: `Mixed(Fluid(), Patch(half_angle=20))`; the total force is 0.

    The drags count with their sizes: give each environment its viscosity or friction.
    """

    name = "mixed"

    def __init__(self, *parts: Environment) -> None:
        if len(parts) < 2 or not all(isinstance(part, Environment) for part in parts):
            raise InvalidInput(f"Mixed takes two or more environments, got {str(parts)[:100]}")
        object.__setattr__(self, "given", tuple(p for part in parts for p in part.parts))
        object.__setattr__(self, "coupled", 1.0)

    @property
    def parts(self) -> tuple[Environment, ...]:
        """The environments that act at once."""
        return self.given  # type: ignore[attr-defined]

    def _with(self, units: Units | None, convert: Callable[..., float]) -> Mixed:
        """The same with `convert`ed values in each part."""
        return Mixed(*(part._with(units, convert) for part in self.parts))

    def __repr__(self) -> str:
        return f"Mixed({', '.join(map(repr, self.parts))})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mixed) and self.parts == other.parts

    def __hash__(self) -> int:
        return hash(self.parts)

    def __reduce__(self) -> tuple[Any, ...]:
        return Mixed, self.parts
