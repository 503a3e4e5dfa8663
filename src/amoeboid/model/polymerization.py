"""Polymerization laws: the speed v_p(c) at which filaments grow against the membrane.

To add a law, write one class here and list it in `NAMED_LAWS`.
"""

from __future__ import annotations

import ast
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.numerics.taylor import FUNCTIONS, Taylor
from amoeboid.validation import InvalidInput

MAX_EXPRESSION_LENGTH = 500


class Law(ABC):
    """A polymerization law v_p(c; v_p0, c_r); v_p is a velocity, c a surface density."""

    name: str

    @abstractmethod
    def derivatives(
        self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike, order: int = 3
    ) -> tuple[Array, ...]:
        """(v_p, v_p', v_p'', ...) with respect to c, to `order`; arrays broadcast.

        Real or complex c. Raises InvalidInput where the law is not defined.
        """

    def value(self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike) -> Array:
        """v_p(c) [velocity]."""
        return self.derivatives(c, v_p0, c_r, 0)[0]

    def __str__(self) -> str:
        return self.name

    def __eq__(self, other: object) -> bool:
        """Laws of one class with the same attributes are equal."""
        return type(self) is type(other) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash((type(self), self.name))


@dataclass(frozen=True)
class Exponential(Law):
    """v_p = v_p0 exp(-c/c_r); main text `vp`."""

    name: str = field(default="exponential", init=False)

    def derivatives(
        self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike, order: int = 3
    ) -> tuple[Array, ...]:
        """See Law.derivatives."""
        c_r = np.asarray(c_r)
        v = v_p0 * np.exp(-np.asarray(c) / c_r)
        return tuple(v / (-c_r) ** k for k in range(order + 1))


@dataclass(frozen=True)
class Inverse(Law):
    """v_p = v_p0 c_r / c, growth limited by monomers; SI `eq_v_c_inverse`."""

    name: str = field(default="inverse", init=False)

    def derivatives(
        self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike, order: int = 3
    ) -> tuple[Array, ...]:
        """See Law.derivatives; refused where c <= 0."""
        c = np.asarray(c)
        if np.any(c.real <= 0):
            raise InvalidInput(
                f"the inverse law needs c > 0 everywhere, got c = {np.min(c.real):.6g}; "
                "use a smaller perturbation or the exponential law"
            )
        v = np.asarray(v_p0) * c_r / c
        return tuple(v * (-1) ** k * math.factorial(k) / c**k for k in range(order + 1))


@dataclass(frozen=True)
class Custom(Law):
    """A user's law, an expression in c, v_p0 and c_r such as `v_p0/(1 + c/c_r)`.

    Arithmetic (+ - * / **, numbers, pi) and exp, log, sqrt, sin, cos, tan, sinh, cosh, tanh.
    The text is parsed, never executed. Raises InvalidInput if it holds anything else.
    """

    expression: str

    def __post_init__(self) -> None:
        if not isinstance(self.expression, str):
            raise InvalidInput(f"law must be a name or an expression in c, got {self.expression!r}")
        object.__setattr__(self, "expression", self.expression.strip())
        names: set[str] = set()
        _compile(self._tree(), self.expression, names)
        if "c" not in names:
            raise InvalidInput(
                f"law must be one of {', '.join(NAMED_LAWS)} or an expression in c, "
                f"got {self.expression!r}"
            )

    @property
    def name(self) -> str:  # type: ignore[override]
        """The expression itself."""
        return self.expression

    def derivatives(
        self, c: ArrayLike, v_p0: ArrayLike, c_r: ArrayLike, order: int = 3
    ) -> tuple[Array, ...]:
        """See Law.derivatives; refused where the expression or a derivative is not finite."""
        arrays = [np.asarray(x) for x in (c, v_p0, c_r)]
        at, speed, reference = (x.astype(np.result_type(x, float)) for x in arrays)
        variables = {
            "c": Taylor.variable(at, order),
            "v_p0": Taylor.constant(speed, order),
            "c_r": Taylor.constant(reference, order),
        }
        program = _compile(self._tree(), self.expression, set())
        with np.errstate(all="ignore"):
            found = program(variables, order).derivatives()
        shape = np.broadcast_shapes(*(x.shape for x in arrays))
        values = tuple(np.broadcast_to(np.asarray(f), shape) for f in found)
        for k, v in enumerate(values):
            bad = ~np.isfinite(v)
            if np.any(bad):
                where = np.broadcast_to(at, shape)[bad].flat[0]
                what = "the law" if k == 0 else f"derivative {k} of the law"
                raise InvalidInput(
                    f"{what} {self.expression!r} must be finite, it is not at c = {where:.6g}"
                )
        return values

    def _tree(self) -> ast.expr:
        text = self.expression
        if not text.isascii() or not text.isprintable() or "#" in text:
            raise InvalidInput(f"law must be plain arithmetic in ASCII, got {text!r}")
        if len(text) > MAX_EXPRESSION_LENGTH:
            raise InvalidInput(
                f"law must have at most {MAX_EXPRESSION_LENGTH} characters, got {len(text)}"
            )
        try:
            return ast.parse(text, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InvalidInput(
                f"law must be one of {', '.join(NAMED_LAWS)} or an expression in c, got {text!r}"
            ) from None


Program = Callable[[dict[str, Taylor], int], Taylor]

_OPERATORS: dict[type[ast.AST], Callable[[Taylor, Taylor], Taylor]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}


def _compile(node: ast.expr, text: str, names: set[str]) -> Program:
    """Turn a parsed expression into a function of Taylor series; collect the names it uses."""

    def refuse(what: str) -> InvalidInput:
        return InvalidInput(
            f"law may use c, v_p0, c_r, pi, numbers, + - * / ** and {', '.join(FUNCTIONS)}; "
            f"{what} in {text!r} is not allowed"
        )

    match node:
        case ast.Constant(value=bool() | complex()):
            raise refuse(repr(node.value))
        case ast.Constant(value=int() | float() as value):
            try:
                constant = np.asarray(float(value))
            except OverflowError:
                raise refuse("a number beyond double precision") from None
            if not np.isfinite(constant):
                raise refuse("a number beyond double precision")
            return lambda _, order: Taylor.constant(constant, order)
        case ast.Name(id="pi"):
            return lambda _, order: Taylor.constant(np.asarray(math.pi), order)
        case ast.Name(id="c" | "v_p0" | "c_r" as name):
            names.add(name)
            return lambda variables, _: variables[name]
        case ast.Name(id=name):
            raise refuse(f"the name {name!r}")
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _compile(operand, text, names)
            return lambda variables, order: -inner(variables, order)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _compile(operand, text, names)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            first, second = _compile(left, text, names), _compile(right, text, names)
            combine = _OPERATORS[type(op)]
            return lambda variables, order: combine(
                first(variables, order), second(variables, order)
            )
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            inner, function = _compile(argument, text, names), FUNCTIONS[name]
            return lambda variables, order: function(inner(variables, order))
        case _:
            raise refuse(f"{ast.unparse(node)!r}")


NAMED_LAWS: dict[str, type[Law]] = {"exponential": Exponential, "inverse": Inverse}


def law(spec: str | Law) -> Law:
    """The law that a word or an expression in c stands for; a Law is returned as it is.

    Raises InvalidInput, also for a Law without a name.
    """
    if isinstance(spec, Law):
        if not isinstance(getattr(spec, "name", None), str):
            raise InvalidInput(
                f"a law must have a name, a text, {type(spec).__name__} has none; "
                f"give the class an attribute `name`"
            )
        return spec
    if isinstance(spec, str) and spec.strip() in NAMED_LAWS:
        return NAMED_LAWS[spec.strip()]()
    return Custom(spec)


class LawField:
    """Descriptor of a dataclass field that is set to a law or its text, and read as a law."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object | None, owner: type) -> Law:
        """The law; of the class, the default one."""
        return Exponential() if instance is None else instance.__dict__[self._name]

    def __set__(self, instance: object, value: str | Law) -> None:
        """Take what `law` takes. Raises InvalidInput."""
        instance.__dict__[self._name] = law(value)


def refuse_unwritable(found: Law) -> None:
    """Raise InvalidInput unless `law` makes an equal law of the name of this one."""
    try:
        back: Law | None = law(found.name)
    except InvalidInput:
        back = None
    if back != found:
        raise InvalidInput(
            f"a law that is written to a file must be one of {', '.join(NAMED_LAWS)} or an "
            f"expression in c, {type(found).__name__} with the name {found.name!r} would not be "
            f"read back; give it as an expression, or list its class in "
            f"amoeboid.model.polymerization.NAMED_LAWS"
        )
