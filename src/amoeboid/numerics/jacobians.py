"""Exact Jacobians of recorded programs, put together from diagonals and constant matrices.

A row of the Jacobian is sum_k diag(a_k) M_k with M_k the map of an input or of a product with a
constant matrix; the map of a product is that matrix times such a sum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics import machine
from amoeboid.numerics.programs import Partials, Program, Record, program, transposed

Maps = Mapping[str, tuple[int, Array]]
"""Derivative (n or 1, width) of each input to the unknowns from a first one on."""


@dataclass(frozen=True, eq=False)
class Equations:
    """Equations for fields at n points, recorded: their values, and their exact Jacobian.

    The arrays are those of `compiled_machine.jacobian`.
    """

    values: Program
    everything: Program
    results: tuple[tuple[int, int], ...]
    maps: Array
    matrices: Array
    fields: Array
    terms: Array
    spans: Array

    def residual(self, inputs: Any, kind: Any = float) -> Array:
        """The values of all equations, one after the other."""
        return self._values(self.values, self.values.run(inputs, kind))

    def residual_and_jacobian(
        self, inputs: Any, scales: Array, kind: Any = float
    ) -> tuple[Array, Array]:
        """The same and their derivatives to the unknowns, both divided by `scales`."""
        rows = self.everything.run(inputs, kind)
        found = machine.loops().jacobian(
            rows, self.maps, self.matrices, self.fields, self.terms, self.spans, scales
        )
        return self._values(self.everything, rows) / scales, found

    def _values(self, of: Program, rows: Array) -> Array:
        return np.concatenate([rows[of.row[k], :count] for k, count in self.results])


def recorded(function: Callable[..., Sequence[Any]], n: int, size: int, inputs: Maps) -> Equations:
    """The equations that function(fields, record) returns, `fields` symbols by the names of inputs.

    `record.input` gives it what else it needs; `size` is the number of unknowns.
    """
    record = Record()
    fields = {name: record.input(name) for name in inputs}
    numbers = {symbol.number: inputs[name] for name, symbol in fields.items()}
    outputs = [symbol.number for symbol in function(fields, record)]
    partials = record.partials(numbers)
    counts = {number: matrix.shape[0] for number, (_, matrix) in numbers.items()}
    products = _products(record, outputs, partials, numbers)
    for k in [k for k in products if record.arguments(k)[0] in numbers]:
        products.remove(k)
        first, matrix = numbers[record.arguments(k)[0]]
        numbers[k] = first, record.array(record.steps[k][1][0]) @ matrix
    rows = [(k, partials[record.arguments(k)[0]], n) for k in products]
    rows += [(-1, partials[k], record.rows(k, counts)) for k in outputs]
    diagonals = {a for _, d, _ in rows for a in d.values()}
    everything = program(record, [*outputs, *diagonals], 1, n)
    place = {number: k for k, number in enumerate((*numbers, *products))}
    matrices: list[Array] = []
    table: list[tuple[int, ...]] = []
    terms: list[tuple[int, int]] = []
    for number, d, count in rows:
        begin = len(terms)
        terms += [(everything.row[a], place[k]) for k, a in d.items()]
        made = count
        if number >= 0:
            matrices.append(record.array(record.steps[number][1][0]))
            made = matrices[-1].shape[0]
        table.append((len(matrices) - 1 if number >= 0 else -1, count, begin, len(terms), made))
    maps = np.zeros((len(numbers), n, size))
    spans = np.zeros((len(place), 2), dtype=int)
    for k, (first, matrix) in enumerate(numbers.values()):
        spans[k] = first, first + matrix.shape[1]
        maps[k, :, first : spans[k, 1]] = matrix
    for k, d, _ in rows[: len(products)]:
        of = np.array([spans[place[m]] for m in d])
        spans[place[k]] = of[:, 0].min(), of[:, 1].max()
    return Equations(
        program(record, outputs, 0, n), everything,
        tuple((k, count) for k, (_, _, count) in zip(outputs, rows[len(products) :], strict=True)),
        maps, transposed(matrices, n), np.array(table), np.array(terms), spans,
    )  # fmt: skip


def _products(
    record: Record, outputs: Iterable[int], d: Sequence[Partials], inputs: Mapping[int, Any]
) -> list[int]:
    """The products whose maps the derivatives of the outputs need, in order."""
    found: set[int] = set()
    waiting = [k for number in outputs for k in d[number]]
    while waiting:
        k = waiting.pop()
        if k not in found and k not in inputs:
            found.add(k)
            waiting.extend(d[record.arguments(k)[0]])
    return sorted(found)
