"""Stresses of the cortex: viscous, elastic, and an active isotropic stress tau(c).

The isotropic stress is (chi - alpha) c: the contractility of myosin, and its opposite, the elastic
resistance of the paper. `stress` adds any other, such as a contractility that saturates: a class
with a `value`, an expression or a Python function.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.constitutive import Relation
from amoeboid.model.specified import FromExpression, FromFunction, made
from amoeboid.numerics.traced import Traced
from amoeboid.validation import number, validate


def principal_stresses(
    stretch_1: Any, stretch_2: Any, tau: Any, zeta0: Any, p: Any
) -> tuple[Any, Any]:
    """Principal stresses at principal strain rates of the cortex [M/T^2]; SI `passive`.

    Viscous stress, isotropic stress tau(c) and tension zeta_0.
    """
    isotropic = (stretch_1 + stretch_2) * p.eta_b + tau + zeta0
    return isotropic + stretch_1 * (2 * p.eta_s), isotropic + stretch_2 * (2 * p.eta_s)


CONTRACTILITY = "M L^2/(T^2 N)"


class Stress(Relation):
    """An active isotropic stress tau(c; c_r) [M/T^2], positive where the cortex contracts.

    A subclass states `value` and a `name`. Numbers among the fields of a dataclass are parameters
    of its own, `stress.k` in `Parameters`.
    """

    noun: ClassVar[str] = "stress"
    symbols: ClassVar[tuple[str, ...]] = ("c", "c_r")

    @abstractmethod
    def value(self, c: Any, c_r: Any) -> Any:
        """tau(c; c_r) [M/T^2], in arithmetic and functions of NumPy; c: array or `Taylor`."""

    def derivatives(self, c: ArrayLike, c_r: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """(tau, tau', tau'', ...) with respect to c, to `order` [M/T^2 over powers of N/L^2].

        c and c_r [N/L^2] broadcast. Raises as Law.derivatives does.
        """
        return self._to_order(order, (c, c_r))

    def _value(self, at: Sequence[Any]) -> Any:
        return self.value(*at)


@dataclass(frozen=True)
class NoStress(Stress):
    """tau = 0, the model of the paper."""

    name = "none"

    def value(self, c: Any, c_r: Any) -> Any:
        """See Stress.value."""
        return 0.0


@dataclass(frozen=True)
class Saturating(Stress):
    """tau = chi c/(1 + c/c_s): contractility that motors limit, chi c_s at most.

    >>> float(Saturating(chi=0.3, c_s=2.0).derivatives(2.0, 1.0, 1)[0])
    0.3
    """

    chi: float = number(0.0, "contractility per filament at low concentration", CONTRACTILITY)
    c_s: float = number(1.0, "concentration at which half of it remains", "N/L^2", gt=0)
    name = "saturating"

    def __post_init__(self) -> None:
        validate(self, "stress")

    def value(self, c: Any, c_r: Any) -> Any:
        """See Stress.value."""
        return self.chi * c / (1.0 + c / self.c_s)


NAMED_STRESSES: dict[str, type[Stress]] = {"none": NoStress, "saturating": Saturating}


class CustomStress(FromExpression, Stress):
    """A stress that an expression in c and c_r gives, such as `chi*c/(1 + c/c_r)`."""

    named: ClassVar[Mapping[str, type[Relation]]] = NAMED_STRESSES

    def value(self, c: Any, c_r: Any) -> Any:
        """See Stress.value."""
        return self._value((c, c_r))


class FunctionStress(FromFunction, Stress):
    """A stress that a Python function of c, c_r and parameters of its own gives."""

    def value(self, c: Any, c_r: Any) -> Any:
        """See Stress.value."""
        return self._value((c, c_r))


AnyStress = str | Stress | Callable[..., Any]


def stress(spec: AnyStress, own: Mapping[str, Any] | None = None) -> Stress:
    """The stress that a word, an expression in c or a Python function stands for.

    `own` holds values of its own parameters. Raises InvalidInput.
    """
    return made(spec, own or {}, Stress, NAMED_STRESSES, CustomStress, FunctionStress)  # type: ignore[type-abstract]


class StressField:
    """Descriptor of a dataclass field that is set to what `stress` takes, and read as a stress."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object | None, owner: type) -> Stress:
        """The stress; of the class, the default one."""
        return NoStress() if instance is None else instance.__dict__[self._name]

    def __set__(self, instance: object, value: AnyStress) -> None:
        """Take what `stress` takes. Raises InvalidInput."""
        instance.__dict__[self._name] = stress(value)


def isotropic_stress(
    active: Stress, c: ArrayLike, slope: Any, c_r: ArrayLike, order: int
) -> tuple[Array, ...]:
    """tau and its derivatives, to `order`: `slope` c, slope = chi - alpha, plus the active stress.

    SI `surfaceStressAlpha` without its viscous part.
    """
    c = c if isinstance(c, Traced) else np.asarray(c)
    tau = slope * c
    zero = np.zeros_like(tau) if order else tau
    slopes = (slope, *[0.0] * order)[:order]
    linear = (tau, *(s + zero for s in slopes))
    if isinstance(active, NoStress):
        return linear
    found = active.derivatives(c, c_r, order)
    return tuple(e + a for e, a in zip(linear, found, strict=True))
