"""Constitutive relations: functions of the filament concentration c with parameters of their own.

A polymerization law and an active stress are relations. A relation states its value once, in
arithmetic and functions of NumPy; its derivatives to any order follow by Taylor arithmetic. It may
be a class, an expression such as `v_p0/(1 + (c/c_r)**n)`, or a Python function (`specified`).
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from numbers import Number, Real
from typing import Any, ClassVar, Self

import numpy as np

from amoeboid.arrays import Array, all_finite
from amoeboid.numerics.taylor import Taylor
from amoeboid.numerics.traced import Traced
from amoeboid.validation import InvalidInput

# Step of difference quotients, relative to c: cube root of the rounding.
STEP = 6e-6


class NoDerivatives(InvalidInput):
    """The relation has values, but no derivatives."""


class Relation(ABC):
    """A function of c and of the parameters `symbols`, with parameters of its own."""

    noun: ClassVar[str]
    """What it is called in messages and in the names of its parameters: `law`, `stress`."""
    symbols: ClassVar[tuple[str, ...]]
    """The arguments, c first."""
    name: str
    above: ClassVar[float | None] = None
    """c must be greater than this everywhere."""

    @abstractmethod
    def _value(self, at: Sequence[Any]) -> Any:
        """The value at (c, ...), where c is an array or a Taylor series."""

    @property
    def own(self) -> dict[str, Any]:
        """Parameters of its own by name: the fields of its dataclass that are numbers."""
        names = _field_names(type(self))
        if not names:
            return {}
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if _is_number(value)}

    def replaced(self, own: Mapping[str, Any]) -> Self:
        """The relation with other values of its own parameters.

        Raises InvalidInput for a name that it does not have, and a value that is no finite number.
        """
        if not own:
            return self
        self.refuse_unknown_own(own)
        return replace(self, **self.checked_own(own))  # type: ignore[type-var]

    def with_values(self, own: Mapping[str, Any]) -> Self:
        """The same with the values `own`, which may be complex, or arrays that broadcast."""
        changed = copy.copy(self)
        for name, value in own.items():
            object.__setattr__(changed, name, value)
        return changed

    def __str__(self) -> str:
        return self.name

    def __eq__(self, other: object) -> bool:
        """Relations of one class with the same attributes are equal."""
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((type(self), self.name))

    def refuse_unknown_own(self, own: Mapping[str, Any]) -> None:
        """Raise InvalidInput for a name that is no parameter of its own."""
        known = self.own
        for name in own:
            if name not in known:
                has = f"it has {', '.join(known)}" if known else "it has none"
                raise InvalidInput(
                    f"the {self.noun} {self.name!r} has no parameter {name!r}, {has}; "
                    f"leave {self.noun}.{name} out"
                )

    def checked_own(self, own: Mapping[str, Any]) -> dict[str, Any]:
        """The values of `own`, if all are finite numbers. Raises InvalidInput."""
        for name, value in own.items():
            if not isinstance(value, Real) or isinstance(value, bool) or not _is_finite(value):
                raise InvalidInput(f"{self.noun}.{name} must be a finite number, got {value!r}")
        return dict(own)

    def _to_order(self, order: int, at: Sequence[Any]) -> tuple[Array, ...]:
        """Value and derivatives with respect to c, to `order`; arrays broadcast.

        Raises InvalidInput where one is not finite, NoDerivatives where there are none. Of a Traced
        c the derivatives are Traced too, and nobody looks at them.
        """
        if isinstance(at[0], Traced):
            return tuple(self._traced(order, at))
        c = _floating(at[0])
        others = [x if isinstance(x, float) else _floating(x) for x in at[1:]]
        shape = np.shape(c)
        special = [x for x in (*others, *self.own.values()) if not isinstance(x, float)]
        real = not (_is_complex(c) or any(map(_is_complex, special)))
        arrays = [x for x in special if isinstance(x, np.ndarray)]
        if arrays:
            shape = np.broadcast_shapes(shape, *(x.shape for x in arrays))
        with np.errstate(all="ignore"):
            if order == 0:
                found = [self._value_at(c, others)]
            else:
                found = self._series_at(c, others, order).derivatives()
        return tuple(self._finite(k, v, c, shape, real=real) for k, v in enumerate(found))

    def refuse_undefined(self, c: Any) -> None:
        """Raise InvalidInput for a c that is not greater than `above`.

        Of a Traced c, whose numbers are not known yet, whoever computes with it has to tell.
        """
        here = c.coefficients[0] if isinstance(c, Taylor) else c
        if self.above is None or isinstance(here, Traced):
            return
        here = np.real(here)
        if np.any(here <= self.above):
            raise InvalidInput(
                f"the {self.name} {self.noun} needs c > {self.above:g} everywhere, got "
                f"c = {np.min(here):.6g}; use a smaller perturbation or another {self.noun}"
            )

    def _traced(self, order: int, at: Sequence[Any]) -> list[Any]:
        try:
            if order == 0:
                return [self._value(at)]
            found = self._value((Taylor.variable(at[0], order), *at[1:]))
        except InvalidInput:
            raise
        except Exception as error:
            raise InvalidInput(
                f"the {self.noun} {self.name!r} must consist of arithmetic and NumPy functions "
                f"for many cells at once ({error}); use np.where for branches, or solve for the "
                "cells one by one"
            ) from error
        return found.derivatives() if isinstance(found, Taylor) else [found, *[0.0] * order]

    def _value_at(self, c: Any, others: list[Any]) -> Any:
        try:
            return self._value((c, *others))
        except InvalidInput:
            raise
        except ArithmeticError as error:
            raise InvalidInput(f"the {self.noun} {self.name!r} must be finite: {error}") from error
        except Exception as error:
            if any(map(np.iscomplexobj, (c, *others, *self.own.values()))):
                raise self._without_derivatives(error) from error
            raise InvalidInput(
                f"the {self.noun} {self.name!r} must accept an array of concentrations, it raised "
                f"{type(error).__name__}: {error}; use np.where or np.vectorize"
            ) from error

    def _series_at(self, c: Any, others: list[Any], order: int) -> Taylor:
        series = Taylor.variable(c, order)
        try:
            found = self._value((series, *others))
        except InvalidInput:
            raise
        except Exception as error:
            self._value_at(c, others)  # what fails for an array too is no matter of derivatives
            raise self._without_derivatives(error) from error
        return found if isinstance(found, Taylor) else Taylor([found], order)

    def _without_derivatives(self, error: Exception) -> NoDerivatives:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        return NoDerivatives(
            f"the {self.noun} {self.name!r} must have derivatives here, it has only values "
            f"({reason[:200]}); write it with arithmetic and NumPy functions such as np.exp, "
            "without branches and tables; 3D runs accept it as it is"
        )

    def _finite(self, k: int, found: Any, c: Any, shape: tuple[int, ...], *, real: bool) -> Array:
        """Derivative k as an array of floating-point numbers, real ones if all that is given is.

        Raises InvalidInput if it is none, or not finite.
        """
        value = np.asarray(found)
        if real and value.dtype == float and value.shape == shape and all_finite(value):
            return value
        if value.dtype.kind in "bui":
            value = value.astype(float)
        if real and value.dtype.kind == "c":
            where = np.ravel(c)[0] if np.size(c) else c
            raise InvalidInput(
                f"{self._named(k)} must be a real number, it is complex at c = {where:.6g}"
            )
        try:
            value = value if value.shape == shape else np.broadcast_to(value, shape)
            good = np.isfinite(value)
            if good.all():
                return value
        except (TypeError, ValueError):
            raise InvalidInput(
                f"{self._named(k)} must be one number for each c, got "
                f"{type(found).__name__} of shape {np.shape(found)} for c of shape {np.shape(c)}"
            ) from None
        at = np.broadcast_to(c, shape)
        bad = ~good & np.isfinite(at)  # where c itself is none, the law is not to blame
        if bad.any():
            where = at[bad].flat[0]
            raise InvalidInput(f"{self._named(k)} must be finite, it is not at c = {where:.6g}")
        return value

    def _named(self, k: int) -> str:
        return f"{f'derivative {k} of ' if k else ''}the {self.noun} {self.name!r}"


@dataclass(frozen=True)
class Differences:
    """A relation whose slope is a central difference of its values, for those that have no other.

    The step is `STEP` of c: truncation and rounding errors of 1e-8 or less of a smooth relation.
    """

    relation: Any

    @property
    def own(self) -> dict[str, Any]:
        """See Relation.own."""
        return self.relation.own

    def derivatives(self, c: Any, *rest: Any) -> tuple[Array, ...]:
        """Value and slope at (c, ..., order); order <= 1."""
        *others, order = rest
        found = self.relation.derivatives(c, *others, 0)
        if order == 0:
            return found
        c = np.asarray(c)
        step = STEP * np.where(c == 0, 1.0, c)
        low, high = (self.relation.derivatives(c + k * step, *others, 0)[0] for k in (-1, 1))
        return (*found, (high - low) / (2 * step))


@cache
def _field_names(kind: type) -> list[str]:
    return [f.name for f in fields(kind) if f.init] if is_dataclass(kind) else []


def _is_number(value: Any) -> bool:
    return isinstance(value, Number | np.ndarray) and not isinstance(value, bool)


def _is_complex(value: Any) -> bool:
    if isinstance(value, np.ndarray | np.generic):
        return value.dtype.kind == "c"
    return isinstance(value, complex)


def _is_finite(value: Any) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _floating(x: Any) -> Any:
    array = np.asarray(x)
    array = array if array.dtype.kind in "fc" else array.astype(float)
    return array if array.ndim else array[()]
