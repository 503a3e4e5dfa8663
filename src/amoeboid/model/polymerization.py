"""Polymerization laws: the speed v_p(c) at which filaments grow against the membrane.

To add a law, write a class with a `value`, an expression or a Python function; no list must know
of it. Only what a configuration file names by a word is listed in `NAMED_LAWS`.
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


class Law(Relation):
    """A polymerization law v_p(c; v_p0, c_r); v_p is a velocity, c a surface density.

    A subclass states `value` and a `name`. Numbers among the fields of a dataclass are parameters
    of its own, `law.n` in `Parameters`.

    >>> @dataclass(frozen=True)
    ... class Hill(Law):
    ...     n: float = 2.0
    ...     name = "hill"
    ...     def value(self, c, v_p0, c_r):
    ...         return v_p0 / (1 + (c / c_r) ** self.n)
    >>> [float(d) for d in Hill(n=3).derivatives(1.0, 2.0, 1.0, order=1)]
    [1.0, -1.5]
    """

    noun: ClassVar[str] = "law"
    symbols: ClassVar[tuple[str, ...]] = ("c", "v_p0", "c_r")

    @abstractmethod
    def value(self, c: Any, v_p0: Any, c_r: Any) -> Any:
        """v_p(c; v_p0, c_r) [L/T], in arithmetic and functions of NumPy.

        c may be an array or a `Taylor`.
        """

    def derivatives(
        self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike, order: int = 3
    ) -> tuple[Array, ...]:
        """(v_p, v_p', v_p'', ...) with respect to c, to `order` [L/T over powers of N/L^2].

        Real or complex c; it broadcasts with v_p0 [L/T] and c_r [N/L^2]. Raises InvalidInput where
        the law is not defined, NoDerivatives for order > 0 if `value` is not made of arithmetic and
        functions of NumPy.
        """
        return self._to_order(order, (c, v_p0, c_r))

    def _value(self, at: Sequence[Any]) -> Any:
        return self.value(*at)


@dataclass(frozen=True)
class Exponential(Law):
    """v_p = v_p0 exp(-c/c_r); main text `vp`."""

    name = "exponential"

    def value(self, c: Any, v_p0: Any, c_r: Any) -> Any:
        """See Law.value."""
        return v_p0 * np.exp(-c / c_r)


@dataclass(frozen=True)
class Inverse(Law):
    """v_p = v_p0 c_r / c, growth limited by monomers; SI `eq_v_c_inverse`."""

    name = "inverse"
    above = 0.0

    def value(self, c: Any, v_p0: Any, c_r: Any) -> Any:
        """See Law.value; refused where c <= 0."""
        self.refuse_undefined(c)
        return v_p0 * c_r / c


NAMED_LAWS: dict[str, type[Law]] = {"exponential": Exponential, "inverse": Inverse}


class Custom(FromExpression, Law):
    """A law that an expression in c, v_p0 and c_r gives, such as `v_p0/(1 + (c/c_r)**n)`.

    >>> Custom("v_p0/(1 + (c/c_r)**n)", n=3).own
    {'n': 3.0}
    """

    named: ClassVar[Mapping[str, type[Relation]]] = NAMED_LAWS

    def value(self, c: Any, v_p0: Any, c_r: Any) -> Any:
        """See Law.value."""
        return self._value((c, v_p0, c_r))


class FunctionLaw(FromFunction, Law):
    """A law that a Python function of c, v_p0, c_r and parameters of its own gives."""

    def value(self, c: Any, v_p0: Any, c_r: Any) -> Any:
        """See Law.value."""
        return self._value((c, v_p0, c_r))


AnyLaw = str | Law | Callable[..., Any]


def law(spec: AnyLaw, own: Mapping[str, Any] | None = None) -> Law:
    """The law that a word, an expression in c or a Python function stands for; a Law is a law.

    `own` holds values of its own parameters. Raises InvalidInput, also for a Law without a name.
    """
    return made(spec, own or {}, Law, NAMED_LAWS, Custom, FunctionLaw)  # type: ignore[type-abstract]


class LawField:
    """Descriptor of a dataclass field that is set to what `law` takes, and read as a law."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object | None, owner: type) -> Law:
        """The law; of the class, the default one."""
        return Exponential() if instance is None else instance.__dict__[self._name]

    def __set__(self, instance: object, value: AnyLaw) -> None:
        """Take what `law` takes. Raises InvalidInput."""
        instance.__dict__[self._name] = law(value)
