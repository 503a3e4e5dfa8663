"""SI figure `fig_flow_chart_numerical_procedure`: the stages of a time step, from real steps.

Real steps of both schemes are watched: a stage is a function that a step calls, at the line that
calls it. Its order, how often it is called and how long it takes are measured; the names of what
it gives, and whether it belongs to an iteration, are read from that line.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from types import CodeType, FrameType
from typing import Any

import numpy as np

from amoeboid.config import Config
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, GRAY, INK, ORANGE, PALE, SKY
from amoeboid.sections import Mesh, Time
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step import Step
from amoeboid.studies.columns import Column, text

SCHEMES = {"explicit": "explicit, as in the paper", "semi-implicit": "semi-implicit, used here"}
OPENED = (
    "next_step", "_explicit", "_semi_implicit", "_tried", "_accepted", "explicit_step",
    "semi_implicit_step",
)  # fmt: skip
"""Functions that consist of stages: what they call is shown instead of them."""
LAYERS = ("amoeboid.surface.", "amoeboid.meshes.", "amoeboid.numerics.")
METHODS = ("Model.v_p",)
"""Methods that are stages; all others that a step calls are no work of their own."""
SUBDIVISIONS = 3  # the paper's 642 nodes
SKIPPED, WATCHED = 4, 12  # steps; the first have no past to start from


@dataclass
class Stage:
    """A function called at one line of a step; `seconds` holds its time in each step."""

    function: str
    about: str
    caller: CodeType
    line: int
    calls: int = 0
    seconds: list[float] = field(default_factory=list)


class Watch:
    """The stages of steps, in the order in which they are first called; for sys.setprofile."""

    def __init__(self) -> None:
        self.stages: dict[tuple[CodeType, int, str], Stage] = {}
        self.steps: list[float] = []
        self._open: dict[int, tuple[Stage, float]] = {}

    def step(self, steps: Iterator[Step]) -> Step:
        """Make the next step, and watch it."""
        for stage in self.stages.values():
            stage.seconds.append(0.0)
        before, begun = sys.getprofile(), time.perf_counter()
        sys.setprofile(self._called)
        try:
            made = next(steps)
        finally:
            sys.setprofile(before)
        self.steps.append(time.perf_counter() - begun)
        return made

    def _called(self, frame: FrameType, event: str, _: Any) -> None:
        if event == "return":
            stage, begun = self._open.pop(id(frame), (None, 0.0))
            if stage is not None:
                stage.seconds[-1] += time.perf_counter() - begun
        elif event == "call" and _is_stage(frame):
            caller = frame.f_back
            assert caller is not None  # noqa: S101
            name = frame.f_code.co_qualname
            key = (caller.f_code, caller.f_lineno, name)
            if key not in self.stages:
                missed = [0.0] * (len(self.steps) + 1)
                self.stages[key] = Stage(name, _about(frame.f_code), *key[:2], seconds=missed)
            self.stages[key].calls += 1
            self._open[id(frame)] = (self.stages[key], time.perf_counter())


def _is_stage(frame: FrameType) -> bool:
    """Whether this call is one of a stage by a step."""
    code, caller = frame.f_code, frame.f_back
    if caller is None or caller.f_code.co_name not in OPENED or code.co_name in OPENED:
        return False
    named = code.co_qualname in METHODS or "." not in code.co_qualname
    return named and str(frame.f_globals.get("__name__", "")).startswith(LAYERS)


def _about(code: CodeType) -> str:
    """The first line of the docstring of a function."""
    first = code.co_consts[0] if code.co_consts else None
    return first.strip().splitlines()[0] if isinstance(first, str) else ""


@cache
def _tree(code: CodeType) -> tuple[list[ast.stmt], int]:
    """All statements of a function, outer ones first, and its line in the file less one."""
    lines, first = inspect.getsourcelines(code)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    return [node for node in ast.walk(tree) if isinstance(node, ast.stmt)], first - 1


def _around(stage: Stage) -> list[ast.stmt]:
    """The statements that hold the line of a stage."""
    statements, shift = _tree(stage.caller)
    line = stage.line - shift
    return [s for s in statements if s.lineno <= line <= (s.end_lineno or s.lineno)]


def gives(stage: Stage) -> list[str]:
    """Names of what the line of a stage assigns."""
    inner = _around(stage)[-1]
    if not isinstance(inner, ast.Assign | ast.AugAssign | ast.AnnAssign):
        return []
    targets = inner.targets if isinstance(inner, ast.Assign) else [inner.target]
    nodes = [node for target in targets for node in ast.walk(target)]
    return [node.id for node in nodes if isinstance(node, ast.Name)]


def iterated(stage: Stage) -> bool:
    """Whether the line of a stage lies in a loop of the step."""
    return any(isinstance(s, ast.While | ast.For) for s in _around(stage))


def measured(p: Parameters, scheme: str, subdivisions: int) -> dict[str, Any]:
    """Stages of real steps of a scheme on an icosphere, with their shares of a step.

    `step`: the time of a step [s], `dt`: its length [T]; medians, as the shares.
    """
    config = Config(
        parameters=p,
        mesh=Mesh(subdivisions=subdivisions),
        time=Time(scheme=scheme, stop_when_steady=False),
    )
    steps = evolve(start(config), config.time)
    for _ in islice(steps, SKIPPED):
        pass
    watch = Watch()
    lengths = [watch.step(steps).dt for _ in range(WATCHED)]
    return {
        "dt": float(np.median(lengths)),
        "step": float(np.median(watch.steps)),
        "stages": [
            {
                "function": stage.function,
                "about": stage.about,
                "within": stage.caller.co_name,
                "gives": ", ".join(gives(stage)),
                "iterated": iterated(stage),
                "calls": stage.calls / WATCHED,
                "share": float(np.median(np.divide(stage.seconds, watch.steps))),
            }
            for stage in watch.stages.values()
        ],
    }


def compute(p: Parameters, results: Results) -> FigureData:
    """The stages of both schemes, and the time that each takes."""
    found = {
        scheme: results.of(measured, p, scheme, SUBDIVISIONS, task=f"steps of the {scheme} scheme")
        for scheme in SCHEMES
    }
    rows = [
        {"scheme": scheme, "number": number, **stage, "time": stage["share"] * part["step"]}
        for scheme, part in found.items()
        for number, stage in enumerate(part["stages"], 1)
    ]
    columns = {name: column_of(p, [row[name] for row in rows]) for name in rows[0]}
    columns["time"] = Column(1e3 * columns["time"].values, "ms")
    return FigureData(
        parameters=p,
        tables={"stages": Table("stages of a time step, in the order of their calls", columns)},
        notes=(
            *(
                f"{name}: {1e3 * part['step']:.3g} ms for a step of {text(p, part['dt'], 'T')}"
                for name, part in found.items()
            ),
            f"medians of {WATCHED} steps, measured as this table was made: times differ from run "
            "to run and from machine to machine, the stages do not",
        ),
    )


BOX, BAR, END = (0.1, 0.735), 0.76, 0.92
ROW = 0.84  # height of a box, in rows
LETTERS = 47  # of a line in a box


def draw(data: FigureData, axes: Any) -> None:
    """One flow chart per scheme: stages, what they give and do, and the time of each."""
    table = data["stages"]
    most = max(np.count_nonzero(table["scheme"] == scheme) for scheme in SCHEMES)
    for panel, (scheme, title) in zip(axes, SCHEMES.items(), strict=True):
        rows = np.flatnonzero(table["scheme"] == scheme)
        panel.set_axis_off()
        panel.set_xlim(0.0, 1.0)
        panel.set_ylim(most + 0.6, -0.9)
        total = table["time"][rows[0]] / table["share"][rows[0]] if len(rows) else 0.0
        panel.set_title(f"{title}: {total:.3g} ms per step", loc="left", pad=2)
        panel.text(BOX[0], -0.6, "stage → what it gives", fontsize=6.5, color=GRAY, va="center")
        panel.text(BAR, -0.6, "time [ms]", fontsize=6.5, color=GRAY, va="center")
        for place, row in enumerate(rows.tolist()):
            _draw_stage(panel, table, row, place, last=place == len(rows) - 1)
        inner = np.flatnonzero(table["iterated"][rows])
        if inner.size:
            _draw_loop(panel, 0.07, inner[0], inner[-1], ORANGE, "iteration")
        else:
            _draw_key(panel, float(most))
        _draw_loop(panel, 0.025, 0, len(rows) - 1, INK, "time step")


def _draw_stage(panel: Any, table: Table, row: int, place: int, last: bool) -> None:
    """The box of a stage with an arrow to the next one, and a bar of its time."""
    from matplotlib.patches import FancyBboxPatch, Rectangle

    left, right = BOX
    face = SKY if table["iterated"][row] else PALE
    box = FancyBboxPatch(
        (left, place - ROW / 2),
        right - left,
        ROW,
        boxstyle="round,pad=0,rounding_size=0.02",
        mutation_aspect=20,
        facecolor=face,
        alpha=0.45,
        edgecolor="none",
    )
    panel.add_patch(box)
    style = {"va": "center", "color": INK}
    calls = table["calls"][row]
    often = "" if round(calls, 1) == 1.0 else f" ×{calls:.2g}"
    given = f" → {table['gives'][row]}" if table["gives"][row] else ""
    name = f"{table['function'][row].lstrip('_')}{often}{given}"
    panel.text(left + 0.01, place - 0.24, name, fontsize=6.0, family="monospace", **style)
    about = textwrap.fill(in_short(table["about"][row]), LETTERS)
    panel.text(left + 0.01, place + 0.12, about, fontsize=5.5, linespacing=1.0, **style)
    if not last:
        middle = (left + right) / 2
        panel.annotate(
            "",
            (middle, place + 1 - ROW / 2),
            (middle, place + ROW / 2),
            arrowprops={"arrowstyle": "-|>,head_length=0.2,head_width=0.1", "lw": 0.5,
                        "color": GRAY, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
    longest = table["share"][table["scheme"] == table["scheme"][row]].max()
    length = table["share"][row] / longest * (END - BAR)
    panel.add_patch(Rectangle((BAR, place - 0.25), length, 0.5, facecolor=BLUE))
    panel.text(BAR + length + 0.01, place, f"{table['time'][row]:.2g}", fontsize=6.0, va="center")


def in_short(about: str) -> str:
    """A line of a docstring without shapes, units and what follows a semicolon.

    >>> in_short("dc/dt (V,) at nodes that move with v [N/(L^2 T)]; main text `cdot`.")
    'dc/dt at nodes that move with v'
    """
    plain = re.sub(r" \([A-Z0-9]+,( [A-Z0-9]+)*\)| \[[^]]*\]|`", "", about.partition(";")[0])
    return plain.strip().removesuffix(".")


def _draw_key(panel: Any, row: float) -> None:
    """What the colors mean, in the free place below the shorter list."""
    for k, (color, words) in enumerate(
        ((PALE, "once per step"), (SKY, "until converged, ×n: calls per step"))
    ):
        panel.text(
            BOX[0],
            row - 1.5 + k,
            words,
            fontsize=6.5,
            va="center",
            bbox={"facecolor": color, "alpha": 0.45, "edgecolor": "none", "pad": 2.0},
        )


def _draw_loop(panel: Any, x: float, first: int, last: int, color: str, words: str) -> None:
    """An arrow back from a stage to an earlier one, with what is repeated."""
    edge = BOX[0] - 0.008
    panel.plot([edge, x, x, edge], [last, last, first, first], color=color, lw=0.8)
    panel.annotate(
        "",
        (edge + 0.006, first),
        (edge - 0.012, first),
        arrowprops={"arrowstyle": "-|>,head_length=0.25,head_width=0.12", "lw": 0.8,
                    "color": color, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    panel.text(
        x - 0.006, (first + last) / 2, words, rotation=90, fontsize=6.0, color=color,
        ha="right", va="center",
    )  # fmt: skip


FIGURE = Figure(
    name="s_procedure",
    title="stages of a time step and their times",
    source="SI, flow chart",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(7.0, 7.0),
    panels=(1, 2),
)
