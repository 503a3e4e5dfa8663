"""A recipe as a run in a folder, and as lines of Python that make the same run."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from shutil import which
from typing import Any

from amoeboid.explorer.recipe import ELONGATED, NOISE, STRETCH, SURFACE, Recipe
from amoeboid.exports.export import export
from amoeboid.extras import installed
from amoeboid.runs.solution import Solution, simulate
from amoeboid.runs.stored import load
from amoeboid.validation import InvalidInput

MAX_PICTURES = 240
"""Of a movie; of a longer run every second frame is shown, or every third, and so on."""


def new_folder(base: Path) -> Path:
    """A new, empty folder, which no one else gets: explored-1, explored-2 and so on.

    Raises InvalidInput.
    """
    for k in count(1):
        path = base / f"explored-{k}"
        try:
            path.mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise InvalidInput(f"runs must be saved in a folder that takes them: {error}") from None
        return path
    raise AssertionError


def made_again(
    recipe: Recipe,
    end: float,
    folder: Path | None = None,
    progress: Callable[[Any], None] | None = None,
) -> Solution:
    """The run of a recipe until the time `end` [T], in a new folder if one is given.

    Raises InvalidInput.
    """
    report = False if progress is None else progress
    return simulate(recipe.config(end), mesh=recipe.shape(), folder=folder, progress=report)


def movie_of(folder: Path) -> Path:
    """A movie of a run in a folder, beside it: mp4 where there is an encoder, else gif.

    Raises InvalidInput, OSError.
    """
    encoder = installed("imageio_ffmpeg") or which("ffmpeg") is not None
    run, kind = load(folder), "mp4" if encoder else "gif"
    every = 1 + len(run.frames) // MAX_PICTURES
    (path,) = export(
        run, folder.with_name(f"{folder.name}.{kind}"), frames=slice(None, None, every)
    )
    return path


def python_lines(recipe: Recipe, end: float) -> str:
    """Python that makes the run of a recipe until the time `end`."""
    p, config = recipe.parameters, recipe.config(end)
    lines = ["import amoeboid as am", "", f"p = am.{p!r}"]
    mesh = f"am.Icosphere({recipe.subdivisions})"
    if recipe.start == ELONGATED:
        lines += [
            f"sphere = am.start(am.Config(mesh=am.Mesh(subdivisions={recipe.subdivisions}))).cell",
        ]
        mesh = f"am.Surface(sphere.r * [1.0, 1.0, {STRETCH}], sphere.faces)"
    initial = [f"perturbation={config.initial.perturbation!r}"]
    if recipe.start == NOISE:
        initial += [f"noise={config.initial.noise!r}", f"seed={recipe.seed}"]
    if recipe.start == SURFACE:
        initial += [f"surface={Path(str(recipe.surface)).name!r}", "repair=True"]
    time = f"end={config.time.end!r}, max_step={config.time.max_step!r}, stop_when_steady=False"
    lines += [
        "solution = am.simulate(",
        "    p,",
        f"    mesh={mesh},",
        f"    initial=am.Initial({', '.join(initial)}),",
        f"    time=am.Time({time}),",
        f"    until=am.when({config.time.until[0]!r}),",
    ]
    if recipe.jumps:
        lines += ["    changes={"]
        for name, points in recipe.jumps.items():
            shown = ", ".join(repr(point) for point in points)
            lines += [f"        {name!r}: am.steps({shown}),"]
        lines += ["    },"]
    if recipe.pokes:
        lines += ["    cue=am.Cue(", "        pokes=["]
        lines += [f"            {poke!r}," for poke in recipe.pokes]
        lines += ["        ],", "    ),"]
    return "\n".join([*lines, ")", "print(solution)", 'solution.save("seen-in-the-explorer")', ""])
