"""Dense kernels on panels stored in tiles of eight rows, as vector instructions for compiled code.

A panel (m, k) with m a multiple of 8 lies in memory as m/8 tiles, each k columns of 8 numbers:
entry (i, j) at (i // 8) * 8 k + 8 j + i % 8. Matrices so stored are read from front to back by
every kernel. `product` is the inner kernel of all factorizations (as in K. Goto, R. A. van de
Geijn, ACM Trans. Math. Softw. 34, 12, 2008); the compiler would not keep its sums in registers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from amoeboid.numerics.compiled import compiled

ROWS = 8
# Tiles that one product takes at a time: their sums must fit into the registers.
TILES = 3 if llvm.get_host_cpu_features().get("avx512f") else 1
# Columns that one product takes at a time; a node has three unknowns.
COLUMNS = 6

_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, ROWS)
_FUSE = ("contract",)  # allows a multiplication and an addition in one instruction


class _Emitter:
    """Emits vector instructions through `builder`; addresses are counted in numbers."""

    def __init__(self, context: Any, builder: Any, arrays: Any) -> None:
        self.builder = builder
        self.starts = [context.make_array(t)(context, builder, v).data for t, v in arrays]

    def address(self, array: int, place: Any, kind: Any = _DOUBLE) -> Any:
        pointer = self.builder.gep(self.starts[array], [place], inbounds=True)
        return self.builder.bitcast(pointer, ir.PointerType(kind))

    def load(self, array: int, place: Any) -> Any:
        return self.builder.load(self.address(array, place, _VECTOR), align=8)

    def store(self, value: Any, array: int, place: Any) -> None:
        self.builder.store(value, self.address(array, place, _VECTOR), align=8)

    def number(self, array: int, place: Any) -> Any:
        return self.builder.load(self.address(array, place), align=8)

    def spread(self, value: Any) -> Any:
        one = self.builder.insert_element(
            ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
        )
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), ROWS), [0] * ROWS)
        return self.builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), zeros)

    def sum(self, value: Any) -> Any:
        half = ROWS // 2
        while half >= 1:
            index = ir.Constant(ir.VectorType(ir.IntType(32), half), list(range(half)))
            other = ir.Constant(ir.VectorType(ir.IntType(32), half), list(range(half, 2 * half)))
            undefined = ir.Constant(value.type, ir.Undefined)
            low = self.builder.shuffle_vector(value, undefined, index)
            value = self.builder.fadd(low, self.builder.shuffle_vector(value, undefined, other))
            half //= 2
        return self.builder.extract_element(value, ir.Constant(ir.IntType(32), 0))

    def less_product(self, c: Any, a: Any, b: Any) -> Any:
        return self.builder.fsub(c, self.builder.fmul(a, b, flags=_FUSE), flags=_FUSE)

    def plus(self, a: Any, times: int, b: Any) -> Any:
        return self.builder.add(a, self.builder.mul(_word(times), b))

    def in_tiles(self, row: Any, width: Any) -> Any:
        """Place of the first number of a row of a panel."""
        tile = self.builder.lshr(row, _word(3))
        within = self.builder.and_(row, _word(7))
        return self.builder.add(
            self.builder.mul(self.builder.mul(tile, width), _word(ROWS)), within
        )


def _word(value: int) -> Any:
    return ir.Constant(_WORD, value)


def product(tiles: int, columns: int) -> Callable[..., None]:
    """Compiled function (c, c0, cv, cc, a, a0, b, b0, row, width, depth): c -= a b^T.

    a: `tiles` tiles of a panel of `width` columns, from place a0; b: rows `row` ... of a panel of
    the same width at b0, `columns` of them; the first `depth` columns of both count. c: a tile at
    c0, columns cc, tiles cv numbers apart.
    """

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kinds = signature.args
        c0, cv, cc, a0, b0, row, width, depth = (args[i] for i in (1, 2, 3, 5, 7, 8, 9, 10))
        e = _Emitter(context, builder, [(kinds[i], args[i]) for i in (0, 4, 6)])
        places = [[e.plus(e.plus(c0, t, cv), j, cc) for j in range(columns)] for t in range(tiles)]
        kept = [[cgutils.alloca_once(builder, _VECTOR) for _ in line] for line in places]
        for line, sums in zip(places, kept, strict=True):
            for place, total in zip(line, sums, strict=True):
                builder.store(e.load(0, place), total)
        stride = builder.mul(width, _word(ROWS))
        rows_b = [
            builder.add(b0, e.in_tiles(builder.add(row, _word(j)), width)) for j in range(columns)
        ]
        rows_a = [e.plus(a0, t, stride) for t in range(tiles)]
        with cgutils.for_range(builder, depth) as loop:
            along = builder.mul(loop.index, _word(ROWS))
            left = [e.load(1, builder.add(place, along)) for place in rows_a]
            for j, place in enumerate(rows_b):
                right = e.spread(e.number(2, builder.add(place, along)))
                for t in range(tiles):
                    total = builder.load(kept[t][j])
                    builder.store(e.less_product(total, left[t], right), kept[t][j])
        for line, sums in zip(places, kept, strict=True):
            for place, total in zip(line, sums, strict=True):
                e.store(builder.load(total), 0, place)
        return context.get_dummy_value()

    @intrinsic
    def kernel(typingctx, c, c0, cv, cc, a, a0, b, b0, row, width, depth):  # type: ignore[no-untyped-def]
        word = types.int64
        return types.void(c, word, word, word, a, word, b, word, word, word, word), emit

    return kernel


def cholesky(columns: int) -> Callable[..., bool]:
    """Compiled function (l, l0, row, width, tiles): eliminate columns row ... row + `columns` - 1.

    Their entries from row on become those of the Cholesky factor, except for the diagonal, which
    becomes its inverse; l0: place of the panel, which has `tiles` tiles. Whether all pivots were
    positive and finite.
    """

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        l0, row, width, tiles = args[1:]
        e = _Emitter(context, builder, [(signature.args[0], args[0])])
        column = builder.mul(row, _word(ROWS))
        starts = [
            builder.add(builder.add(l0, column), e.in_tiles(builder.add(row, _word(i)), width))
            for i in range(columns)
        ]
        place = {
            (i, j): builder.add(starts[i], _word(ROWS * j))
            for i in range(columns)
            for j in range(i + 1)
        }
        block = {ij: e.number(0, p) for ij, p in place.items()}
        root = builder.module.declare_intrinsic("llvm.sqrt", [_DOUBLE])
        sound = ir.Constant(ir.IntType(1), 1)
        one, zero = ir.Constant(_DOUBLE, 1.0), ir.Constant(_DOUBLE, 0.0)
        infinity = ir.Constant(_DOUBLE, float("inf"))
        for j in range(columns):
            pivot = block[j, j]
            sound = builder.and_(sound, builder.fcmp_ordered(">", pivot, zero))
            sound = builder.and_(sound, builder.fcmp_ordered("<", pivot, infinity))
            block[j, j] = builder.fdiv(one, builder.call(root, [pivot]))
            for i in range(j + 1, columns):
                block[i, j] = builder.fmul(block[i, j], block[j, j])
            for i in range(j + 1, columns):
                for m in range(j + 1, i + 1):
                    block[i, m] = e.less_product(block[i, m], block[i, j], block[m, j])
        spread = {ij: e.spread(value) for ij, value in block.items()}
        first = builder.lshr(row, _word(3))
        stride = builder.mul(width, _word(ROWS))
        with cgutils.for_range_slice(builder, first, tiles, _word(1), _WORD) as (tile, _):
            begin = builder.add(builder.add(l0, column), builder.mul(tile, stride))
            solved: list[Any] = []
            for j in range(columns):
                at = builder.add(begin, _word(ROWS * j))
                value = e.load(0, at)
                for m in range(j):
                    value = e.less_product(value, solved[m], spread[j, m])
                solved.append(builder.fmul(value, spread[j, j]))
                e.store(solved[j], 0, at)
        for ij, p in place.items():
            builder.store(block[ij], e.address(0, p))
        return sound

    @intrinsic
    def kernel(typingctx, l, l0, row, width, tiles):  # type: ignore[no-untyped-def]  # noqa: E741
        word = types.int64
        return types.boolean(l, word, word, word, word), emit

    return kernel


def dots(columns: int, vectors: int) -> Callable[..., None]:
    """Compiled function (x, x0, l, l0, column, width, first, tiles, y, y0, long): x -= l^T y.

    l: panel of `width` columns at place l0, of which `columns` from `column` on count and tiles
    first ... tiles - 1; `vectors` vectors y, `long` apart from place y0 on. x: a number for each
    column and vector, vector by vector, at place x0.
    """

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kinds = signature.args
        x0, l0, column, width, first, tiles, y0, long = (args[i] for i in (1, 3, 4, 5, 6, 7, 9, 10))
        e = _Emitter(context, builder, [(kinds[i], args[i]) for i in (0, 2, 8)])
        pairs = [(j, v) for j in range(columns) for v in range(vectors)]
        kept = {pair: cgutils.alloca_once(builder, _VECTOR) for pair in pairs}
        for total in kept.values():
            builder.store(ir.Constant(_VECTOR, [0.0] * ROWS), total)
        l1 = builder.add(l0, builder.mul(column, _word(ROWS)))
        stride = builder.mul(width, _word(ROWS))
        with cgutils.for_range_slice(builder, first, tiles, _word(1), _WORD) as (tile, _):
            begin = builder.add(l1, builder.mul(tile, stride))
            row = e.plus(y0, ROWS, tile)
            right = [e.load(2, e.plus(row, v, long)) for v in range(vectors)]
            for j in range(columns):
                left = e.load(1, builder.add(begin, _word(ROWS * j)))
                for v in range(vectors):
                    total = builder.load(kept[j, v])
                    builder.store(e.less_product(total, left, right[v]), kept[j, v])
        for (j, v), total in kept.items():
            at = e.address(0, builder.add(x0, _word(j + columns * v)))
            start = builder.load(at, align=8)
            builder.store(builder.fadd(start, e.sum(builder.load(total))), at)
        return context.get_dummy_value()

    @intrinsic
    def kernel(typingctx, x, x0, l, l0, column, width, first, tiles, y, y0, long):  # type: ignore[no-untyped-def]  # noqa: E741
        word = types.int64
        return types.void(x, word, l, word, word, word, word, word, y, word, word), emit

    return kernel


_products = [(product(TILES, n), product(1, n)) for n in (1, 3, 4, 6)]
(_wide_1, _one_1), (_wide_3, _one_3), (_wide_4, _one_4), (_wide_6, _one_6) = _products


@compiled
def subtract(c, c0, cv, cc, a, a0, b, b0, row, width, depth, first, last, columns):  # type: ignore[no-untyped-def]
    """c -= a b^T, see `product`, for tiles first ... last - 1 of a and c; columns: 1, 3, 4 or 6."""
    t, stride = first, ROWS * width
    while t + TILES <= last:
        c1, a1 = c0 + t * cv, a0 + t * stride
        if columns == 6:
            _wide_6(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        elif columns == 3:
            _wide_3(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        elif columns == 4:
            _wide_4(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        else:
            _wide_1(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        t += TILES
    while t < last:
        c1, a1 = c0 + t * cv, a0 + t * stride
        if columns == 6:
            _one_6(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        elif columns == 3:
            _one_3(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        elif columns == 4:
            _one_4(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        else:
            _one_1(c, c1, cv, cc, a, a1, b, b0, row, width, depth)
        t += 1
