"""A cell, or the frames of a run, as a page of HTML that turns it.

It needs neither a network nor other files.

The page is `page.html`, with the names in double braces replaced.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.extras import needed
from amoeboid.plotting.palette import COLOR_MAP, ORANGE

COLORS = 64
DIGITS = 4  # of positions and arrows [decimals of R0], and of concentrations [significant]


@dataclass(frozen=True, kw_only=True)
class Moment:
    """A cell at a time, about its center with lengths in R0.

    `nodes` (V, 3), `faces` (F, 3), `c` (V,), `arrows` (V, 3) [R0], drawn at the nodes where
    `chosen` (V,); `words` say when it is.
    """

    nodes: Array
    faces: Array
    c: Array
    arrows: Array
    chosen: Array
    words: str = ""


@dataclass(frozen=True, kw_only=True)
class Scene(Moment):
    """What the page shows: a cell with its rear at +z, and all that does not change in time.

    The half x > 0 is the one shown transparent. `label` says what c is, `limits` are the ends of
    its colors. `view` (3, 3): rows right, up and towards the reader. `moves`: whether the
    direction of migration, -z, is shown. `about` is what a reader who does not see the cell needs,
    `values` a table beside it.
    """

    title: str
    about: str
    label: str
    values: Mapping[str, str]
    limits: tuple[float, float]
    view: Array
    moves: bool


def page(scene: Scene, later: Iterable[Moment] = ()) -> str:
    """The page as text; with later times of the cell it has a bar to choose among them."""
    needed("matplotlib", "a page with a cell needs")
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    colors = [to_hex(color) for color in colormaps[COLOR_MAP](np.linspace(0.0, 1.0, COLORS))]
    low, high = scene.limits
    data = {
        **moment(scene),
        "low": low,
        "high": high,
        "colors": colors,
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
        "data": f'{written(data)[:-1]},"later":[{",".join(_changes(scene, later))}]}}',
    }
    text = (files("amoeboid.figures") / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: words[found.group(1)], text)


def moment(one: Moment) -> dict[str, Any]:
    """Numbers of a cell as the page reads them."""
    chosen = np.flatnonzero(one.chosen)
    return {
        "nodes": np.round(one.nodes, DIGITS).tolist(),
        "faces": np.asarray(one.faces, dtype=int).tolist(),
        "c": [float(f"{c:.{DIGITS}g}") for c in one.c],
        "arrows": [[int(k), *np.round(one.arrows[k], DIGITS).tolist()] for k in chosen],
        "words": one.words,
    }


def written(data: dict[str, Any]) -> str:
    """JSON that ends no element of HTML."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def _changes(first: Moment, later: Iterable[Moment]) -> Iterator[str]:
    """Each later cell; its triangles only where they are not those of the one before it."""
    faces = first.faces
    for one in later:
        data = moment(one)
        if np.array_equal(one.faces, faces):
            del data["faces"]
        faces = one.faces
        yield written(data)
