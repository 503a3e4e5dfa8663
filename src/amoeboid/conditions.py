"""Conditions on a cell as text, such as "polarity > 0.5": when a run ends.

A condition compares expressions of observables, parameters, the time t and numbers; parameters of
your own law or stress have its name before theirs (`law.n`). `and`, `or` and `not` join several. It
is text, so that a file and the command line can hold it. For a cell with units, quantities stand in
quotes, "t > '5 min'", and what is compared or added must have one dimension.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from amoeboid.model.parameters import DIMENSIONS, RELATIONS
from amoeboid.model.units import NO_DIMENSION, exponents, in_si
from amoeboid.validation import InvalidInput, refuse_unknown

if TYPE_CHECKING:
    from amoeboid.model.parameters import Parameters
    from amoeboid.observables import Cell, Observables

_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
}
MAX_LENGTH = 500  # characters
Powers = tuple[float, float, float]
NUMBER: Powers = (0.0, 0.0, 0.0)
EXAMPLE = "'polarity > 0.5' or 'c_front < 0.1*c0 and t > 5'"


def condition(text: str) -> str:
    """The text of a condition, checked. Raises InvalidInput unless it compares what is known."""
    return ast.unparse(_tree(text))


def check_condition(text: str, p: Parameters) -> None:
    """Raise InvalidInput if a condition does not suit a cell.

    It has a parameter of law or stress that the cell lacks, quantities for a cell without units, or
    compares numbers of different dimensions for one with units.
    """
    tree = _tree(text)
    own = {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    refuse_unknown(sorted(own), p.names, "parameter")
    if p.units is not None:
        _dimension(tree, text, p)
        return
    quoted = [n.value for n in ast.walk(tree) if _is_quantity(n)]  # type: ignore[attr-defined]
    if quoted:
        raise InvalidInput(
            f"a condition on a cell without units must have plain numbers, got {quoted[0]!r}; "
            "start from a cell with units (--physical, Parameters.physical), or leave the unit out"
        )


def holds(text: str, cell: Cell, t: float) -> bool:
    """Whether a condition holds for a cell at time t. Raises InvalidInput."""
    try:
        return bool(_value(_tree(text), cell, t))
    except ArithmeticError as error:
        shown = cell.parameters.quantity(t, "T")
        raise InvalidInput(
            f"the condition {text!r} must have a value at t = {shown:g}: {error}"
        ) from None


def _tree(text: str) -> ast.expr:
    """The expression. Names of observables that are not registered (yet) are refused."""
    problem = f"a condition must be a comparison such as {EXAMPLE}, got {text!r}"
    if not isinstance(text, str) or len(text) > MAX_LENGTH:
        raise InvalidInput(problem)
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InvalidInput(problem) from None
    why = _why_not(tree, True)
    if why:
        raise InvalidInput(f"{problem}: {why}")
    return tree


def _why_not(node: ast.expr, truth: bool) -> str:
    """Why a node is no condition (`truth`), or no number; empty if it is."""
    parts: list[tuple[ast.expr, bool]]
    if truth and isinstance(node, ast.BoolOp):
        parts = [(part, True) for part in node.values]
    elif truth and isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        parts = [(node.operand, True)]
    elif truth and isinstance(node, ast.Compare):
        if any(type(op) not in _OPERATORS for op in node.ops):
            return "use >, >=, < or <="
        parts = [(part, False) for part in (node.left, *node.comparators)]
    elif truth:
        return "nothing is compared"
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        parts = [(node.left, False), (node.right, False)]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        parts = [(node.operand, False)]
    elif isinstance(node, ast.Constant):
        value = node.value
        real = isinstance(value, int | float) and not isinstance(value, bool)
        finite = isinstance(value, int | float) and math.isfinite(value)
        return "" if (real and finite) or _is_quantity(node) else f"{value!r} is not a number"
    elif isinstance(node, ast.Name):
        return _unknown(node.id)
    elif isinstance(node, ast.Attribute) and ast.unparse(node.value) in RELATIONS:
        return ""
    else:
        return f"{ast.unparse(node)!r} is not allowed"
    return next((why for part, as_truth in parts if (why := _why_not(part, as_truth))), "")


def _unknown(name: str) -> str:
    known = [n for n, observable in _observables().items() if not observable.vector]
    if name == "t" or name in known or name in DIMENSIONS:
        return ""
    return f"{name!r} is not t, a parameter or one of {', '.join(known)}"


def _observables() -> Observables:
    """Imported where there is a condition: configurations without any need no solver."""
    from amoeboid.observables import OBSERVABLES

    return OBSERVABLES


def _is_quantity(node: ast.AST) -> bool:
    """Whether a node is a text that begins with a digit, such as '5 min'."""
    text = node.value if isinstance(node, ast.Constant) else None
    return isinstance(text, str) and text.strip()[:1].isdigit()


def _named_dimension(name: str, p: Parameters) -> str | None:
    """The dimension of a name; None where none is known."""
    if name == "t":
        return "T"
    known = _observables()
    return known[name].dimension if name in known else p.dimension(name)


def _dimension(node: Any, text: str, p: Parameters) -> Powers | None:
    """The powers of length, time and mass of a number in a condition; None where none is known.

    Filaments are counted. Raises InvalidInput where numbers of different dimensions meet.
    """
    if isinstance(node, ast.Constant):
        if isinstance(node.value, str):
            return in_si(f"a quantity in the condition {text!r}", node.value)[1]
        return None if node.value == 0 else NUMBER
    if isinstance(node, ast.Name | ast.Attribute):
        dimension = _named_dimension(ast.unparse(node), p)
        powers = dict(exponents(dimension or ""))
        known = tuple(float(powers.get(base, 0)) for base in "LTM")
        return None if dimension is None else (known[0], known[1], known[2])
    if isinstance(node, ast.BoolOp):
        for part in node.values:
            _dimension(part, text, p)
        return None
    if isinstance(node, ast.UnaryOp):
        return _dimension(node.operand, text, p)
    if isinstance(node, ast.Compare):
        for one, other in pairwise([node.left, *node.comparators]):
            _same(one, other, text, p)
        return None
    if isinstance(node.op, ast.Add | ast.Sub):
        return _same(node.left, node.right, text, p)
    left, right = _dimension(node.left, text, p), _dimension(node.right, text, p)
    if isinstance(node.op, ast.Pow):
        power = node.right.value if isinstance(node.right, ast.Constant) else None
        if isinstance(power, int | float):
            return _times(left, power)
        if right not in (None, NUMBER):
            raise InvalidInput(
                f"an exponent in a condition must be a number, got {ast.unparse(node.right)} in "
                f"{text!r}"
            )
        return NUMBER if left == NUMBER else None
    shift = _times(right, 1.0 if isinstance(node.op, ast.Mult) else -1.0)
    if left is None or shift is None:
        return None
    return (left[0] + shift[0], left[1] + shift[1], left[2] + shift[2])


def _times(powers: Powers | None, factor: float) -> Powers | None:
    if powers is None:
        return None
    return (powers[0] * factor, powers[1] * factor, powers[2] * factor)


def _same(left: Any, right: Any, text: str, p: Parameters) -> Powers | None:
    a, b = _dimension(left, text, p), _dimension(right, text, p)
    if a is not None and b is not None and a != b:
        raise InvalidInput(
            f"numbers that a condition compares or adds must have one dimension, got {text!r} with "
            f"{ast.unparse(left)} and {ast.unparse(right)}; for a cell with units write a quantity "
            "in quotes, such as t > '5 min'"
        )
    return b if a is None else a


def _value(node: Any, cell: Cell, t: float) -> Any:
    if isinstance(node, ast.Constant):
        if isinstance(node.value, str):
            return in_si("a condition", node.value)[0]
        return float(node.value)  # type: ignore[arg-type]  # a number, by _why_not
    if isinstance(node, ast.Name | ast.Attribute):
        return _named(ast.unparse(node), cell, t)
    if isinstance(node, ast.BoolOp):
        every = isinstance(node.op, ast.And)
        return (all if every else any)(_value(part, cell, t) for part in node.values)
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_value(node.operand, cell, t))
    if isinstance(node, ast.BinOp):
        left, right = _value(node.left, cell, t), _value(node.right, cell, t)
        found = _OPERATORS[type(node.op)](left, right)
        if isinstance(found, complex):
            raise ArithmeticError(f"{ast.unparse(node)} is not a real number")
        return found
    numbers = [_value(part, cell, t) for part in (node.left, *node.comparators)]
    pairs = zip(node.ops, numbers[:-1], numbers[1:], strict=True)
    return all(_OPERATORS[type(op)](a, b) for op, a, b in pairs)


def _named(name: str, cell: Cell, t: float) -> float:
    """The number of a name; of a cell with units in SI base units, filaments counted."""
    p = cell.parameters
    if name == "t":
        value = t
    elif name in _observables():
        value = _observables()[name].value(name, cell)
    else:
        value = p.value(name)
    dimension = None if p.units is None else _named_dimension(name, p)
    if p.units is None or dimension in NO_DIMENSION:
        return float(value)
    return float(value) * p.units.of(str(dimension))
