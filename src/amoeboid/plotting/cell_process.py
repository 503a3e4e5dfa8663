"""Draws one cell with VTK; a program of its own, see `cell`.

Argument: the PNG file to write. Standard input: an .npz archive, `r` (V, 3) about the centroid,
`faces` (F, 3), `c` (V,), `normals` (V, 3), `flow` (V, 3) the retrograde flow, `polarization` (3,),
and the numbers `R0`, `c0`, `t`, `fastest` (of the flow) and `moving` (whether that is a motion).
"""

from __future__ import annotations

import io
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.plotting.palette import COLOR_MAP, INK, ORANGE

Scene = dict[str, NDArray[Any]]

ARROWS = 170
WINDOW = (1500, 1100)
ARROW = 0.34  # length of the arrow of the fastest flow in units of R0
FONT_SIZE = 26
DISTANCE = 6.01  # of the viewer, in units of the size of the cell


def main(path: str) -> None:
    """Read the scene, write the picture."""
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as archive:
        draw(path, dict(archive))


def draw(path: str, scene: Scene) -> None:
    """Write the picture of a scene."""
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkLogger

    # without a screen VTK falls back to off-screen rendering, and would warn of that every time
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    plotter = pv.Plotter(off_screen=True, window_size=list(WINDOW))
    try:
        plotter.set_background("white")
        _add_cell(plotter, scene)
        plotter.screenshot(path, return_img=False)
    finally:
        plotter.close()


def _add_cell(plotter: Any, scene: Scene) -> None:
    import pyvista as pv

    R0, moving = float(scene["R0"]), bool(scene["moving"])
    x = scene["r"]
    rear, side = _view_axes(scene["polarization"])
    surface = pv.PolyData.from_regular_faces(x, scene["faces"])
    surface.point_data["c"] = scene["c"]
    bar: dict[str, Any] = {
        "title": "filament concentration c [N/L^2]\n",  # with room below
        "color": INK,
        "fmt": "%.4g",
        "vertical": False,
        "position_x": 0.2,
        "position_y": 0.04,
        "width": 0.6,
        "title_font_size": 30,
        "label_font_size": 26,
    }
    limits = _color_limits(scene["c"], float(scene["c0"]))
    plotter.add_mesh(
        surface,
        scalars="c",
        cmap=COLOR_MAP,
        clim=limits,
        smooth_shading=True,
        ambient=0.8,
        diffuse=0.25,
        specular=0.0,
        scalar_bar_args=bar,
    )

    fastest = float(scene["fastest"])
    if moving:
        chosen = spread_out(x, ARROWS)
        points = pv.PolyData((x + 0.02 * R0 * scene["normals"])[chosen])
        points["flow"] = scene["flow"][chosen]
        arrows = points.glyph(
            orient="flow",
            scale="flow",
            factor=ARROW * R0 / fastest,
            geom=pv.Arrow(shaft_radius=0.04),
        )
        plotter.add_mesh(arrows, color=INK)
        start = (np.min(x @ rear) - 0.12 * R0) * rear
        front = pv.Arrow(
            start=start, direction=-rear, scale=0.55 * R0, tip_length=0.32, shaft_radius=0.035
        )
        plotter.add_mesh(front, color=ORANGE)
        _label(
            plotter, start - 0.28 * R0 * rear + 0.16 * R0 * np.cross(side, rear), "front", ORANGE
        )
    size = max(R0, float(np.linalg.norm(x, axis=1).max()))
    _add_scale(plotter, rear, side, size, R0, fastest if moving else None)
    time = f"t = {float(scene['t']):.4g} [T]"
    plotter.add_text(
        time, position=(0.03, 0.93), font_size=FONT_SIZE // 2, color=INK, viewport=True
    )
    _aim(plotter, rear, side, size, 0.3 if moving else 0.0)


def _add_scale(
    plotter: Any, rear: Array, side: Array, size: float, R0: float, fastest: float | None
) -> None:
    """A scale bar at the upper right, and an arrow as long as that of the fastest flow."""
    import pyvista as pv

    above, sight = np.cross(side, rear), _sight(rear, side)
    right = np.cross(above, sight)
    right /= np.linalg.norm(right)
    up = np.cross(sight, right)
    # both face the viewer, as far away as the center of the cell
    length = _round_length(0.6 * R0)
    end = size * (1.45 * right + 1.0 * up)
    bar = pv.Line(end - length * right, end).tube(radius=0.015 * R0)
    plotter.add_mesh(bar, color=INK, ambient=1.0, diffuse=0.0)
    _label(plotter, end - 0.5 * length * right - 0.14 * size * up, f"{length:g} [L]", INK)
    if fastest is not None:
        begin = size * (-1.5 * right - 0.65 * up)
        arrow = pv.Arrow(
            start=begin, direction=right, scale=ARROW * R0, shaft_radius=0.04, tip_length=0.25
        )
        plotter.add_mesh(arrow, color=INK)
        place = begin + 0.5 * ARROW * R0 * right - 0.16 * size * up
        _label(plotter, place, f"retrograde flow {fastest:.3g} [L/T]", INK)


def _round_length(longest: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is no longer."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(k for k in (1.0, 2.0, 5.0) if k * power <= longest) * power)


def _sight(rear: Array, side: Array) -> Array:
    """Unit vector towards the viewer, who looks a little from above and from behind."""
    sight = side + 0.25 * np.cross(side, rear) + 0.3 * rear
    return np.asarray(sight / np.linalg.norm(sight))


def _label(plotter: Any, place: Array, text: str, color: str) -> None:
    plotter.add_point_labels(
        [place],
        [text],
        text_color=color,
        font_size=FONT_SIZE,
        shape=None,
        show_points=False,
        always_visible=True,
        justification_horizontal="center",
    )


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


def _aim(plotter: Any, rear: Array, side: Array, size: float, lead: float) -> None:
    focus = -lead * size * rear
    above = np.cross(side, rear)
    eye = focus + DISTANCE * size * _sight(rear, side)
    plotter.camera_position = [tuple(eye), tuple(focus - 0.14 * size * above), tuple(above)]
    plotter.camera.view_angle = 26.0
    plotter.enable_parallel_projection()


if __name__ == "__main__":
    main(*sys.argv[1:])
