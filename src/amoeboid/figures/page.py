"""A cell as a page of HTML that turns it, and needs neither a network nor other files.

The page is `page.html`, with the names in double braces replaced.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import numpy as np

from amoeboid.arrays import Array
from amoeboid.plotting.palette import COLOR_MAP, ORANGE

COLORS = 64
DIGITS = 4  # of positions and arrows [decimals of R0], and of concentrations [significant]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What the page shows: a cell about its center with lengths in R0, its rear at +z.

    `nodes` (V, 3), `faces` (F, 3), `c` (V,) as `label` says, `arrows` (V, 3) [R0], drawn at the
    nodes where `chosen` (V,); the half x > 0 is the one shown transparent. `view` (3, 3): rows
    right, up and towards the reader. `moves`: whether the direction of migration, -z, is shown.
    `about` is what a reader who does not see the cell needs, `values` a table beside it.
    """

    title: str
    about: str
    label: str
    values: Mapping[str, str]
    nodes: Array
    faces: Array
    c: Array
    limits: tuple[float, float]
    arrows: Array
    chosen: Array
    view: Array
    moves: bool


def page(scene: Scene) -> str:
    """The page as text."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    colors = [to_hex(color) for color in colormaps[COLOR_MAP](np.linspace(0.0, 1.0, COLORS))]
    chosen = np.flatnonzero(scene.chosen)
    low, high = scene.limits
    data = {
        "nodes": np.round(scene.nodes, DIGITS).tolist(),
        "faces": np.asarray(scene.faces, dtype=int).tolist(),
        "c": [float(f"{c:.{DIGITS}g}") for c in scene.c],
        "low": low,
        "high": high,
        "colors": colors,
        "arrows": [[int(k), *np.round(scene.arrows[k], DIGITS).tolist()] for k in chosen],
        "view": scene.view.tolist(),
        "moves": bool(scene.moves),
        "front": ORANGE,
    }
    rows = "".join(
        f"<tr><th scope=row>{escape(name)}</th><td>{escape(value)}</td></tr>"
        for name, value in scene.values.items()
    )
    words = {
        "title": escape(scene.title),
        "about": escape(scene.about),
        "label": escape(scene.label),
        "low": f"{low:.4g}",
        "high": f"{high:.4g}",
        "rows": rows,
        "data": json.dumps(data, separators=(",", ":")),  # numbers and colors, no words
    }
    text = (files("amoeboid.figures") / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: words[found.group(1)], text)
