"""Dense kernels on panels stored in tiles of eight rows, as vector instructions for compiled code.

A panel (m, k) with m a multiple of 8 lies in memory as m/8 tiles, each k columns of 8 numbers:
entry (i, j) at (i // 8) * 8 k + 8 j + i % 8. Matrices so stored are read from front to back by
every kernel. `product` is the inner kernel of all factorizations (as in K. Goto, R. A. van de
Geijn, ACM Trans. Math. Softw. 34, 12, 2008); the compiler would not keep its sums in registers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from amoeboid.numerics.compiled import nested

ROWS = 8
# Columns that one product takes at a time: its sums fit into the registers of AVX2, and as many of
# them hide the time that one takes. A node has three unknowns.
COLUMNS = 6
# As arguments for `subtract`, which would be compiled once more for every constant of Python.
TILE, NONE = np.int64(ROWS), np.int64(0)

_DOUBLE, _WORD = ir.DoubleType(), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, ROWS)
_FUSE = ("contract",)  # allows a multiplication and an addition in one instruction


class _Emitter:
    """Emits vector instructions through `builder`, for numbers at places after `starts`."""

    def __init__(self, builder: Any, *starts: Any) -> None:
        self.builder = builder
        self.starts = [builder.inttoptr(start, ir.PointerType(_DOUBLE)) for start in starts]

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

    def less_product(self, c: Any, a: Any, b: Any) -> Any:
        return self.builder.fsub(c, self.builder.fmul(a, b, flags=_FUSE), flags=_FUSE)

    def plus_product(self, c: Any, a: Any, b: Any) -> Any:
        return self.builder.fadd(c, self.builder.fmul(a, b, flags=_FUSE), flags=_FUSE)

    def plus(self, a: Any, times: int, b: Any) -> Any:
        return self.builder.add(a, self.builder.mul(_word(times), b))

    def positive(self, value: Any) -> Any:
        """Whether a number is positive and finite."""
        above = self.builder.fcmp_ordered(">", value, ir.Constant(_DOUBLE, 0.0))
        below = self.builder.fcmp_ordered("<", value, ir.Constant(_DOUBLE, float("inf")))
        return self.builder.and_(above, below)

    def block(self, row: Any, width: Any, size: int) -> dict[tuple[int, int], Any]:
        """Places of the entries on and below the diagonal, from `row` on."""
        column = self.builder.mul(_word(ROWS), row)
        starts = [
            self.builder.add(column, self.in_tiles(self.builder.add(row, _word(i)), width))
            for i in range(size)
        ]
        return {
            (i, j): self.builder.add(starts[i], _word(ROWS * j))
            for i in range(size)
            for j in range(i + 1)
        }

    @contextmanager
    def each_tile(self, row: Any, width: Any, tiles: Any) -> Iterator[Any]:
        """Loop over the tiles from that of `row` on; the place of column `row` in each."""
        column = self.builder.mul(_word(ROWS), row)
        first, stride = self.builder.lshr(row, _word(3)), self.builder.mul(width, _word(ROWS))
        with cgutils.for_range_slice(self.builder, first, tiles, _word(1), _WORD) as (tile, _):
            yield self.builder.add(column, self.builder.mul(tile, stride))

    def in_tiles(self, row: Any, width: Any) -> Any:
        """Place of the first number of a row of a panel."""
        tile = self.builder.lshr(row, _word(3))
        within = self.builder.and_(row, _word(7))
        return self.builder.add(
            self.builder.mul(self.builder.mul(tile, width), _word(ROWS)), within
        )


def _word(value: int) -> Any:
    return ir.Constant(_WORD, value)


def product(columns: int) -> Callable[..., None]:
    """Compiled function (c, cc, a, b, row, width, depth): c -= a b^T.

    a: address of a tile of a panel of `width` columns; b: that of a panel of the same width, of
    which `columns` rows from `row` on count; of both the first `depth` columns. c: address of a
    tile with columns cc apart.
    """

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        c, cc, a, b, row, width, depth = args
        e = _Emitter(builder, c, a, b)
        places = [builder.mul(_word(j), cc) for j in range(columns)]
        kept = [cgutils.alloca_once(builder, _VECTOR) for _ in places]
        for place, total in zip(places, kept, strict=True):
            builder.store(e.load(0, place), total)
        rows = [e.in_tiles(builder.add(row, _word(j)), width) for j in range(columns)]
        with cgutils.for_range(builder, depth) as loop:
            along = builder.mul(loop.index, _word(ROWS))
            left = e.load(1, along)
            for place, total in zip(rows, kept, strict=True):
                right = e.spread(e.number(2, builder.add(place, along)))
                builder.store(e.less_product(builder.load(total), left, right), total)
        for place, total in zip(places, kept, strict=True):
            e.store(builder.load(total), 0, place)
        return context.get_dummy_value()

    @intrinsic
    def kernel(typingctx, c, cc, a, b, row, width, depth):  # type: ignore[no-untyped-def]
        return types.void(*[types.int64] * 7), emit

    return kernel


def cholesky(columns: int) -> Callable[..., bool]:
    """Compiled function (l, row, width, tiles): eliminate columns row ... row + `columns` - 1.

    Their entries from row on become those of the Cholesky factor, except for the diagonal, which
    becomes its inverse; l: address of the panel, which has `tiles` tiles. Whether all pivots were
    positive and finite.
    """

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        l, row, width, tiles = args  # noqa: E741
        e = _Emitter(builder, l)
        place = e.block(row, width, columns)
        block = {ij: e.number(0, p) for ij, p in place.items()}
        root = builder.module.declare_intrinsic("llvm.sqrt", [_DOUBLE])
        sound, one = ir.Constant(ir.IntType(1), 1), ir.Constant(_DOUBLE, 1.0)
        for j in range(columns):
            sound = builder.and_(sound, e.positive(block[j, j]))
            block[j, j] = builder.fdiv(one, builder.call(root, [block[j, j]]))
            for i in range(j + 1, columns):
                block[i, j] = builder.fmul(block[i, j], block[j, j])
            for i in range(j + 1, columns):
                for m in range(j + 1, i + 1):
                    block[i, m] = e.less_product(block[i, m], block[i, j], block[m, j])
        spread = {ij: e.spread(value) for ij, value in block.items()}
        with e.each_tile(row, width, tiles) as begin:
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
    def kernel(typingctx, l, row, width, tiles):  # type: ignore[no-untyped-def]  # noqa: E741
        return types.boolean(*[types.int64] * 4), emit

    return kernel


def gauss(columns: int) -> Callable[..., bool]:
    """Compiled function (l, u, row, width, tiles): eliminate as `cholesky` does, but into L U.

    l: panel of the columns of L, with a diagonal of 1 in place of which there is the inverse of
    that of U; u: panel of the columns of the transposed U.
    """

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        l, u, row, width, tiles = args  # noqa: E741
        e = _Emitter(builder, l, u)
        place = e.block(row, width, columns)
        lower, upper = ({ij: e.number(a, p) for ij, p in place.items()} for a in (0, 1))
        sound, one = ir.Constant(ir.IntType(1), 1), ir.Constant(_DOUBLE, 1.0)
        for j in range(columns):
            sound = builder.and_(sound, e.positive(lower[j, j]))
            lower[j, j] = builder.fdiv(one, lower[j, j])
            for i in range(j + 1, columns):
                lower[i, j] = builder.fmul(lower[i, j], lower[j, j])
            for i in range(j + 1, columns):
                for m in range(j + 1, i + 1):
                    lower[i, m] = e.less_product(lower[i, m], lower[i, j], upper[m, j])
                    upper[i, m] = e.less_product(upper[i, m], upper[i, j], lower[m, j])
        spread = [{ij: e.spread(value) for ij, value in half.items()} for half in (lower, upper)]
        with e.each_tile(row, width, tiles) as begin:
            for panel, other in ((0, 1), (1, 0)):
                solved: list[Any] = []
                for j in range(columns):
                    at = builder.add(begin, _word(ROWS * j))
                    value = e.load(panel, at)
                    for m in range(j):
                        value = e.less_product(value, solved[m], spread[other][j, m])
                    solved.append(builder.fmul(value, spread[0][j, j]) if panel == 0 else value)
                    e.store(solved[j], panel, at)
        for ij, p in place.items():
            builder.store(lower[ij], e.address(0, p))
            builder.store(upper[ij], e.address(1, p))
        return sound

    @intrinsic
    def kernel(typingctx, l, u, row, width, tiles):  # type: ignore[no-untyped-def]  # noqa: E741
        return types.boolean(*[types.int64] * 5), emit

    return kernel


def _dots(tiles: int) -> Callable[..., None]:
    """Compiled function (sums, l, width, y, columns): `add_dots` for a number of tiles."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        sums, l, width, y, columns = args  # noqa: E741
        e = _Emitter(builder, sums, l, y)
        stride = builder.mul(width, _word(ROWS))
        starts = [builder.mul(_word(t), stride) for t in range(tiles)]
        right = [e.load(2, _word(ROWS * t)) for t in range(tiles)]
        with cgutils.for_range(builder, columns) as loop:
            at = builder.mul(loop.index, _word(ROWS))
            total = e.load(0, at)
            for start, y_t in zip(starts, right, strict=True):
                total = e.plus_product(total, e.load(1, builder.add(at, start)), y_t)
            e.store(total, 0, at)
        return context.get_dummy_value()

    @intrinsic
    def kernel(typingctx, sums, l, width, y, columns):  # type: ignore[no-untyped-def]  # noqa: E741
        return types.void(*[types.int64] * 5), emit

    return kernel


_dots_1, _dots_4 = _dots(1), _dots(4)


@nested
def add_dots(sums, l, width, y, columns, tiles):  # type: ignore[no-untyped-def]  # noqa: E741
    """sums += l^T y row by row: of each column 8 sums, one for each row of the tiles.

    l: address of `tiles` tiles of a panel of `width` columns, of which the first `columns` count;
    y: that of a number for each row. The panel is read from front to back.
    """
    t = 0
    while t + 4 <= tiles:
        _dots_4(sums, l + 8 * t * ROWS * width, width, y + 8 * t * ROWS, columns)
        t += 4
    while t < tiles:
        _dots_1(sums, l + 8 * t * ROWS * width, width, y + 8 * t * ROWS, columns)
        t += 1


@intrinsic
def address(typingctx, array, place):  # type: ignore[no-untyped-def]
    """Address of a number of a contiguous array, which must outlive its use."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        start = context.make_array(signature.args[0])(context, builder, args[0]).data
        return builder.ptrtoint(builder.gep(start, [args[1]]), _WORD)

    return types.int64(array, types.int64), emit


@intrinsic
def scatter(typingctx, target, index, source, first, last):  # type: ignore[no-untyped-def]
    """target[index[i]] += source[i] for i = first ... last - 1; three addresses."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        target, index, source, first, last = args
        e = _Emitter(builder, target, source)
        places = builder.inttoptr(index, ir.PointerType(_WORD))
        with cgutils.for_range_slice(builder, first, last, _word(1), _WORD) as (i, _):
            at = e.address(0, builder.load(builder.gep(places, [i])))
            builder.store(builder.fadd(builder.load(at), e.number(1, i)), at)
        return context.get_dummy_value()

    return types.void(*[types.int64] * 5), emit


_product_1, _product_3, _product_4, _product_6 = (product(n) for n in (1, 3, 4, 6))


@nested
def subtract(c, cv, cc, a, b, row, width, depth, first, last, columns):  # type: ignore[no-untyped-def]
    """c -= a b^T, see `product`, for tiles first ... last - 1 of a panel a, and of c, cv apart.

    There are kernels for 1, 3, 4 and 6 columns.
    """
    step, stride = 8 * cv, 8 * ROWS * width
    c1, a1 = c + first * step, a + first * stride
    for _ in range(first, last):
        if columns == 6:
            _product_6(c1, cc, a1, b, row, width, depth)
        elif columns == 3:
            _product_3(c1, cc, a1, b, row, width, depth)
        elif columns == 4:
            _product_4(c1, cc, a1, b, row, width, depth)
        else:
            _product_1(c1, cc, a1, b, row, width, depth)
        c1, a1 = c1 + step, a1 + stride
