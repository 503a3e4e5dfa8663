"""Conditions on a cell as text, such as "polarity > 0.5": when a run ends.

A condition compares expressions of observables, parameters, the time t and numbers; parameters of
your own law or stress have its name before theirs (`law.n`). `and`, `or` and `not` join several. It
is text, so that a file and the command line can hold it.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from amoeboid.model.parameters import DIMENSIONS, RELATIONS
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
EXAMPLE = "'polarity > 0.5' or 'c_front < 0.1*c0 and t > 5'"


def condition(text: str) -> str:
    """The text of a condition, checked. Raises InvalidInput unless it compares what is known."""
    return ast.unparse(_tree(text))


def refuse_unknown_parameters(text: str, p: Parameters) -> None:
    """Raise InvalidInput if a condition has a parameter of law or stress that the cell lacks."""
    own = {ast.unparse(node) for node in ast.walk(_tree(text)) if isinstance(node, ast.Attribute)}
    refuse_unknown(sorted(own), p.names, "parameter")


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
        number = isinstance(node.value, int | float) and not isinstance(node.value, bool)
        return "" if number else f"{node.value!r} is not a number"
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


def _value(node: Any, cell: Cell, t: float) -> Any:
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]  # a number, by _why_not
    if isinstance(node, ast.Name):
        if node.id == "t":
            return t
        if node.id in _observables():
            return _observables()[node.id].value(node.id, cell)
    if isinstance(node, ast.Name | ast.Attribute):
        return cell.parameters.value(ast.unparse(node))
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
