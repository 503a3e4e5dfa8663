"""A movie as GIF, without any further program."""

from __future__ import annotations

import io
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.movie import WINDOW, pictures
from amoeboid.plotting.canvas import AMBIENT, DIFFUSE, colors
from amoeboid.plotting.palette import INK

SHADES, LIGHTS, GRAYS = 44, 5, 36  # colors of the palette, 256 in all
TRAILER = b";"
MAX_FPS = 50.0  # browsers slow faster ones


@cache
def palette() -> Any:
    """An image of Pillow with the palette: colors of c in some lights, and grays."""
    from PIL import Image

    shades = colors(np.linspace(0.0, 1.0, SHADES))
    lights = AMBIENT + DIFFUSE * np.linspace(0.0, 1.0, LIGHTS)
    lit = np.clip(np.rint(lights[:, None, None] * shades), 0, 255).reshape(-1, 3)
    dark = int(INK[1:3], 16)
    grays = np.rint(np.linspace(dark, 255, GRAYS))[:, None].repeat(3, axis=1)
    found = Image.new("P", (1, 1))
    found.putpalette(np.concatenate([lit, grays]).astype(np.uint8).tobytes())
    return found


def write(job: Job, path: Path) -> None:
    """Write the frames one by one; each is an image with the palette of all."""
    delay = round(100.0 / job.fps)  # hundredths of a second
    with path.open("wb") as file:
        for count, canvas in enumerate(pictures(job, "gif")):
            head, block = _encoded(canvas.image())
            if count == 0:
                file.write(b"GIF89a" + head[6:])
                file.write(b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # forever
            file.write(b"!\xf9\x04\x04" + delay.to_bytes(2, "little") + b"\x00\x00")
            file.write(block)
        file.write(TRAILER)


def _encoded(image: Any) -> tuple[bytes, bytes]:
    """What a file of one picture begins with, palette included, and the block of its image."""
    from PIL import Image

    single = io.BytesIO()
    reduced = image.quantize(palette=palette(), dither=Image.Dither.NONE)
    reduced.save(single, format="gif", optimize=False)
    data = single.getvalue()
    begin = 13 + 3 * 2 ** ((data[10] & 7) + 1)  # behind the description of the screen, and palette
    place = begin
    while data[place : place + 1] == b"!":  # extensions: a label, then blocks behind their sizes
        place += 2
        while data[place]:
            place += 1 + data[place]
        place += 1
    return data[:begin], data[place:-1]


def files(job: Job) -> Mapping[str, Write]:
    """One movie."""
    return {f"{job.name}.gif": lambda path: write(job, path)}


FORMAT = Format(
    f"a movie of {WINDOW[0]} x {WINDOW[1]} pixels with time, scale bar and colors", ".gif", files,
    frozenset({"follow", "fps"}), ("PIL",), max_fps=MAX_FPS,
)  # fmt: skip
