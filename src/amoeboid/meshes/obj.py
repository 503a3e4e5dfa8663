"""OBJ files: the points and polygons of all their groups; the rest is passed over."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import numpy as np

from amoeboid.meshes.polygons import Polygons, Unreadable, numbers


def read_obj(data: bytes) -> Polygons:
    """The polygons of an OBJ file. Raises Unreadable."""
    points, sizes, corners = array("d"), array("q"), array("q")
    for number, words in _lines(data):
        try:
            if words[0] == b"v":
                points.extend(_point(words[1:]))
            elif words[0] in (b"f", b"fo"):
                found = [_corner(word, len(points) // 3) for word in words[1:]]
                sizes.append(len(found))
                corners.extend(found)
        except (Unreadable, OverflowError) as error:
            raise Unreadable(f"line {number}: {error}") from None
    return Polygons(
        np.array(points).reshape(-1, 3),
        np.array(sizes, dtype=np.int64),
        np.array(corners, dtype=np.int64),
    )


def _lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Words of every line that has some, with the number at which it ends."""
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    begun: list[bytes] = []
    number, begin = 0, 0
    while begin < len(data):
        end = data.find(b"\n", begin)
        end = len(data) if end < 0 else end
        line = data[begin:end].partition(b"#")[0].rstrip()
        number, begin = number + 1, end + 1
        continued = line.endswith(b"\\")
        begun += line.removesuffix(b"\\").split()
        if begun and not continued:
            yield number, begun
            begun = []
    if begun:
        yield number, begun


def _point(words: list[bytes]) -> list[float]:
    if len(words) < 3:
        raise Unreadable(f"a point must have three coordinates, got {len(words)}")
    x, y, z, *more = numbers(words[:4]).tolist()
    if len(words) == 4 and more != [1.0]:
        raise Unreadable(f"the weight of a point must be 1, got {more[0]:g}")
    return [x, y, z]  # colors may follow


def _corner(word: bytes, count: int) -> int:
    """Number of a point, from 0; the file counts from 1, or backwards from the latest one."""
    try:
        number = int(word.partition(b"/")[0])
    except ValueError:
        number = 0
    if number == 0 or number < -count:
        shown = word[:40].decode(errors="replace")
        raise Unreadable(f"no point has the number {shown!r}, there are {count} before it")
    return number - 1 if number > 0 else count + number
