"""Relations that are given and not programmed as a class: a word, an expression, a function.

Whoever gives one may name parameters of its own; `made` is what turns all of them into relations.
"""

from __future__ import annotations

import copy
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, ClassVar, Self, TypeVar

from amoeboid.model.constitutive import Relation
from amoeboid.numerics.expressions import Expression, NoExpression, parsed
from amoeboid.validation import InvalidInput, refuse_unknown

AnyRelation = TypeVar("AnyRelation", bound=Relation)


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
        self.refuse_unknown_own(own)
        return self.with_values({k: float(v) for k, v in self.checked_own(own).items()})

    def _take(self, needed: Sequence[str], own: Mapping[str, Any]) -> None:
        """Set the own parameters; InvalidInput for one that is missing, or not `needed`."""
        object.__setattr__(self, "_own", dict.fromkeys(needed, math.nan))
        self.refuse_unknown_own(own)
        for name in needed:
            if name not in own:
                raise InvalidInput(
                    f"the {self.noun} {self.name!r} needs a value of {name!r}, got none; it may "
                    f"use {', '.join(self.symbols)}, pi and its own parameters; set "
                    f"{self.noun}.{name}, as in --set {self.noun}.{name}=2, or correct the name"
                )
        values = {name: float(v) for name, v in self.checked_own(own).items()}
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
        needed = sorted(names - set(self.symbols))
        if "c" not in names:
            others = "" if not needed or needed == [self.expression] else f"the name {needed[0]!r}"
            raise self._no_expression(f" with {others} and without c" if others else "")
        self._take(needed, own)

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

    def _no_expression(self, more: str = "") -> InvalidInput:
        return InvalidInput(
            f"{self.noun} must be one of {', '.join(self.named)} or an expression in c, "
            f"got {self.expression!r}{more}"
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
    if not declared:
        kind().refuse_unknown_own(own)
    refuse_unknown(own, declared, "parameter", f"of the {kind.noun} {word!r}")
    for name, f in declared.items():
        if name not in own and f.default is MISSING and f.default_factory is MISSING:
            raise InvalidInput(
                f"the {kind.noun} {word!r} needs a value of {name!r}, got none; set "
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
            f"a {found.noun} that is written to a file must be a named one or an expression in c, "
            f"got {type(found).__name__} with the name {found.name!r}, which could not be read "
            "back; write it as an expression, or list its class among the named ones"
        )
