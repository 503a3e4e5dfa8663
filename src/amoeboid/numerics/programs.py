"""Straight-line programs: what a function of fields computes, recorded once and run many times.

A function made of arithmetic, sines, square roots and products with constant matrices is called
once with symbols in place of arrays. What is left is a list of steps, each on the n values of a
field, and by forward differentiation of the list (Griewank & Walther, *Evaluating Derivatives*, 2nd
ed. 2008, chapters 3 and 6) more steps that make the derivatives. The function stays the only place
where the equations are written.

The derivative of a field is a sum of diagonal matrices times maps, sum_k diag(a_k) M_k: a map is
the matrix from the unknowns to the values of an input, or to what a constant matrix makes of
another field (`jacobians`). The steps touch the diagonals alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics import machine

Partials = dict[int, int]
"""Derivative of a symbol: the symbol of a diagonal by the symbol (input or product) of its map."""


class Symbol:
    """The result of a step; arithmetic with it records more steps."""

    __slots__ = ("number", "record")
    __array_ufunc__ = None  # an array on the left of an operator leaves the work to this class

    def __init__(self, record: Record, number: int) -> None:
        self.record = record
        self.number = number

    def _with(self, name: str, first: Any, second: Any) -> Symbol:
        numbers = [x.number if isinstance(x, Symbol) else self.record.constant(x)
                   for x in (first, second)]  # fmt: skip
        return Symbol(self.record, self.record.step(name, *numbers))

    def __neg__(self) -> Symbol:
        return Symbol(self.record, self.record.step("neg", self.number))

    def __add__(self, other: Any) -> Symbol:
        return self._with("add", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Symbol:
        return self._with("sub", self, other)

    def __rsub__(self, other: Any) -> Symbol:
        return self._with("sub", other, self)

    def __mul__(self, other: Any) -> Symbol:
        return self._with("mul", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Symbol:
        return self._with("truediv", self, other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self._with("truediv", other, self)

    def __pow__(self, exponent: int) -> Symbol:
        return self if exponent == 1 else self * self ** (exponent - 1)

    def __rmatmul__(self, matrix: Array) -> Symbol:
        return self._with("matmul", matrix, self)

    def elementary(self, name: str) -> Symbol:
        """sin, cos or sqrt of it."""
        return Symbol(self.record, self.record.step(name, self.number))

    def relation(self, derivatives: Any) -> Symbol:
        """f(self): the input `derivatives` is a function, derivatives(c, 1) = (f(c), f'(c))."""
        pair = self.record.step("relation", derivatives.number, self.number)
        return Symbol(self.record, self.record.step("first", pair))


class Record:
    """Steps in order, each once; constants and inputs are steps as well."""

    def __init__(self) -> None:
        self.steps: list[tuple[str, tuple[Any, ...]]] = []
        self._numbers: dict[Any, int] = {}
        self._kept: list[Any] = []

    def step(self, name: str, *arguments: Any) -> int:
        """The number of a step; the same one if it was there already."""
        short = self._simplified(name, arguments)
        if short is not None:
            return short
        key = (name, *arguments)
        if key not in self._numbers:
            self._numbers[key] = len(self.steps)
            self.steps.append((name, arguments))
        return self._numbers[key]

    def constant(self, value: Any) -> int:
        """A number or an array."""
        if not isinstance(value, np.ndarray):
            return self.step("constant", float(value))
        key = ("array", id(value))
        if key not in self._numbers:
            self._kept.append(value)  # so that no other array gets its identity
            self._numbers[key] = len(self.steps)
            self.steps.append(("array", (len(self._kept) - 1,)))
        return self._numbers[key]

    def array(self, number: int) -> Array:
        """The array of a constant."""
        return self._kept[self.steps[number][1][0]]

    def arguments(self, number: int) -> tuple[int, ...]:
        """The steps that a step uses, but for matrices and functions."""
        name, arguments = self.steps[number]
        if name in ("constant", "array", "input"):
            return ()
        return arguments[1:] if name in ("matmul", "relation") else arguments

    def is_total(self, number: int) -> bool:
        """Whether a step is a product with a matrix of one row."""
        name, arguments = self.steps[number]
        return name == "matmul" and self.array(arguments[0]).shape[0] == 1

    def constant_value(self, number: int) -> Any:
        """The number or array of a constant."""
        name, [value] = self.steps[number]
        return self.array(number) if name == "array" else value

    def rows(self, number: int, inputs: Mapping[int, int]) -> int:
        """How many numbers a step makes, from those of some inputs; of others it is 1."""
        name, arguments = self.steps[number]
        if name == "matmul":
            return self.array(arguments[0]).shape[0]
        if name == "array":
            return self.array(number).size
        return max((self.rows(k, inputs) for k in self.arguments(number)),
                   default=inputs.get(number, 1))  # fmt: skip

    def input(self, name: str) -> Symbol:
        """What the program is given by this name."""
        return Symbol(self, self.step("input", name))

    def is_number(self, step: int, value: float) -> bool:
        """Whether a step is this constant."""
        return self.steps[step] == ("constant", (value,))

    def _simplified(self, name: str, arguments: tuple[Any, ...]) -> int | None:
        if name not in ("mul", "truediv", "neg"):
            return None
        if name == "neg":
            inner, what = self.steps[arguments[0]]
            if inner == "neg":
                return what[0]
            return self.constant(-what[0]) if inner == "constant" else None
        first, second = arguments
        if self.is_number(second, 1.0):
            return first
        if name == "mul" and self.is_number(first, 1.0):
            return second
        if name == "mul" and first > second:
            return self.step("mul", second, first)
        return None

    def partials(self, inputs: Iterable[int]) -> list[Partials]:
        """The derivative of every step that there is now, as diagonals of maps; adds steps."""
        one = self.constant(1.0)
        seeds = set(inputs)
        found: list[Partials] = []
        for number, (name, arguments) in enumerate(list(self.steps)):
            if number in seeds:
                found.append({number: one})
            elif name in _RULES:
                found.append(_RULES[name](self, number, arguments, found))
            else:
                found.append({})
        return found

    def scaled(self, partials: Partials, factor: int) -> Partials:
        """Each diagonal times a step."""
        return {k: self.step("mul", a, factor) for k, a in partials.items()}

    def negative(self, partials: Partials) -> Partials:
        """Each diagonal with the other sign."""
        return {k: self.step("neg", a) for k, a in partials.items()}

    def sum(self, a: Partials, b: Partials) -> Partials:
        """The sum of two derivatives."""
        both = {k: self.step("add", a[k], b[k]) for k in a.keys() & b.keys()}
        return {k: both[k] if k in both else (a | b)[k] for k in a | b}


def _product(r: Record, _: int, at: tuple[int, int], d: list[Partials]) -> Partials:
    return r.sum(r.scaled(d[at[0]], at[1]), r.scaled(d[at[1]], at[0]))


def _quotient(r: Record, number: int, at: tuple[int, int], d: list[Partials]) -> Partials:
    numerator, denominator = d[at[0]], d[at[1]]
    inverse = r.step("truediv", r.constant(1.0), at[1])
    found = r.scaled(numerator, inverse)
    if denominator:
        slope = r.step("neg", r.step("mul", number, inverse))
        found = r.sum(found, r.scaled(denominator, slope))
    return found


def _square_root(r: Record, number: int, at: tuple[int], d: list[Partials]) -> Partials:
    return r.scaled(d[at[0]], r.step("truediv", r.constant(0.5), number))


def _relation_value(r: Record, _: int, at: tuple[int], d: list[Partials]) -> Partials:
    c = r.steps[at[0]][1][1]
    return r.scaled(d[c], r.step("second", at[0])) if d[c] else {}


_RULES: dict[str, Callable[[Record, int, Any, list[Partials]], Partials]] = {
    "neg": lambda r, _, at, d: r.negative(d[at[0]]),
    "add": lambda r, _, at, d: r.sum(d[at[0]], d[at[1]]),
    "sub": lambda r, _, at, d: r.sum(d[at[0]], r.negative(d[at[1]])),
    "mul": _product,
    "truediv": _quotient,
    "sin": lambda r, _, at, d: r.scaled(d[at[0]], r.step("cos", at[0])) if d[at[0]] else {},
    "cos": lambda r, _, at, d: (
        r.scaled(d[at[0]], r.step("neg", r.step("sin", at[0]))) if d[at[0]] else {}
    ),
    "sqrt": _square_root,
    "matmul": lambda r, number, at, d: {number: r.constant(1.0)} if d[at[1]] else {},
    "first": _relation_value,
}

# Codes of the steps for `machine`; relations are called from here, see `Program.run`.
CODES = {"neg": 0, "add": 1, "sub": 2, "mul": 3, "truediv": 4, "matmul": 5, "sin": 6, "cos": 7,
         "sqrt": 8, "relation": 9, "first": 9, "second": 9, "total": 10}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Relation:
    """A function of a field, called at `before` which step it is known, and where results go."""

    before: int
    name: str
    argument: int
    results: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Program:
    """Steps on rows of n numbers: constants, then inputs, then what each step makes of two rows.

    A matrix of one row is a constant: its step makes one number, n times. `row` is where the result
    of a step of the record is.
    """

    constants: Array
    inputs: tuple[str, ...]
    steps: Array
    matrices: Array
    relations: tuple[Relation, ...]
    row: Mapping[int, int]

    def run(self, inputs: Any, kind: Any = float) -> Array:
        """All rows, float or complex, for `inputs[name]`, numbers or arrays (n,) or (1,)."""
        run_steps = machine.loops().run_steps
        given = [inputs[name] for name in self.inputs]
        begin = len(self.constants)
        rows = np.empty((begin + len(given) + len(self.steps), self.constants.shape[1]), kind)
        rows[:begin] = self.constants
        for k, value in enumerate(given, begin):
            rows[k] = value
        done = 0
        for relation in self.relations:
            if relation.before > done:
                run_steps(self.steps, self.matrices, rows, done, relation.before)
                done = relation.before
            found = inputs[relation.name](rows[relation.argument], len(relation.results) - 1)
            for k, value in zip(relation.results, found, strict=True):
                rows[k] = value
        run_steps(self.steps, self.matrices, rows, done, len(self.steps))
        return rows


def program(record: Record, wanted: Iterable[int], order: int, n: int) -> Program:
    """The program of those steps of a record that are needed for the steps wanted.

    `order` is the derivative of the relations in it up to which they are needed, 0 or 1.
    """
    needed: set[int] = set()
    waiting = list(wanted)
    while waiting:
        number = waiting.pop()
        if number not in needed:
            needed.add(number)
            waiting.extend(record.arguments(number))
            if record.is_total(number):
                waiting.append(record.steps[number][1][0])
    kinds = {number: record.steps[number][0] for number in sorted(needed)}
    constants = [k for k, name in kinds.items() if name in ("constant", "array")]
    inputs = [k for k, name in kinds.items() if name == "input"]
    steps = [k for k, name in kinds.items() if name in CODES]
    row = {number: k for k, number in enumerate((*constants, *inputs, *steps))}
    matrices: dict[int, int] = {}
    table, relations = [], []
    for number in steps:
        name, arguments = record.steps[number]
        if record.is_total(number):
            table.append((CODES["total"], row[arguments[0]], row[arguments[1]]))
        elif name == "matmul":
            first = matrices.setdefault(arguments[0], len(matrices))
            table.append((CODES[name], first, row[arguments[1]]))
        elif name == "relation":
            results = [record.step(which, number) for which in ("first", "second")[: order + 1]]
            known = max(row[arguments[1]] + 1 - (len(row) - len(steps)), 0)
            relations.append(
                Relation(known, record.steps[arguments[0]][1][0], row[arguments[1]],
                         tuple(row[k] for k in results))
            )  # fmt: skip
            table.append((CODES[name], 0, 0))
        else:
            first, second = (*(row[k] for k in arguments), 0)[:2]
            table.append((CODES[name], first, second))
    values = np.empty((len(constants), n))
    for k, number in enumerate(constants):
        values[k] = record.constant_value(number)
    return Program(
        values, tuple(record.steps[k][1][0] for k in inputs), np.array(table),
        transposed([record.array(k) for k in matrices], n),
        tuple(sorted(relations, key=lambda relation: relation.before)), row,
    )  # fmt: skip


def transposed(matrices: Sequence[Array], n: int) -> Array:
    """Matrices (n or 1, n) one after the other, transposed; one of one row has it n times."""
    return np.array([np.broadcast_to(m, (n, n)).T for m in matrices]).reshape(-1, n, n)


@dataclass(frozen=True, eq=False)
class Values:
    """Functions of fields at n points, recorded without their derivatives."""

    program: Program
    rows: Array

    def __call__(self, inputs: Any, kind: Any = float) -> Array:
        """The values (functions, n); one number stands there n times."""
        return self.program.run(inputs, kind)[self.rows]


def values_of(function: Callable[..., Sequence[Any]], n: int, names: Iterable[str]) -> Values:
    """What function(fields, record) returns, `fields` symbols by their `names`.

    `record.input` gives it what else it needs.
    """
    record = Record()
    outputs = function({name: record.input(name) for name in names}, record)
    found = program(record, [symbol.number for symbol in outputs], 0, n)
    return Values(found, np.array([found.row[symbol.number] for symbol in outputs]))
