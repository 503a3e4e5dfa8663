"""The picture of one cell, drawn from its scene.

A scene holds arrays: `r` (V, 3) about the centroid, `faces` (F, 3), `c` (V,), `normals` (V, 3),
`flow` (V, 3) the retrograde flow, `polarization` (3,), the numbers `R0`, `c0`, `t`, `fastest` (of
the flow) and `moving` (whether that is a motion), and the texts `units` (4,) of length, time,
concentration and speed, dimensions in brackets.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array, axis_across
from amoeboid.plotting.canvas import Canvas, round_length
from amoeboid.plotting.palette import INK, ORANGE

Scene = dict[str, NDArray[Any]]

ARROWS = 170
WINDOW = (1500, 1100)
ARROW = 0.34  # length of the arrow of the fastest flow in units of R0
FONT_SIZE = 25  # pixels of a picture of WINDOW[0] pixels
HEIGHT = 1.352  # from the middle of the picture to its edge, in units of the size of the cell


@dataclass(frozen=True, eq=False)
class View:
    """From where pictures are seen, and their scales; several may share it.

    `axes`: right, up and towards the viewer; `middle` (3,) of the picture; `size`: the length that
    `HEIGHT` of it fills from there to the upper edge; `limits`: lowest and highest concentration of
    the colors; `fastest`: the flow whose arrow has the length ARROW R0; `window`: pixels; `about`
    (3,): what the scales are placed about.
    """

    axes: tuple[Array, Array, Array]
    middle: Array
    size: float
    limits: tuple[float, float]
    fastest: float
    window: tuple[int, int] = WINDOW
    about: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def font(self) -> float:
        """Size of the font [pixels]."""
        return FONT_SIZE * self.window[0] / WINDOW[0]


def drawn(scene: Scene) -> Canvas:
    """The picture of a scene, seen from its side, with the arrow of migration."""
    R0, moving = float(scene["R0"]), bool(scene["moving"])
    rear, side = view_axes(scene["polarization"])
    above, axes = np.cross(side, rear), seen_along(rear, side)
    size = max(R0, float(np.linalg.norm(scene["r"], axis=1).max()))
    middle = size * ((-0.3 if moving else 0.0) * rear - 0.14 * above)
    limits = color_limits(float(scene["c"].min()), float(scene["c"].max()), float(scene["c0"]))
    view = View(axes, middle, size, limits, float(scene["fastest"]))
    canvas = picture(scene, view)
    if moving:
        start = (np.min(scene["r"] @ rear) - 0.12 * R0) * rear
        canvas.arrows(start[None], -0.55 * R0 * rear[None], ORANGE, head=0.32, width=0.035)
        _label(canvas, view, start - 0.28 * R0 * rear + 0.16 * R0 * above, "front", ORANGE)
    add_scales(canvas, scene, view)
    return canvas


def picture(scene: Scene, view: View) -> Canvas:
    """The cell of a scene and the arrows of its flow, nothing else."""
    R0, r = float(scene["R0"]), scene["r"]
    canvas = Canvas(*view.window, view.axes, view.middle, HEIGHT * view.size)
    low, high = view.limits
    canvas.surface(r, scene["normals"], scene["faces"], (scene["c"] - low) / (high - low))
    if scene["moving"]:
        longest = ARROW * R0 / view.fastest
        k = spread_out(r, ARROWS)
        canvas.arrows(r[k] + 0.02 * R0 * scene["normals"][k], longest * scene["flow"][k], INK)
    return canvas


def add_scales(canvas: Canvas, scene: Scene, view: View) -> None:
    """What a picture is measured by: a bar of length, the longest arrow, the time, the colors."""
    length, time, concentration, speed = (str(unit) for unit in scene["units"])
    words = f"t = {float(scene['t']):.4g} {time}"
    canvas.text(canvas.share(0.03, 0.06), words, INK, view.font, "lm")
    _add_scale(canvas, view, float(scene["R0"]), length, speed if scene["moving"] else None)
    canvas.color_bar(
        *view.limits, f"filament concentration c [{concentration.strip('[]')}]", view.font
    )


def _add_scale(canvas: Canvas, view: View, R0: float, unit: str, speed: str | None) -> None:
    """A scale bar at the upper right; at the lower left an arrow as long as the fastest flow."""
    right, up, _ = view.axes
    size, about = view.size, view.about
    length = round_length(0.6 * size)
    end = about + size * (1.45 * right + 1.0 * up)
    half = 0.015 * size * up
    corners = [end - half, end + half, end - length * right - half, end - length * right + half]
    canvas.solid(np.array(corners), INK)
    place = end - 0.5 * length * right - 0.14 * size * up
    _label(canvas, view, place, f"{length:g} {unit}", INK)
    if speed is not None:
        canvas.arrows(_at(view, 0.03, 0.815)[None], ARROW * R0 * right[None], INK)
        words = f"retrograde flow {view.fastest:.3g} {speed}"
        canvas.text(canvas.share(0.03, 0.868), words, INK, view.font, "lm")


def _at(view: View, across: float, down: float) -> Array:
    """The point (3,) that is seen at these shares of the picture, see `Canvas.share`."""
    right, up, _ = view.axes
    wide = view.window[0] / view.window[1]
    seen = (2.0 * across - 1.0) * wide * right + (1.0 - 2.0 * down) * up
    return np.asarray(view.middle + HEIGHT * view.size * seen)


def seen_along(rear: Array, side: Array) -> tuple[Array, Array, Array]:
    """The axes of a view: the viewer looks from the side, a little from above and from behind."""
    above = np.cross(side, rear)
    sight = side + 0.25 * above + 0.3 * rear
    sight /= np.linalg.norm(sight)
    right = np.cross(above, sight)
    right /= np.linalg.norm(right)
    return right, np.cross(sight, right), sight


def _label(canvas: Canvas, view: View, place: Array, text: str, color: str) -> None:
    canvas.text(canvas.place(place), text, color, view.font)


def color_limits(low: float, high: float, c0: float) -> tuple[float, float]:
    """From lowest to highest c; a homogeneous cell gets a range that shows no noise."""
    least = 0.05 * max(c0, abs(high))
    if high - low < least:
        middle = 0.5 * (low + high)
        return middle - 0.5 * least, middle + 0.5 * least
    return low, high


def view_axes(vector: Array) -> tuple[Array, Array]:
    """Unit vectors to the rear, and to the viewer, who looks a little from above the side."""
    size = np.linalg.norm(vector)
    rear = vector / size if size > 1e-3 else np.array([0.0, 0.0, 1.0])
    side = np.cross(rear, axis_across(rear))
    return rear, side / np.linalg.norm(side)


def spread_out(r: Array, count: int) -> NDArray[np.int64]:
    """Indices of about `count` nodes evenly spread: farthest-point sampling."""
    chosen = [0]
    distance = np.linalg.norm(r - r[0], axis=1)
    for _ in range(min(count, len(r)) - 1):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(r - r[chosen[-1]], axis=1))
    return np.array(chosen)
