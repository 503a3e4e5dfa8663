"""Draws one cell; a program of its own, see `cell`.

Argument: the PNG file to write. Standard input: an .npz archive, `r` (V, 3) about the centroid,
`faces` (F, 3), `c` (V,), `normals` (V, 3), `flow` (V, 3) the retrograde flow, `polarization` (3,),
and the numbers `R0`, `c0`, `t`, `fastest` (of the flow) and `moving` (whether that is a motion).
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.plotting.canvas import Canvas, round_length
from amoeboid.plotting.palette import INK, ORANGE

Scene = dict[str, NDArray[Any]]

ARROWS = 170
WINDOW = (1500, 1100)
ARROW = 0.34  # length of the arrow of the fastest flow in units of R0
FONT_SIZE = 25
HEIGHT = 1.352  # from the middle of the picture to its edge, in units of the size of the cell


def main(path: str) -> None:
    """Read the scene, write the picture."""
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as archive:
        draw(path, dict(archive))


def draw(path: str, scene: Scene) -> None:
    """Write the picture of a scene."""
    R0, moving = float(scene["R0"]), bool(scene["moving"])
    r = scene["r"]
    rear, side = _view_axes(scene["polarization"])
    above, sight = np.cross(side, rear), _sight(rear, side)
    right = np.cross(above, sight)
    right /= np.linalg.norm(right)
    axes = right, np.cross(sight, right), sight
    size = max(R0, float(np.linalg.norm(r, axis=1).max()))
    middle = size * ((-0.3 if moving else 0.0) * rear - 0.14 * above)
    canvas = Canvas(*WINDOW, axes, middle, HEIGHT * size)
    low, high = _color_limits(scene["c"], float(scene["c0"]))
    canvas.surface(r, scene["normals"], scene["faces"], (scene["c"] - low) / (high - low))
    if moving:
        longest = ARROW * R0 / float(scene["fastest"])
        for k in spread_out(r, ARROWS):
            canvas.arrow(r[k] + 0.02 * R0 * scene["normals"][k], longest * scene["flow"][k], INK)
        start = (np.min(r @ rear) - 0.12 * R0) * rear
        canvas.arrow(start, -0.55 * R0 * rear, ORANGE, head=0.32, width=0.035)
        _label(canvas, start - 0.28 * R0 * rear + 0.16 * R0 * above, "front", ORANGE)
    _add_scale(canvas, axes, size, R0, float(scene["fastest"]) if moving else None)
    canvas.text(canvas.share(0.03, 0.06), f"t = {float(scene['t']):.4g} [T]", INK, FONT_SIZE, "lm")
    canvas.color_bar(low, high, "filament concentration c [N/L^2]", FONT_SIZE)
    canvas.save(Path(path))


def _add_scale(
    canvas: Canvas, axes: tuple[Array, Array, Array], size: float, R0: float, fastest: float | None
) -> None:
    """A scale bar at the upper right, and an arrow as long as that of the fastest flow."""
    right, up, _ = axes
    length = round_length(0.6 * R0)
    end = size * (1.45 * right + 1.0 * up)
    half = 0.015 * R0 * up
    corners = [end - half, end + half, end - length * right - half, end - length * right + half]
    canvas.solid(np.array(corners), INK)
    _label(canvas, end - 0.5 * length * right - 0.14 * size * up, f"{length:g} [L]", INK)
    if fastest is not None:
        begin = size * (-1.5 * right - 0.65 * up)
        canvas.arrow(begin, ARROW * R0 * right, INK)
        place = begin + 0.5 * ARROW * R0 * right - 0.16 * size * up
        _label(canvas, place, f"retrograde flow {fastest:.3g} [L/T]", INK)


def _sight(rear: Array, side: Array) -> Array:
    """Unit vector towards the viewer, who looks a little from above and from behind."""
    sight = side + 0.25 * np.cross(side, rear) + 0.3 * rear
    return np.asarray(sight / np.linalg.norm(sight))


def _label(canvas: Canvas, place: Array, text: str, color: str) -> None:
    canvas.text(canvas.place(place), text, color, FONT_SIZE)


def _color_limits(c: Array, c0: float) -> tuple[float, float]:
    """From lowest to highest c; a homogeneous cell gets a range that shows no noise."""
    low, high = float(c.min()), float(c.max())
    least = 0.05 * max(c0, abs(high))
    if high - low < least:
        middle = 0.5 * (low + high)
        return middle - 0.5 * least, middle + 0.5 * least
    return low, high


def _view_axes(vector: Array) -> tuple[Array, Array]:
    """Unit vectors to the rear, and to the viewer, who looks a little from above the side."""
    size = np.linalg.norm(vector)
    rear = vector / size if size > 1e-3 else np.array([0.0, 0.0, 1.0])
    helper = np.eye(3)[np.argmin(np.abs(rear))]
    side = np.cross(rear, helper)
    return rear, side / np.linalg.norm(side)


def spread_out(r: Array, count: int) -> NDArray[np.int64]:
    """Indices of about `count` nodes evenly spread: farthest-point sampling."""
    chosen = [0]
    distance = np.linalg.norm(r - r[0], axis=1)
    for _ in range(min(count, len(r)) - 1):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(r - r[chosen[-1]], axis=1))
    return np.array(chosen)


if __name__ == "__main__":
    main(*sys.argv[1:])
