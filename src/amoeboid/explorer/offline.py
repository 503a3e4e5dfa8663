"""The page in one file: branches and states that are computed now, and no server."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.explorer.answers import Answer, Answers
from amoeboid.explorer.files import offline_page
from amoeboid.explorer.point import PHYSICAL, SIMULATION
from amoeboid.explorer.presets import shown, shown_values
from amoeboid.model.parameters import Parameters
from amoeboid.output.atomic import write_atomically
from amoeboid.studies.theory import theories
from amoeboid.validation import InvalidInput

NAME = "D"
FACTORS = (0.1, 0.4, 1.0, 2.0)
"""The branches are those at these multiples of D."""

SPEEDS = 13
"""Values of v_p0 whose states are shown, besides that of the point itself."""

POINTS = 31


def write_page(p: Parameters, path: Path, watch: Watch = unwatched) -> int:
    """Write the page about a parameter point; returns its size [bytes].

    Raises InvalidInput where no branch can be followed.
    """
    page = offline_page(precomputed(p, watch))

    def write(temporary: Path) -> None:
        temporary.write_bytes(page)

    write_atomically(path, write)
    return len(page)


def precomputed(p: Parameters, watch: Watch = unwatched) -> dict[str, Any]:
    """What the page shows: branches in v_p0 at several D, and the states along them."""
    if p.D <= 0:
        raise InvalidInput(f"D must be > 0 for a page with several of them, got {p.D:g}")
    answers = Answers(points=POINTS)
    values = [p.D if factor == 1.0 else float(f"{factor * p.D:.3g}") for factor in FACTORS]
    branches: list[dict[str, Any]] = []
    for value in values:
        q = p.replace(D=value)
        first = {answer["kind"]: answer for answer in answers.of(q, "v_p0", watch)}
        branch = first["branch"]
        if not branch["curves"]:
            raise InvalidInput(
                f"a page needs a branch, at D = {value:g} there is none: {branch['problems'][0]}"
            )
        speeds = np.unique([*np.linspace(0.0, answers.window[1], SPEEDS), p.v_p0])
        answers.know(theories(q, [float(v) for v in speeds]))
        points = []
        for k, v_p0 in enumerate(speeds, start=1):
            watch(Progress(f"states of the page, D = {value:g}", "v_p0", float(v_p0), 0, k))
            points.append(_point(answers, q.replace(v_p0=float(v_p0)), watch))
        branches.append(
            {
                "value": shown(p, value, p.dimension(NAME)),
                "speeds": [shown(p, float(v), "L/T") for v in speeds],
                "branch": branch,
                "points": points,
            }
        )
    units = SIMULATION if p.units is None else PHYSICAL
    at = int(np.argmin([abs(value - p.D) for value in values]))
    nearest = min(branches[at]["speeds"], key=lambda v: abs(v - shown(p, p.v_p0, "L/T")))
    here = shown_values(p) | {NAME: branches[at]["value"], "v_p0": nearest}
    preset = {
        "name": "file",
        "title": p.description,
        "note": "Computed when this page was written; it asks no host.",
        "units": units,
        "values": here,
    }
    return {
        "name": NAME,
        "branches": branches,
        "preset": preset,
        "presets": [preset],
        "values": {NAME: [b["value"] for b in branches], "v_p0": branches[at]["speeds"]},
    }


def _point(answers: Answers, p: Parameters, watch: Watch) -> dict[str, Answer]:
    found = {answer["kind"]: answer for answer in answers.of(p, "v_p0", watch)}
    return {"theory": found["theory"], "states": found["states"]}
