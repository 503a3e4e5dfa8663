"""Conjugate gradients for a quadratic form under one linear constraint.

A projection in every iteration keeps the constraint (N. I. M. Gould, M. E. Hribar, J. Nocedal,
SIAM J. Sci. Comput. 23, 1376, 2001, without preconditioner). The matrix may be singular as long as
force and constraint do no work on its null space; the part of the start in the null space remains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.numerics.compiled import compiled, nested


@dataclass(frozen=True, eq=False)
class ConstrainedMinimum:
    """x (n, 3) with K x + multiplier a = b on the constraint a.x = const.

    `residual` is the norm of b - K x - multiplier a, `iterations` the number of iterations.
    """

    x: Array
    multiplier: float
    residual: float
    iterations: int


def constrained_minimum(
    blocks: Array,
    columns: Index,
    row_start: Index,
    b: Array,
    a: Array,
    start: Array,
    tolerance: float,
    max_iterations: int,
) -> ConstrainedMinimum:
    """Minimize x.K.x/2 - b.x over the x (n, 3) with a.x = a.start.

    K positive semidefinite in 3 x 3 `blocks` (P, 3, 3), compressed rows: `columns` (P,),
    `row_start` (n + 1,). Ends when the norm of the residual is below `tolerance` (in the unit of
    b), or after `max_iterations`; `residual` tells which.
    """
    return ConstrainedMinimum(
        *_constrained_minimum(blocks, columns, row_start, b, a, start, tolerance, max_iterations)
    )


@nested
def _times(blocks, columns, row_start, x, product):  # type: ignore[no-untyped-def]
    for i in range(row_start.shape[0] - 1):
        s0, s1, s2 = 0.0, 0.0, 0.0
        for k in range(row_start[i], row_start[i + 1]):
            j = columns[k]
            x0, x1, x2 = x[j, 0], x[j, 1], x[j, 2]
            s0 += blocks[k, 0, 0] * x0 + blocks[k, 0, 1] * x1 + blocks[k, 0, 2] * x2
            s1 += blocks[k, 1, 0] * x0 + blocks[k, 1, 1] * x1 + blocks[k, 1, 2] * x2
            s2 += blocks[k, 2, 0] * x0 + blocks[k, 2, 1] * x1 + blocks[k, 2, 2] * x2
        product[i, 0], product[i, 1], product[i, 2] = s0, s1, s2


@compiled
def _constrained_minimum(blocks, columns, row_start, b, a, start, tolerance, most):  # type: ignore[no-untyped-def]
    x, product = start.copy(), np.empty_like(start)
    square = np.sum(a * a)
    _times(blocks, columns, row_start, x, product)
    residual = b - product
    multiplier = np.sum(a * residual) / square
    residual -= multiplier * a
    direction = residual.copy()
    size = np.sum(residual * residual)
    iterations = 0
    while size > tolerance**2 and iterations < most:
        _times(blocks, columns, row_start, direction, product)
        length = size / np.sum(direction * product)
        x += length * direction
        # the part of K d along a goes into the multiplier
        along = np.sum(a * product) / square
        multiplier -= length * along
        residual -= length * (product - along * a)
        before, size = size, np.sum(residual * residual)
        direction = residual + (size / before) * direction
        iterations += 1
    return x, multiplier, np.sqrt(size), iterations
