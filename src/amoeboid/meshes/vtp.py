"""The files .vtp that this package writes, and their arrays again without VTK.

Of the format it knows what `frame_bytes` makes of it: one piece, triangles, arrays as they are; and
what it made of it in version 0.1, arrays in base64 of zlib. Nothing in a file is run, and no more
is unpacked than its header announces. Files of other programs are read by VTK, see `files`.
"""

from __future__ import annotations

import binascii
import re
import zlib
from collections.abc import Mapping
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array, Index
from amoeboid.meshes.checks import MAX_NODES

# How the arrays of a frame are stored: as they are, behind the text of the file.
HEADER = 'byte_order="LittleEndian" header_type="UInt64"'
APPENDED = '<AppendedData encoding="raw">'
CHECKSUM = "<!-- crc32 of the arrays: {:08x} -->"
_ARRAY = re.compile(rb'<DataArray type="(\w+)" Name="(\w+)"[^>]*? offset="(\d+)"')
_TYPES = {b"Float64": np.dtype("<f8"), b"Int64": np.dtype("<i8")}
_HEADER_0_1 = b'byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor"'
MAX_BYTES = 3 * 2 * 8 * MAX_NODES  # of one array: the triangles of the largest mesh
# What reading another file, or a damaged one, ends with.
UNREADABLE = (ValueError, KeyError, IndexError, zlib.error, binascii.Error)


def frame_bytes(
    r: Array, faces: Index, fields: Mapping[str, Array], numbers: Mapping[str, Array]
) -> bytes:
    """A file of VTK PolyData: nodes (V, 3), triangles (F, 3), and what `frame_arrays` gives."""
    blocks = _Blocks()
    corners = 3 * np.arange(1, len(faces) + 1)
    lines = [
        f'<VTKFile type="PolyData" version="1.0" {HEADER}>',
        "<PolyData>",
        "<FieldData>",
        *(blocks.add(name, value, f'NumberOfTuples="{np.size(value)}"')
          for name, value in numbers.items()),
        "</FieldData>",
        f'<Piece NumberOfPoints="{len(r)}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" '
        f'NumberOfPolys="{len(faces)}">',
        '<PointData Scalars="c">',
        *(blocks.add(name, values, f'NumberOfComponents="{values[0].size}"')
          for name, values in fields.items()),
        "</PointData>",
        "<Points>", blocks.add("Points", r, 'NumberOfComponents="3"'), "</Points>",
        "<Polys>", blocks.add("connectivity", faces), blocks.add("offsets", corners), "</Polys>",
        "</Piece>",
        "</PolyData>",
        CHECKSUM.format(blocks.checksum),
        f"{APPENDED}_",
    ]  # fmt: skip
    end = b"\n</AppendedData>\n</VTKFile>\n"
    return b"".join(["\n".join(lines).encode(), *blocks.data, end])


class _Blocks:
    """The arrays of a file, one after the other, each behind its size in bytes."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.checksum = 0
        self._place = 0

    def add(self, name: str, values: ArrayLike, shape: str = "") -> str:
        """Append an array; returns the element that says where it lies."""
        array = np.asarray(values)
        whole = array.dtype.kind in "iu"
        block = np.ascontiguousarray(array, "<i8" if whole else "<f8").tobytes()
        start = self._place
        self.data += [len(block).to_bytes(8, "little"), block]
        self.checksum = crc32(block, self.checksum)
        self._place += 8 + len(block)
        kind = "Int64" if whole else "Float64"
        return (
            f'<DataArray type="{kind}" Name="{name}" {shape} format="appended" offset="{start}"/>'
        )


def vtp_arrays(data: bytes) -> dict[str, Array]:
    """All arrays of a file by name, flat; of those of cells the ones of the triangles.

    Raises what `UNREADABLE` holds for a file of another program, and for a damaged one.
    """
    head, found, body = data.partition(APPENDED.encode())
    unpacked = _raw
    if not found:
        head, found, body = data.partition(b'<AppendedData encoding="base64">')
        unpacked = _unpacked
    if not found or (HEADER.encode() if unpacked is _raw else _HEADER_0_1) not in head:
        raise ValueError("it is damaged or of another type")
    body = body[body.index(b"_") + 1 :]
    polys = head.index(b"<Polys>")
    others = (head.index(b"<Points>"), *(p for p in [head.find(b"<Verts>")] if p >= 0))
    arrays: dict[str, Array] = {}
    checksum = 0
    for match in _ARRAY.finditer(head):
        kind, name, offset = match.groups()
        if min(others) < match.start() < polys and name != b"Points":
            continue  # vertices, lines and strips, of which there are none
        found_array = unpacked(body, int(offset), _TYPES[kind])
        arrays.setdefault(name.decode(), found_array)
        checksum = crc32(found_array.astype(_TYPES[kind]).tobytes(), checksum)
    if unpacked is _raw and CHECKSUM.format(checksum).encode() not in head:
        raise ValueError("its arrays are damaged")
    return arrays


def _raw(body: bytes, start: int, kind: np.dtype) -> Array:
    """The numbers of one array, which lie behind their size in bytes."""
    size = int.from_bytes(body[start : start + 8], "little")
    block = body[start + 8 : start + 8 + size]
    if len(block) != size:
        raise ValueError("it is damaged: it ends early")
    return np.frombuffer(block, kind).astype(kind.newbyteorder("="))


def _unpacked(body: bytes, start: int, kind: np.dtype) -> Array:
    """The numbers of one array: a header of sizes, then its blocks."""
    count = int(np.frombuffer(_decoded(body, start, 4), "<u4")[0])
    if count > MAX_BYTES // 2**10:
        raise ValueError("it announces too much")
    header = np.frombuffer(_decoded(body, start, 12 + 4 * count), "<u4").astype(int)
    start += _encoded(12 + 4 * count)
    packed = _decoded(body, start, int(header[3:].sum()))
    size, last = int(header[1]), int(header[2])
    parts, place = [], 0
    for k, length in enumerate(header[3:]):
        wanted = last if last and k == count - 1 else size
        if wanted * count > 2 * MAX_BYTES:
            raise ValueError("it announces too much")
        part = zlib.decompressobj().decompress(packed[place : place + length], wanted)
        if len(part) != wanted:
            raise ValueError("it is damaged")
        parts.append(part)
        place += length
    return np.frombuffer(b"".join(parts), kind).astype(kind.newbyteorder("="))


def _encoded(length: int) -> int:
    """Characters of so many bytes in base64."""
    return 4 * -(-length // 3)


def _decoded(body: bytes, start: int, length: int) -> bytes:
    if start + _encoded(length) > len(body):
        raise ValueError("it is damaged: it ends early")
    return binascii.a2b_base64(body[start : start + _encoded(length)])[:length]
