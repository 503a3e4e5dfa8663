"""PLY files, text and binary of either byte order, with elements in any order."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array, Index
from amoeboid.meshes.polygons import Polygons, Unreadable, numbers, words_of

MAX_HEADER = 2**20  # bytes
TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
LISTS = ("vertex_indices", "vertex_index")
_HEADER = re.compile(rb"ply[ \t]*(\r\n|\n|\r)")


@dataclass(frozen=True)
class Property:
    """A number of an element, or with `length`, the type of their count, a list of numbers."""

    name: str
    kind: str
    length: str | None = None


@dataclass(frozen=True)
class Element:
    """`count` records of the same properties, one after another."""

    name: str
    count: int
    properties: list[Property]


# What a file holds of a property: numbers (N,), and for a list of each record its length (count,)
Columns = dict[str, tuple[NDArray, Index]]


def read_ply(data: bytes) -> Polygons:
    """The polygons of a PLY file. Raises Unreadable."""
    order, elements, body = _header(data)
    if order is None:
        records = _text_records(elements, body)
    else:
        records = _binary_records(elements, body, order)
    vertex, face = records.get("vertex", {}), records.get("face", {})
    missing = [name for name in "xyz" if name not in vertex or np.any(vertex[name][1] != 1)]
    lists = [name for name in LISTS if name in face]
    if missing or not lists:
        lacking = [f"property {name} of vertex" for name in missing]
        lacking += [] if lists else [f"property {LISTS[0]} of face"]
        raise Unreadable(f"no triangles were found in it, it lacks {', '.join(lacking)}")
    points = np.stack([vertex[name][0] for name in "xyz"], axis=1).astype(np.float64)
    corners, sizes = face[lists[0]]
    if np.any(corners != np.floor(corners)) or not np.all(np.abs(corners) < 2.0**53):
        raise Unreadable("numbers of points must be whole numbers")
    return Polygons(points, sizes, corners.astype(np.int64))


def _header(data: bytes) -> tuple[str | None, list[Element], bytes]:
    """Byte order (None for text), the elements, and what follows."""
    begin = _HEADER.match(data)
    line_end = begin.group(1) if begin else b"\n"
    end = data.find(b"end_header", 0, MAX_HEADER)
    rest = data.find(line_end, end)
    if begin is None or end < 0 or rest < 0:
        raise Unreadable("its header has no beginning or no end; export it again")
    order, elements = None, []
    for line in data[begin.end() : end].split(line_end):
        match line.decode(errors="replace").split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", "ascii", "1.0"]:
                order = None
            case ["format", kind, "1.0"] if kind in BYTE_ORDERS:
                order = BYTE_ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 18:
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, kind, name] if _known(elements, length, kind):
                elements[-1].properties.append(Property(name, TYPES[kind], TYPES[length]))
            case ["property", kind, name] if _known(elements, kind):
                elements[-1].properties.append(Property(name, TYPES[kind]))
            case words:
                raise Unreadable(f"its header has the line {' '.join(words)[:80]!r}")
    return order, elements, data[rest + len(line_end) :]


def _known(elements: Sequence[Element], *kinds: str) -> bool:
    return bool(elements) and all(kind in TYPES for kind in kinds)


def _cut_off(element: Element) -> Unreadable:
    return Unreadable(
        f"it ends before the {element.count} elements {element.name!r} that it announces; export "
        "it again"
    )


def _text_records(elements: Sequence[Element], body: bytes) -> dict[str, Columns]:
    for element in elements:
        if 2 * element.count > len(body) + 1:  # a digit and a space each
            raise _cut_off(element)
    values = numbers(words_of(body))
    records: dict[str, Columns] = {}
    at = 0
    for element in elements:
        if not element.properties:
            continue
        if element.count > len(values) - at:
            raise _cut_off(element)
        columns, at = _text_columns(element, values, at)
        records.setdefault(element.name, columns)
    return records


def _text_columns(element: Element, values: Array, at: int) -> tuple[Columns, int]:
    n = element.count
    if all(p.length is None for p in element.properties):
        width = len(element.properties)
        table = values[at : at + n * width]
        if len(table) < n * width:
            raise _cut_off(element)
        table = table.reshape(n, width)
        ones = np.ones(n, dtype=np.int64)
        named = {p.name: (table[:, k], ones) for k, p in enumerate(element.properties)}
        return named, at + n * width
    places: dict[str, list[int]] = {p.name: [] for p in element.properties}
    sizes: dict[str, list[int]] = {p.name: [] for p in element.properties}
    for _ in range(n):
        for p in element.properties:
            size = 1
            if p.length is not None:
                size, at = _length(values[at]) if at < len(values) else 0, at + 1
            places[p.name].append(at)
            sizes[p.name].append(size)
            at += size
            if at > len(values):
                raise _cut_off(element)
    columns = {}
    for p in element.properties:
        found = np.array(sizes[p.name], dtype=np.int64)
        begins = np.array(places[p.name], dtype=np.int64)
        columns[p.name] = (values[_ranges(begins, found)], found)
    return columns, at


def _length(value: float) -> int:
    if not (value >= 0 and value == np.floor(value) and value < 2**31):
        raise Unreadable(f"the length of a list must be a whole number, got {value:g}")
    return int(value)


def _ranges(begins: Index, sizes: Index) -> Index:
    """begin, begin + 1, ... of every range, one after another."""
    before = np.cumsum(sizes) - sizes
    return np.repeat(begins - before, sizes) + np.arange(int(sizes.sum()))


def _binary_records(elements: Sequence[Element], body: bytes, order: str) -> dict[str, Columns]:
    records: dict[str, Columns] = {}
    at = 0
    for element in elements:
        if not element.properties:
            continue
        if element.count > len(body) - at:
            raise _cut_off(element)
        found = _of_equal_length(element, body, at, order)
        columns, at = found if found is not None else _of_any_length(element, body, at, order)
        records.setdefault(element.name, columns)
    return records


def _of_equal_length(
    element: Element, body: bytes, at: int, order: str
) -> tuple[Columns, int] | None:
    """The records if their lists are all as long as those of the first one, and where they end."""
    n = element.count
    if n == 0:
        empty = (np.empty(0), np.empty(0, dtype=np.int64))
        return {p.name: empty for p in element.properties}, at
    sizes = [1 for _ in element.properties]
    place = at
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for k, p in enumerate(element.properties):
        if p.length is not None:
            kind = np.dtype(order + p.length)
            if place + kind.itemsize > len(body):
                raise _cut_off(element)
            sizes[k] = _length(float(np.frombuffer(body, kind, 1, place)[0]))
            place += kind.itemsize
            fields.append((f"length {k}", order + p.length, ()))
        place += sizes[k] * np.dtype(p.kind).itemsize
        if place > len(body):
            raise _cut_off(element)
        fields.append((f"values {k}", order + p.kind, (sizes[k],)))
    record = np.dtype(fields)
    if n * record.itemsize > len(body) - at:
        if all(p.length is None for p in element.properties):
            raise _cut_off(element)
        return None
    table = np.frombuffer(body, record, n, at)
    columns = {}
    for k, p in enumerate(element.properties):
        if p.length is not None and np.any(table[f"length {k}"] != sizes[k]):
            return None
        columns[p.name] = (table[f"values {k}"].ravel(), np.full(n, sizes[k], dtype=np.int64))
    return columns, at + n * record.itemsize


def _of_any_length(element: Element, body: bytes, at: int, order: str) -> tuple[Columns, int]:
    columns: dict[str, tuple[list[bytes], list[int]]] = {}
    for p in element.properties:
        columns[p.name] = ([], [])
    readers = []
    for p in element.properties:
        length = None if p.length is None else struct.Struct(order + _CODES[p.length])
        readers.append((length, np.dtype(p.kind).itemsize, *columns[p.name]))
    for _ in range(element.count):
        for length, width, pieces, sizes in readers:
            size = 1
            if length is not None:
                if at + length.size > len(body):
                    raise _cut_off(element)
                size = _length(length.unpack_from(body, at)[0])
                at += length.size
            end = at + size * width
            if end > len(body):
                raise _cut_off(element)
            pieces.append(body[at:end])
            sizes.append(size)
            at = end
    kinds = {p.name: order + p.kind for p in element.properties}
    named: Columns = {
        name: (np.frombuffer(b"".join(pieces), kinds[name]), np.array(sizes, dtype=np.int64))
        for name, (pieces, sizes) in columns.items()
    }
    return named, at


_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
