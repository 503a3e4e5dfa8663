"""The loops of `compiled_machine` by operations of NumPy on whole rows, for where Numba is not."""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.programs import CODES

_OF_TWO: dict[int, np.ufunc] = {
    CODES["add"]: np.add, CODES["sub"]: np.subtract, CODES["mul"]: np.multiply,
    CODES["truediv"]: np.divide,
}  # fmt: skip
_OF_ONE: dict[int, np.ufunc] = {
    CODES["neg"]: np.negative, CODES["sin"]: np.sin, CODES["cos"]: np.cos, CODES["sqrt"]: np.sqrt
}
_IMAGE, _GIVEN = CODES["matmul"], CODES["relation"]


def run_steps(steps: Array, matrices: Array, rows: Array, begin: int, end: int) -> None:
    """See `compiled_machine.run_steps`; a division by zero gives inf or nan here too."""
    row = list(rows)
    first = len(row) - len(steps) + begin
    with np.errstate(all="ignore"):
        for found, (code, a, b) in zip(row[first:], steps[begin:end].tolist(), strict=False):
            if code == _IMAGE:
                np.matmul(row[b], matrices[a], found)
            elif code in _OF_TWO:
                _OF_TWO[code](row[a], row[b], found)
            elif code != _GIVEN:
                _OF_ONE[code](row[a], found)


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
    n, size = rows.shape[1], maps.shape[2]
    places = [slice(low, high) for low, high in spans.tolist()]
    known = [of[:, place] for of, place in zip(maps, places, strict=False)]
    found = np.empty((scales.size, size), rows.dtype)
    pairs = terms.tolist()
    column = rows[:, :, None]
    line = 0
    for matrix, count, begin, end in fields.tolist():
        total = np.zeros((count, size), rows.dtype)
        for diagonal, which in pairs[begin:end]:
            total[:, places[which]] += column[diagonal, :count] * known[which][:count]
        if matrix < 0:
            found[line : line + count] = total
            line += count
        else:
            known.append(matrices[matrix].T @ total[:, places[len(known)]])
    return found / scales[:, None]
