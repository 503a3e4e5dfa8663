"""What readers of surface files give: points and polygons, which are cut into triangles here."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.numerics.compiled import compiled, nested

MAX_CORNERS = 64
_WORD = re.compile(rb"\S++")


class Unreadable(ValueError):
    """A file is damaged or says something that its reader does not know; the message says what."""


@dataclass(frozen=True, eq=False)
class Polygons:
    """Points (V, 3), and polygons one after another: `sizes` (P,) of them, `corners` (sum,)."""

    points: Array
    sizes: Index
    corners: Index


def triangles(points: Array, faces: Index) -> Polygons:
    """Polygons that are all triangles (F, 3)."""
    return Polygons(points, np.full(len(faces), 3), faces.ravel())


def numbers(words: Iterable[bytes]) -> Array:
    """Words of a text file as numbers (N,). Raises Unreadable."""
    words, pieces = iter(words), [np.empty(0)]
    # in pieces: all words at a time would need many times the room of the file
    while piece := list(islice(words, 2**16)):
        try:
            pieces.append(np.fromiter(map(float, piece), float, len(piece)))
        except ValueError:
            raise Unreadable(_not_a_number(next(w for w in piece if not _is_number(w)))) from None
    return np.concatenate(pieces)


def words_of(text: bytes) -> Iterator[bytes]:
    """The words of a text, one after another."""
    return (match.group() for match in _WORD.finditer(text))


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _not_a_number(word: bytes) -> str:
    shown = repr(word[:40].decode(errors="replace"))
    if b"," in word and _is_number(word.replace(b",", b".", 1)):
        return f"{shown} has a decimal comma; export it with decimal points"
    return f"{shown} is in the place of a number"


def triangulated(polygons: Polygons) -> Index:
    """The polygons as triangles (F, 3) that look the same way.

    Polygons may be bent and concave: ears are cut off, the one of the best quality first. Raises
    Unreadable if there are no polygons, or they cannot be cut.
    """
    points, sizes, corners = polygons.points, polygons.sizes, polygons.corners
    if len(sizes) == 0 or len(points) == 0:
        raise Unreadable("no triangles were found in it")
    least, most = int(corners.min()), int(corners.max())
    if not 0 <= least <= most < len(points):
        raise Unreadable(f"its triangles use points {least} to {most} of {len(points)}")
    if sizes.min() < 3 or sizes.max() > MAX_CORNERS:
        raise Unreadable(
            f"polygons must have 3 to {MAX_CORNERS} corners, it has some with {sizes.min()} to "
            f"{sizes.max()}; cut them into triangles"
        )
    if np.all(sizes == 3):
        return corners.reshape(-1, 3)
    return np.asarray(_cut(points, sizes, corners))


@compiled
def _cut(r, sizes, corners):  # type: ignore[no-untyped-def]
    faces = np.empty((sizes.sum() - 2 * len(sizes), 3), np.int64)
    count, begin = 0, 0
    for n in sizes:
        left = corners[begin : begin + n].copy()
        begin += n
        normal = np.zeros(3)
        for k in range(1, n - 1):
            x, y, z, _ = _triangle(r, left[0], left[k], left[k + 1])
            normal[0], normal[1], normal[2] = normal[0] + x, normal[1] + y, normal[2] + z
        while n >= 3:
            best, at = -np.inf, 0
            for k in range(n):
                worth = _worth(r, left, n, k, normal) if n > 3 else 1.0
                if worth > best:
                    best, at = worth, k
            a, b, c = left[at - 1 if at > 0 else n - 1], left[at], left[(at + 1) % n]
            faces[count, 0], faces[count, 1], faces[count, 2] = a, b, c
            count += 1
            n -= 1
            for k in range(at, n):
                left[k] = left[k + 1]
    return faces


@nested
def _worth(r, left, n, k, normal):  # type: ignore[no-untyped-def]
    """Quality of the worse of the ear at corner k and, of a quadrilateral, of what it leaves.

    Below zero where it is no ear: turned over, or with another corner inside.
    """
    a, b, c = left[k - 1 if k > 0 else n - 1], left[k], left[(k + 1) % n]
    worth = _towards(r, a, b, c, normal)
    if n == 4:
        return min(worth, _towards(r, c, left[(k + 2) % n], a, normal))
    for j in range(n - 3):
        i = left[(k + 2 + j) % n]
        if (
            _towards(r, a, b, i, normal) >= 0
            and _towards(r, b, c, i, normal) >= 0
            and _towards(r, c, a, i, normal) >= 0
        ):
            return min(worth, -1.0)
    return worth


@nested
def _towards(r, i, j, k, normal):  # type: ignore[no-untyped-def]
    """Quality of a triangle, times the cosine of its angle with `normal`."""
    x, y, z, squares = _triangle(r, i, j, k)
    length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if not (length > 0.0 and squares > 0.0):
        return 0.0
    inner = (x * normal[0] + y * normal[1] + z * normal[2]) / length
    return 2.0 * np.sqrt(3.0) * inner / squares


@nested
def _triangle(r, i, j, k):  # type: ignore[no-untyped-def]
    """Twice the area vector of a triangle, and the sum of its squared edges."""
    ux, uy, uz = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
    vx, vy, vz = r[k, 0] - r[i, 0], r[k, 1] - r[i, 1], r[k, 2] - r[i, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    squares = 2.0 * (uu + vv - (ux * vx + uy * vy + uz * vz))
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx, squares
