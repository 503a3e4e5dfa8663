"""Constitutive relations: functions of the filament concentration c with parameters of their own.

A polymerization law and an active stress are relations. A relation states its value once, in
arithmetic and functions of NumPy; its derivatives to any order follow by Taylor arithmetic. It may
be a class, an expression such as `v_p0/(1 + (c/c_r)**n)`, or a Python function.
"""

from __future__ import annotations

import copy
import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from functools import cache
from numbers import Number, Real
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.expressions import Expression, NoExpression, parsed
from amoeboid.numerics.taylor import Taylor
from amoeboid.validation import InvalidInput, refuse_unknown

# Step of difference quotients, relative to c: cube root of the rounding.
STEP = 6e-6

AnyRelation = TypeVar("AnyRelation", bound="Relation")


class NoDerivatives(InvalidInput):
    """The relation has values, but no derivatives."""


class Relation(ABC):
    """A function of c and of the parameters `symbols`, with parameters of its own."""

    noun: ClassVar[str]
    """What it is called in messages and in the names of its parameters: `law`, `stress`."""
    symbols: ClassVar[tuple[str, ...]]
    """The arguments, c first."""
    name: str

    @abstractmethod
    def _value(self, at: Sequence[Any]) -> Any:
        """The value at (c, ...), where c is an array or a Taylor series."""

    @property
    def own(self) -> dict[str, Any]:
        """Parameters of its own by name: the fields of its dataclass that are numbers."""
        values = {name: getattr(self, name) for name in _field_names(type(self))}
        return {name: value for name, value in values.items() if _is_number(value)}

    def replaced(self, own: Mapping[str, Any]) -> Self:
        """The relation with other values of its own parameters.

        Raises InvalidInput for a name that it does not have, and a value that is no finite number.
        """
        if not own:
            return self
        self._refuse_unknown(own)
        return replace(self, **self._checked(own))  # type: ignore[type-var]

    def with_values(self, own: Mapping[str, Any]) -> Self:
        """The same with values that need not be numbers of the model: complex ones, arrays."""
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

    def _refuse_unknown(self, own: Mapping[str, Any]) -> None:
        known = self.own
        for name in own:
            if name not in known:
                has = f"it has {', '.join(known)}" if known else "it has none"
                raise InvalidInput(
                    f"the {self.noun} {self.name!r} has no parameter {name!r}, {has}; "
                    f"leave {self.noun}.{name} out"
                )

    def _checked(self, own: Mapping[str, Any]) -> dict[str, Any]:
        for name, value in own.items():
            if not isinstance(value, Real) or isinstance(value, bool) or not _is_finite(value):
                raise InvalidInput(f"{self.noun}.{name} must be a finite number, got {value!r}")
        return dict(own)

    def _to_order(self, order: int, at: Sequence[Any]) -> tuple[Array, ...]:
        """Value and derivatives with respect to c, to `order`; arrays broadcast.

        Raises InvalidInput where one is not finite, NoDerivatives where there are none.
        """
        c = _floating(at[0])
        others = [x if isinstance(x, float | complex) else _floating(x) for x in at[1:]]
        shape = np.shape(c)
        arrays = [x for x in (*others, *self.own.values()) if isinstance(x, np.ndarray)]
        if arrays:
            shape = np.broadcast_shapes(shape, *(x.shape for x in arrays))
        with np.errstate(all="ignore"):
            if order == 0:
                found = [self._value_at(c, others)]
            else:
                found = self._series_at(c, others, order).derivatives()
        return tuple(self._finite(k, v, c, shape) for k, v in enumerate(found))

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
                f"the {self.noun} {self.name!r} must take an array of concentrations, it raises "
                f"{type(error).__name__}: {error}; np.where and np.vectorize make it do so"
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
            f"the {self.noun} {self.name!r} must have derivatives here, it has values only "
            f"({reason[:200]}): write it in arithmetic and functions of NumPy such as np.exp, "
            "without branches and tables; 3D runs take it as it is"
        )

    def _finite(self, k: int, found: Any, c: Any, shape: tuple[int, ...]) -> Array:
        """Derivative k as an array. Raises InvalidInput if it is none, or not finite."""
        value = np.asarray(found)
        try:
            value = value if value.shape == shape else np.broadcast_to(value, shape)
            good = np.isfinite(value)
        except (TypeError, ValueError):
            raise InvalidInput(
                f"{self._named(k)} must be one number for each c, got "
                f"{type(found).__name__} of shape {np.shape(found)} for c of shape {np.shape(c)}"
            ) from None
        if not good.all():
            where = np.broadcast_to(c, shape)[~good].flat[0]
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


class WithOwnValues(Relation):
    """A relation whose own parameters are not fields but names with values."""

    _own: dict[str, Any]

    @property
    def own(self) -> dict[str, Any]:
        """Its parameters by name."""
        return dict(self._own)

    def with_values(self, own: Mapping[str, Any]) -> Self:
        """See Relation.with_values."""
        changed = copy.copy(self)
        object.__setattr__(changed, "_own", self._own | dict(own))
        return changed

    def replaced(self, own: Mapping[str, Any]) -> Self:
        """See Relation.replaced."""
        if not own:
            return self
        self._refuse_unknown(own)
        return self.with_values({k: float(v) for k, v in self._checked(own).items()})

    def _take(self, needed: Sequence[str], own: Mapping[str, Any]) -> None:
        """Set the own parameters; InvalidInput for one that is missing, or not `needed`."""
        object.__setattr__(self, "_own", dict.fromkeys(needed, math.nan))
        self._refuse_unknown(own)
        for name in needed:
            if name not in own:
                raise InvalidInput(
                    f"the {self.noun} {self.name!r} must have a value of {name!r}, got none; it "
                    f"may use {', '.join(self.symbols)}, pi and parameters of its own: give "
                    f"{self.noun}.{name}, as in --set {self.noun}.{name}=2, or correct the name"
                )
        values = {name: float(v) for name, v in self._checked(own).items()}
        object.__setattr__(self, "_own", {name: values[name] for name in needed})

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a {self.noun} cannot be changed; use replaced()")

    def __repr__(self) -> str:
        values = "".join(f", {name}={value:g}" for name, value in self._own.items())
        return f"{type(self).__name__}({self.name!r}{values})"

    __hash__ = Relation.__hash__


class FromExpression(WithOwnValues):
    """A relation that an expression in c gives; any other name in it is a parameter of its own.

    Arithmetic (+ - * / **, numbers, pi) and exp, log, sqrt, sin, cos, tan, sinh, cosh, tanh.
    The text is parsed, never executed. Raises InvalidInput if it holds anything else, or if a
    parameter of its own has no value.
    """

    expression: str
    named: ClassVar[Mapping[str, type[Relation]]]
    """Words that stand for relations; for messages."""

    def __init__(self, expression: str, /, **own: float) -> None:
        if not isinstance(expression, str):
            raise InvalidInput(
                f"{self.noun} must be a name or an expression in c, got {expression!r}"
            )
        object.__setattr__(self, "expression", expression.strip())
        names = self._parsed().names
        if "c" not in names:
            raise self._no_expression()
        self._take(sorted(names - set(self.symbols)), own)

    @property
    def name(self) -> str:  # type: ignore[override]
        """The expression itself."""
        return self.expression

    def _value(self, at: Sequence[Any]) -> Any:
        variables = dict(zip(self.symbols, at, strict=True)) | self._own
        return self._parsed().program(variables)

    def _parsed(self) -> Expression:
        try:
            return parsed(self.expression)
        except NoExpression as error:
            if str(error) == "must be an expression":
                raise self._no_expression() from None
            raise InvalidInput(f"{self.noun} {error}, got {self.expression[:200]!r}") from None

    def _no_expression(self) -> InvalidInput:
        return InvalidInput(
            f"{self.noun} must be one of {', '.join(self.named)} or an expression in c, "
            f"got {self.expression!r}"
        )


class FromFunction(WithOwnValues):
    """A relation that a Python function gives; its further arguments are parameters of its own.

    It is called with arrays, and where derivatives are needed with Taylor series: made of
    arithmetic and functions of NumPy it has exact derivatives. Raises InvalidInput if it cannot
    be called with the symbols of the relation, or if a parameter of its own has no value.
    """

    function: Callable[..., Any]

    def __init__(self, function: Callable[..., Any], /, **own: float) -> None:
        object.__setattr__(self, "function", function)
        defaults = self._further_arguments()
        given = {name: v for name, v in defaults.items() if v is not inspect.Parameter.empty}
        self._take(list(defaults), given | own)

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of the function."""
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    def _value(self, at: Sequence[Any]) -> Any:
        return self.function(*at, **self._own)

    def _further_arguments(self) -> dict[str, Any]:
        """Arguments after the symbols, with their defaults."""
        try:
            arguments = list(inspect.signature(self.function).parameters.values())
        except (TypeError, ValueError):
            return {}
        kinds = inspect.Parameter
        places = (kinds.POSITIONAL_ONLY, kinds.POSITIONAL_OR_KEYWORD)
        count = len(self.symbols)
        taken = [a for a in arguments[:count] if a.kind in places]
        if not any(a.kind is kinds.VAR_POSITIONAL for a in arguments) and len(taken) < count:
            raise InvalidInput(
                f"the {self.noun} {self.name!r} must take {', '.join(self.symbols)}, "
                f"got a function of {', '.join(a.name for a in arguments) or 'nothing'}"
            )
        variable = (kinds.VAR_POSITIONAL, kinds.VAR_KEYWORD)
        return {a.name: a.default for a in arguments[len(taken) :] if a.kind not in variable}


def made(
    spec: Any,
    own: Mapping[str, Any],
    base: type[AnyRelation],
    named: Mapping[str, type[AnyRelation]],
    expression: Callable[..., AnyRelation],
    function: Callable[..., AnyRelation],
) -> AnyRelation:
    """The relation that a word, an expression in c, a Python function or a relation stands for.

    `own` holds values of its own parameters. Raises InvalidInput, also for a relation without a
    name.
    """
    if isinstance(spec, base):
        if not isinstance(getattr(spec, "name", None), str):
            raise InvalidInput(
                f"a {base.noun} must have a name, a text, {type(spec).__name__} has none; "
                f"give the class an attribute `name`"
            )
        return spec.replaced(own)
    if isinstance(spec, str) and spec.strip() in named:
        return _of_class(named[spec.strip()], spec.strip(), own)
    if callable(spec) and not isinstance(spec, type):
        return function(spec, **own)
    return expression(spec, **own)


def declared_dimension(spec: Any, named: Mapping[str, type[Relation]], name: str) -> str | None:
    """Dimension that a relation, or the class that a word stands for, declares for `name`."""
    kind = named.get(spec.strip()) if isinstance(spec, str) else type(spec)
    declared = fields(kind) if kind is not None and is_dataclass(kind) else ()
    return {f.name: f.metadata.get("unit") for f in declared}.get(name)


def _of_class(kind: type[AnyRelation], word: str, own: Mapping[str, Any]) -> AnyRelation:
    declared: dict[str, Any] = {}
    if is_dataclass(kind):
        declared = {f.name: f for f in fields(kind) if f.init}
    refuse_unknown(own, declared, f"parameter of the {kind.noun} {word!r}")
    for name, f in declared.items():
        if name not in own and f.default is MISSING and f.default_factory is MISSING:
            raise InvalidInput(
                f"the {kind.noun} {word!r} must have a value of {name!r}, got none; give "
                f"{kind.noun}.{name}, as in --set {kind.noun}.{name}=2"
            )
    return kind(**own)


def refuse_unwritable(found: Relation, read: Callable[[str, Mapping[str, Any]], Relation]) -> None:
    """Raise InvalidInput unless `read` makes an equal relation of name and own parameters."""
    try:
        back: Relation | None = read(found.name, found.own)
    except InvalidInput:
        back = None
    if back != found:
        raise InvalidInput(
            f"a {found.noun} that is written to a file must be a named one or an expression in "
            f"c, {type(found).__name__} with the name {found.name!r} would not be read back; give "
            f"it as an expression, or list its class among the named ones"
        )


@cache
def _field_names(kind: type) -> list[str]:
    return [f.name for f in fields(kind) if f.init] if is_dataclass(kind) else []


def _is_number(value: Any) -> bool:
    return isinstance(value, Number | np.ndarray) and not isinstance(value, bool)


def _is_finite(value: Any) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _floating(x: Any) -> Any:
    array = np.asarray(x)
    return (array if array.dtype.kind in "fc" else array.astype(float))[()]
