"""The compiled loops that run recorded programs and put their Jacobians together.

Rows hold n numbers each, one for every point. Matrices are kept transposed, so that the innermost
loops run along rows.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.compiled import compiled, nested

(NEGATIVE, SUM, DIFFERENCE, PRODUCT, QUOTIENT, IMAGE, SINE, COSINE, ROOT, GIVEN, TOTAL) = range(11)


@nested
def _multiply(matrix, x, found):  # type: ignore[no-untyped-def]
    """found = matrix @ x, with the transposed matrix."""
    found[:] = 0.0
    for j in range(x.size):
        for i in range(found.size):
            found[i] += matrix[j, i] * x[j]


@nested
def _add_up(weights, x, found):  # type: ignore[no-untyped-def]
    """found = weights @ x, everywhere."""
    total = weights[0] * x[0]
    for i in range(1, x.size):
        total += weights[i] * x[i]
    found[:] = total


@compiled
def run_steps(steps: Array, matrices: Array, rows: Array, begin: int, end: int) -> None:
    """Run the steps from `begin` to before `end`: (code, first, second) each.

    What step k makes goes to row k of those after the constants and inputs.
    """
    shift = len(rows) - len(steps)
    n = rows.shape[1]
    for k in range(begin, end):
        code, a, b = steps[k]
        found = rows[shift + k]
        if code == IMAGE:
            _multiply(matrices[a], rows[b], found)
            continue
        if code == GIVEN:
            continue
        first = rows[a]
        if code == TOTAL:
            _add_up(first, rows[b], found)
            continue
        for i in range(n):
            if code == NEGATIVE:
                found[i] = -first[i]
            elif code == SUM:
                found[i] = first[i] + rows[b, i]
            elif code == DIFFERENCE:
                found[i] = first[i] - rows[b, i]
            elif code == PRODUCT:
                found[i] = first[i] * rows[b, i]
            elif code == QUOTIENT:
                found[i] = first[i] / rows[b, i]
            elif code == SINE:
                found[i] = np.sin(first[i])
            elif code == COSINE:
                found[i] = np.cos(first[i])
            else:
                found[i] = np.sqrt(first[i])


@nested
def _add(total, diagonal, block, count, low, high):  # type: ignore[no-untyped-def]
    """total += diag(diagonal) block, in the columns from `low` to before `high`."""
    for i in range(count):
        line, added, factor = total[i, low:high], block[i, low:high], diagonal[i]
        for j in range(line.size):
            line[j] += factor * added[j]


@nested
def _multiply_columns(matrix, block, found, low, high):  # type: ignore[no-untyped-def]
    """found = matrix @ block in the same columns, with the transposed matrix.

    Two rows are found at once, from four of the block: each number that is loaded serves twice.
    """
    rows = len(block)
    for start in range(0, len(found), 2):
        i = min(start, len(found) - 2)  # the last but one of an odd number is found twice
        one, two = found[i, low:high], found[i + 1, low:high]
        one[:] = 0.0
        two[:] = 0.0
        for k in range(0, rows - 3, 4):
            b0, b1 = block[k, low:high], block[k + 1, low:high]
            b2, b3 = block[k + 2, low:high], block[k + 3, low:high]
            f0, f1, f2, f3 = matrix[k, i], matrix[k + 1, i], matrix[k + 2, i], matrix[k + 3, i]
            g0, g1 = matrix[k, i + 1], matrix[k + 1, i + 1]
            g2, g3 = matrix[k + 2, i + 1], matrix[k + 3, i + 1]
            for j in range(one.size):
                one[j] += (f0 * b0[j] + f1 * b1[j]) + (f2 * b2[j] + f3 * b3[j])
                two[j] += (g0 * b0[j] + g1 * b1[j]) + (g2 * b2[j] + g3 * b3[j])
        for k in range(rows - rows % 4, rows):
            last, f, g = block[k, low:high], matrix[k, i], matrix[k, i + 1]
            for j in range(one.size):
                one[j] += f * last[j]
                two[j] += g * last[j]


@nested
def _multiply_row(row, block, found, low, high):  # type: ignore[no-untyped-def]
    """All rows of found = row @ block in the same columns."""
    first = found[0, low:high]
    first[:] = 0.0
    for k in range(len(block)):
        factor, added = row[k], block[k, low:high]
        for j in range(first.size):
            first[j] += factor * added[j]
    for i in range(1, len(found)):
        found[i, low:high] = first


@compiled
def jacobian(
    rows: Array,
    maps: Array,
    matrices: Array,
    fields: Array,
    terms: Array,
    spans: Array,
    scales: Array,
) -> Array:
    """The derivatives of all equations, each divided by its entry of `scales`.

    `fields` (count, 5): the matrix that the field is multiplied with, or -1 for an equation; its
    number of values; its first term and the one after its last; the rows of the matrix. `terms`
    (count, 2): the row of a diagonal, and a map: one of `maps`, or after them of the products so
    far. `spans` (count, 2) are the columns of each of these.
    """
    n, size = rows.shape[1], maps.shape[2]
    found = np.empty((scales.size, size), rows.dtype)
    images = np.empty((len(spans) - len(maps), n, size), rows.dtype)
    total = np.empty((n, size), rows.dtype)
    product = line = 0
    for matrix, count, begin, end, made in fields:
        total[:] = 0.0
        for k in range(begin, end):
            which = terms[k, 1]
            low, high = spans[which]
            if which < len(maps):
                _add(total, rows[terms[k, 0]], maps[which], count, low, high)
            else:
                _add(total, rows[terms[k, 0]], images[which - len(maps)], count, low, high)
        if matrix < 0:
            for i in range(count):
                for j in range(size):
                    found[line, j] = total[i, j] / scales[line]
                line += 1
        else:
            low, high = spans[len(maps) + product]
            if made == 1:
                _multiply_row(matrices[matrix, :, 0], total, images[product], low, high)
            else:
                _multiply_columns(matrices[matrix], total, images[product], low, high)
            product += 1
    return found
