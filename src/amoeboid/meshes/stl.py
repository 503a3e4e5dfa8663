"""STL files, of either kind: triangles, each with its own three points."""

from __future__ import annotations

import re

import numpy as np

from amoeboid.meshes.polygons import Polygons, Unreadable, numbers, triangles

HEADER = 84  # bytes of a binary file before its triangles: a comment, and their number
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

# Names may hold any words, those of the format among them.
_NAMES = re.compile(rb"^[ \t]*(?:end[ \t]*)?solid\b[^\r\n]*", re.IGNORECASE | re.MULTILINE)
_CORNER = re.compile(rb"\bvertex\s++(\S++)\s++(\S++)\s++(\S++)", re.IGNORECASE)
_WORD = re.compile(rb"\bvertex\b", re.IGNORECASE)
_LOOP = re.compile(rb"\bouter\s++loop\b", re.IGNORECASE)
_FACET = re.compile(rb"\bfacet\b", re.IGNORECASE)


def read_stl(data: bytes) -> Polygons:
    """The triangles of an STL file. Raises Unreadable.

    A binary file is one whose length is that of the triangles it announces, whatever its comment;
    of another length it is one if it is no text.
    """
    announced = int.from_bytes(data[HEADER - 4 : HEADER], "little") if len(data) >= HEADER else 0
    length = HEADER + TRIANGLE.itemsize * announced
    if announced > 0 and length == len(data):
        return _binary(data, announced)
    if data.lstrip()[:5].lower() == b"solid" and _FACET.search(data):
        return _text(data)
    if announced > 0 and length < len(data):  # with something behind
        return _binary(data, announced)
    room, over = divmod(len(data) - HEADER, TRIANGLE.itemsize)
    if over == 0 and room > 0:
        raise Unreadable(
            f"its header announces {announced} triangles, and its length fits {room}; export it "
            "again"
        )
    raise Unreadable(
        "no triangles were found in it: it is truncated, or not an STL file; export it again"
    )


def _binary(data: bytes, count: int) -> Polygons:
    corners = np.frombuffer(data, TRIANGLE, count, HEADER)["corners"]
    points = corners.astype(np.float64).reshape(-1, 3)
    return triangles(points, np.arange(len(points)).reshape(-1, 3))


def _text(data: bytes) -> Polygons:
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    data = _NAMES.sub(b"", data)
    points = numbers(w for corner in _CORNER.finditer(data) for w in corner.groups())
    points = points.reshape(-1, 3)
    words, loops = (sum(1 for _ in words.finditer(data)) for words in (_WORD, _LOOP))
    if not words == len(points) == 3 * loops:
        raise Unreadable(
            f"its {loops} facets must have three vertices each, it has {words} vertices, "
            f"{len(points)} of them with three coordinates; it is truncated; export it again"
        )
    if loops == 0:
        raise Unreadable("no triangles were found in it")
    return triangles(points, np.arange(len(points)).reshape(-1, 3))
