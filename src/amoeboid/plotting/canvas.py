"""Solids in parallel projection, lines and words on a picture, drawn by Pillow from back to front.

Pillow takes a tenth of the time that matplotlib or VTK need to start, and no graphics library.
"""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.arrays import Array, Index, axis_across, cross
from amoeboid.extras import needed
from amoeboid.plotting.palette import INK

PICTURE = "a picture of a cell needs"
SMOOTHING = 2  # pixels drawn for one of the picture, in both directions
FACET = 24.0  # pixels drawn: edges of the pieces, each of one color, that a triangle is cut into
MAX_CUTS = 64
MAX_CHANGE = 4.0  # of 255: pieces are not smaller than their colors need to differ by this
# The anchors of YlGnBu by C. Brewer, as in `palette.COLOR_MAP`; between them it is linear.
ANCHORS = (
    "#ffffd9", "#edf8b1", "#c7e9b4", "#7fcdbb", "#41b6c4", "#1d91c0", "#225ea8", "#253494",
    "#081d58",
)  # fmt: skip
AMBIENT, DIFFUSE = 0.8, 0.25  # of the light, which comes from the viewer
ROUND = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
# In which outlines are sought: of round things they are right to 1 in 200 of the radius.
_ANGLES = np.linspace(0.0, 2 * np.pi, 32, endpoint=False)
DIRECTIONS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


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
        light = AMBIENT + DIFFUSE * np.clip(normals @ self._sight, 0.0, 1.0)
        shades = colors(values) * light[:, None]
        change = np.ptp(shades[seen], axis=1).max(axis=1)
        cuts = np.ceil(np.minimum(size / FACET, change / MAX_CHANGE))
        cuts = np.clip(cuts, 1, MAX_CUTS).astype(int)
        place, depth = self.place(r), r @ self._sight
        for count in np.unique(cuts):
            corners, middles = _pieces(count)
            cut = seen[cuts == count]
            polygons = np.einsum("pka,fad->fpkd", corners, place[cut]).reshape(-1, 6)
            fills = colors(values[cut] @ middles.T) * (light[cut] @ middles.T)[..., None]
            fills = np.clip(np.rint(fills), 0, 255).astype(int).reshape(-1, 3).tolist()
            depths = (depth[cut] @ middles.T).ravel().tolist()
            self._solids += zip(depths, polygons.tolist(), map(tuple, fills), strict=True)

    def arrows(
        self, starts: Array, along: Array, color: str, head: float = 0.35, width: float = 0.04
    ) -> None:
        """Arrows from `starts` (n, 3), `along` (n, 3) long; those of no length are left out.

        Each a rod, and a cone of the share `head` of its length, 2.5 times as wide.
        """
        lengths = np.linalg.norm(along, axis=1)
        starts, along, lengths = (values[lengths > 0.0] for values in (starts, along, lengths))
        tangent = along / lengths[:, None]
        across = cross(tangent, axis_across(tangent))
        across /= np.linalg.norm(across, axis=1)[:, None]
        other = cross(tangent, across)
        circle = np.cos(ROUND)[:, None] * across[:, None] + np.sin(ROUND)[:, None] * other[:, None]
        rod = width * lengths[:, None, None] * circle
        start, neck, tip = ((starts + share * along)[:, None] for share in (0.0, 1.0 - head, 1.0))
        self.solids(np.concatenate([start + rod, neck + rod], axis=1), color)
        self.solids(np.concatenate([neck + 2.5 * rod, tip], axis=1), color)

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
        self.solids(points[None], color)

    def solids(self, points: Array, color: Any) -> None:
        """The convex hulls of points (k, n, 3) each."""
        depths = (points @ self._sight).max(axis=1).tolist()
        for depth, outline in zip(depths, _outlines(self.place(points)), strict=True):
            self._solids.append((depth, outline.ravel().tolist(), color))

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

    def png(self) -> bytes:
        """The picture as a PNG file."""
        file = io.BytesIO()
        self.image().save(file, format="png", compress_level=1, compress_type=zlib.Z_RLE)
        return file.getvalue()

    def save(self, path: Path) -> None:
        """Write a PNG file."""
        path.write_bytes(self.png())

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


def _outlines(points: Array) -> Array:
    """Convex hulls (k, d, 2) of points (k, n, 2) in the plane: the farthest in each direction."""
    farthest = np.argmax(points @ DIRECTIONS.T, axis=1)
    return np.asarray(np.take_along_axis(points, farthest[..., None], axis=1))
