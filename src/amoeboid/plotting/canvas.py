"""Solids in parallel projection, lines and words on a picture, drawn by Pillow from back to front.

Pillow takes a tenth of the time that matplotlib or VTK need to start, and no graphics library.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.arrays import Array, Index, cross
from amoeboid.extras import needed
from amoeboid.plotting.palette import INK

PICTURE = "a picture of a cell needs"
SMOOTHING = 2  # pixels drawn for one of the picture, in both directions
FACET = 24.0  # pixels drawn: edges of the pieces, each of one color, that a triangle is cut into
MAX_CUTS = 64
# The anchors of YlGnBu by C. Brewer, as in `palette.COLOR_MAP`; between them it is linear.
ANCHORS = (
    "#ffffd9", "#edf8b1", "#c7e9b4", "#7fcdbb", "#41b6c4", "#1d91c0", "#225ea8", "#253494",
    "#081d58",
)  # fmt: skip
AMBIENT, DIFFUSE = 0.8, 0.25  # of the light, which comes from the viewer
ROUND = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)


def colors(values: Array) -> Array:
    """Colors (..., 3) from 0 to 255 of values from 0 to 1."""
    table = np.array([[int(a[k : k + 2], 16) for k in (1, 3, 5)] for a in ANCHORS], dtype=float)
    places = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(values, places, table[:, k]) for k in range(3)], axis=-1)


def shade(value: float) -> tuple[int, ...]:
    """The color of one value from 0 to 1, as Pillow takes it."""
    return tuple(np.rint(colors(np.array(value))).astype(int).tolist())


def round_length(longest: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is no longer."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(k for k in (1.0, 2.0, 5.0) if k * power <= longest) * power)


class Canvas:
    """A white picture of width x height pixels, seen along -`sight`, `right` to the right.

    `middle` is the point in its middle, `scale` the length from there to its upper edge.
    """

    def __init__(
        self, width: int, height: int, axes: tuple[Array, Array, Array], middle: Array, scale: float
    ) -> None:
        self._size = (width * SMOOTHING, height * SMOOTHING)
        needed("PIL", PICTURE)
        from PIL import Image, ImageDraw

        self._image = Image.new("RGB", self._size, "white")
        self._draw = ImageDraw.Draw(self._image)
        self._right, self._up, self._sight = axes
        self._middle, self._pixels = middle, 0.5 * self._size[1] / scale
        self._solids: list[tuple[float, list[float], Any]] = []

    def place(self, points: Array) -> Array:
        """Where points (..., 3) lie on the picture (..., 2), in pixels that are drawn."""
        about = points - self._middle
        x = 0.5 * self._size[0] + self._pixels * (about @ self._right)
        y = 0.5 * self._size[1] - self._pixels * (about @ self._up)
        return np.stack([x, y], axis=-1)

    def surface(self, r: Array, normals: Array, faces: Index, values: Array) -> None:
        """Triangles with values from 0 to 1 at their nodes (V,), lit by unit normals (V, 3)."""
        edges = r[faces[:, [1, 2]]] - r[faces[:, :1]]
        seen = faces[cross(edges[:, 0], edges[:, 1]) @ self._sight > 0.0]
        size = self._pixels * np.sqrt(np.mean(np.sum(edges**2, axis=2)))
        cuts = int(np.clip(np.ceil(size / FACET), 1, MAX_CUTS))
        corners, middles = _pieces(cuts)
        place, depth = self.place(r)[seen], (r @ self._sight)[seen]
        light = AMBIENT + DIFFUSE * np.clip(normals @ self._sight, 0.0, 1.0)
        polygons = np.einsum("pka,fad->fpkd", corners, place).reshape(-1, 6)
        shades = colors((values[seen] @ middles.T).ravel()) * (light[seen] @ middles.T).reshape(
            -1, 1
        )
        fills = np.clip(np.rint(shades), 0, 255).astype(int).tolist()
        depths = (depth @ middles.T).ravel().tolist()
        self._solids += zip(depths, polygons.tolist(), map(tuple, fills), strict=True)

    def arrow(
        self, start: Array, along: Array, color: str, head: float = 0.35, width: float = 0.04
    ) -> None:
        """An arrow: a rod, and a cone of the share `head` of its length, 2.5 times as wide."""
        length = float(np.linalg.norm(along))
        if length == 0.0:
            return
        across = cross(along / length, np.eye(3)[np.argmin(np.abs(along))])
        across /= np.linalg.norm(across)
        other = cross(along / length, across)
        circle = np.cos(ROUND)[:, None] * across + np.sin(ROUND)[:, None] * other
        neck, tip = start + (1.0 - head) * along, start + along
        rod = width * length * circle
        self.solid(np.concatenate([start + rod, neck + rod]), color)
        self.solid(np.concatenate([neck + 2.5 * rod, tip[None]]), color)

    def line(self, start: Array, end: Array, width: float, color: str) -> None:
        """A line of a width, across the view."""
        along = end - start
        across = cross(self._sight, along)
        length = float(np.linalg.norm(across))
        if length > 0.0:
            half = (0.5 * width / length) * across
            self.solid(np.array([start - half, start + half, end - half, end + half]), color)

    def solid(self, points: Array, color: Any) -> None:
        """The convex hull of points (n, 3), in front of what its nearest point is in front of."""
        depth = float((points @ self._sight).max())
        self._solids.append((depth, _hull(self.place(points)).ravel().tolist(), color))

    def text(self, place: Array, words: str, color: str, size: float, anchor: str = "mm") -> None:
        """Words at a place of the picture (2,), in pixels that are drawn."""
        from PIL import ImageFont

        font = ImageFont.load_default(size * SMOOTHING)
        self._flush()
        self._draw.text((float(place[0]), float(place[1])), words, color, font, anchor)

    def bar(self, left: float, top: float, right: float, bottom: float) -> None:
        """The colors from the lowest to the highest value; edges in shares of the picture."""
        begin, end = round(left * self._size[0]), round(right * self._size[0])
        low, high = round(top * self._size[1]), round(bottom * self._size[1])
        strip = colors(np.linspace(0.0, 1.0, end - begin))
        block = np.repeat(np.rint(strip)[None].astype(np.uint8), high - low, axis=0)
        from PIL import Image

        self._image.paste(Image.fromarray(block), (begin, low))

    def color_bar(self, low: float, high: float, title: str, font_size: float) -> None:
        """The bar of colors along the lower edge, what it shows above and five numbers below."""
        self.bar(0.2, 0.9, 0.8, 0.93)
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            number = f"{low + share * (high - low):.4g}"
            self.text(self.share(0.2 + 0.6 * share, 0.958), number, INK, font_size)
        self.text(self.share(0.5, 0.868), title, INK, 1.15 * font_size)

    def share(self, x: float, y: float) -> Array:
        """The place at shares of the width from the left and of the height from the top."""
        return np.array([x * self._size[0], y * self._size[1]])

    def image(self) -> Any:
        """The picture, an image of Pillow."""
        self._flush()
        return self._image.reduce(SMOOTHING)

    def save(self, path: Path) -> None:
        """Write a PNG file."""
        self.image().save(path, format="png", compress_level=4)

    def _flush(self) -> None:
        for _, polygon, color in sorted(self._solids, key=lambda solid: solid[0]):
            self._draw.polygon(polygon, color)
        self._solids = []


def _pieces(cuts: int) -> tuple[Array, Array]:
    """Corners (P, 3, 3) and middles (P, 3) of the cuts^2 pieces of a triangle, barycentric."""
    found = []
    for i in range(cuts):
        for j in range(cuts - i):
            found.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < cuts - 1:
                found.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    two = np.array(found, dtype=float) / cuts
    corners = np.concatenate([two, 1.0 - two.sum(axis=2, keepdims=True)], axis=2)
    return corners, corners.mean(axis=1)


def _hull(points: Array) -> Array:
    """The convex hull of points (n, 2) in the plane (A. M. Andrew, Inf. Process. Lett. 9, 1979)."""
    ordered = sorted(map(tuple, points.tolist()))

    def chain(sequence: Any) -> list[Any]:
        found: list[Any] = []
        for p in sequence:
            while len(found) > 1 and _turns_left(found[-2], found[-1], p) <= 0:
                found.pop()
            found.append(p)
        return found[:-1]

    return np.array(chain(ordered) + chain(reversed(ordered)) or ordered[:1])


def _turns_left(a: Any, b: Any, c: Any) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
