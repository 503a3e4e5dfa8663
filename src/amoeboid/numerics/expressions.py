"""Arithmetic expressions in named variables: parsed once, never executed as a program."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

MAX_EXPRESSION_LENGTH = 500

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    name: getattr(np, name)
    for name in ("exp", "log", "sqrt", "sin", "cos", "tan", "sinh", "cosh", "tanh")
}
"""Functions that an expression may use; of numbers, arrays and Taylor series."""


class NoExpression(ValueError):
    """The text is no expression; the message says what is wrong with it."""


Program = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True)
class Expression:
    """A compiled expression: `program({name: value})`, and the names that it uses."""

    program: Program
    names: frozenset[str]


@cache
def parsed(text: str) -> Expression:
    """The expression of a text: arithmetic (+ - * / **), numbers, pi, names and `FUNCTIONS`.

    Raises NoExpression if the text holds anything else.

    >>> parsed("2*x + 1").program({"x": 3.0})
    7.0
    """
    if not text.isascii() or not text.isprintable() or "#" in text:
        raise NoExpression("must be plain arithmetic in ASCII")
    if len(text) > MAX_EXPRESSION_LENGTH:
        raise NoExpression(f"must have at most {MAX_EXPRESSION_LENGTH} characters")
    names: set[str] = set()
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise NoExpression("must be an expression") from None
    return Expression(_compiled(tree, names), frozenset(names))


def _power(a: Any, b: Any) -> Any:
    # a negative Python number has a complex root
    return np.float64(a) ** b if isinstance(a, float) else a**b


_OPERATORS: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: _power,
}


def _not_allowed(what: str) -> NoExpression:
    return NoExpression(
        f"may use names, pi, numbers, + - * / ** and {', '.join(FUNCTIONS)}; {what} is not allowed"
    )


def _compiled(node: ast.expr, names: set[str]) -> Program:
    """A parsed expression as a function of its variables; collects the names it uses."""
    match node:
        case ast.Constant(value=bool() | complex()):
            raise _not_allowed(repr(node.value))
        case ast.Constant(value=int() | float() as number):
            constant = _finite(number)
            return lambda _: constant
        case ast.Name(id="pi"):
            return lambda _: math.pi
        case ast.Name(id=name) if name not in FUNCTIONS:
            names.add(name)
            return lambda variables: variables[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _compiled(operand, names)
            return lambda variables: -inner(variables)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _compiled(operand, names)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            first, second = _compiled(left, names), _compiled(right, names)
            combine = _OPERATORS[type(op)]
            return lambda variables: combine(first(variables), second(variables))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            inner, function = _compiled(argument, names), FUNCTIONS[name]
            return lambda variables: function(inner(variables))
        case _:
            raise _not_allowed(repr(ast.unparse(node)))


def _finite(number: float) -> float:
    try:
        value = float(number)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise _not_allowed("a number beyond double precision")
    return value
