"""The loops of `compiled_machine` by operations of NumPy on whole rows, for where Numba is not."""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.compiled_machine import (
    COSINE,
    DIFFERENCE,
    GIVEN,
    IMAGE,
    NEGATIVE,
    PRODUCT,
    QUOTIENT,
    ROOT,
    SINE,
    SUM,
    TOTAL,
)

OF_TWO: dict[int, np.ufunc] = {
    SUM: np.add, DIFFERENCE: np.subtract, PRODUCT: np.multiply, QUOTIENT: np.divide
}  # fmt: skip
OF_ONE: dict[int, np.ufunc] = {NEGATIVE: np.negative, SINE: np.sin, COSINE: np.cos, ROOT: np.sqrt}


def run_steps(steps: Array, matrices: Array, rows: Array, begin: int, end: int) -> None:
    """See `compiled_machine.run_steps`; a division by zero gives inf or nan here too."""
    row = list(rows)
    first = len(row) - len(steps) + begin
    with np.errstate(all="ignore"):
        for found, (code, a, b) in zip(row[first:], steps[begin:end].tolist(), strict=False):
            if code == IMAGE:
                np.matmul(row[b], matrices[a], found)
            elif code == TOTAL:
                found[:] = row[a] @ row[b]
            elif code in OF_TWO:
                OF_TWO[code](row[a], row[b], found)
            elif code != GIVEN:
                OF_ONE[code](row[a], found)


def jacobian(
    rows: Array,
    maps: Array,
    matrices: Array,
    fields: Array,
    terms: Array,
    spans: Array,
    scales: Array,
) -> Array:
    """See `compiled_machine.jacobian`."""
    size = maps.shape[2]
    places = [slice(low, high) for low, high in spans.tolist()]
    known = [of[:, place] for of, place in zip(maps, places, strict=False)]
    found = np.empty((scales.size, size), rows.dtype)
    pairs = terms.tolist()
    column = rows[:, :, None]
    line = 0
    for matrix, count, begin, end, _ in fields.tolist():
        total = np.zeros((count, size), rows.dtype)
        for diagonal, which in pairs[begin:end]:
            total[:, places[which]] += column[diagonal, :count] * known[which][:count]
        if matrix < 0:
            found[line : line + count] = total
            line += count
        else:
            known.append(matrices[matrix].T @ total[:, places[len(known)]])
    return found / scales[:, None]
