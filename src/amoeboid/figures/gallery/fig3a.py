"""Figure 3A: the supercritical bifurcation of the retrograde flow, D = 0.03."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures import computed, drawing
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import GRAY, INK
from amoeboid.studies.columns import text

SUBDIVISIONS = 3  # the paper's 642 nodes
LOW, HIGH = 0.97, 1.13  # window of v_p0, in thresholds
RUNS = (0.98, 0.99, 1.005, 1.01, 1.02, 1.035, 1.05, 1.07, 1.09, 1.11, 1.125)
START = 0.01  # the paper's 0.03, as a share of c0


def compute(p: Parameters, results: Results) -> FigureData:
    """The theory, the axisymmetric branch and 3D runs, in a window around the threshold."""
    threshold = float(critical_speed(p))
    low, high = LOW * threshold, HIGH * threshold
    branch = results.of(
        computed.branch_points, p, "v_p0", low, high, 0.05, task="axisymmetric branch"
    )
    speeds = np.array(RUNS) * threshold
    runs = computed.mesh_runs(p, results, speeds, SUBDIVISIONS, START * p.c0)
    return FigureData(
        parameters=p,
        tables={
            "theory": computed.theory_table(p, np.linspace(low, high, 161)),
            "branch": computed.branch_table(p, "v_p0", branch),
            "runs": computed.runs_table(p, "v_p0", speeds, runs),
        },
        notes=(f"threshold v_p^c = {text(p, threshold, 'L/T', '#.8g')}",),
        problems=tuple(branch["problems"]),
    )


def draw(data: FigureData, axes: Any) -> None:
    """The retrograde flow over the polymerization speed."""
    theory, runs = data["theory"], data["runs"]
    axes.plot(theory["v_p0"], theory["at_infinite_pressure"], color=GRAY, lw=1.0, label="theory")
    drawing.draw_branch(axes, data["branch"])
    axes.plot(runs["v_p0"], runs["max_retrograde_speed"], "x", color=INK, label="3D, 642 nodes")
    drawing.name_axes(axes, runs, "v_p0", "max_retrograde_speed")
    axes.legend(loc="upper left")


FIGURE = Figure(
    name="fig3a",
    title="supercritical bifurcation of the retrograde flow",
    source="figure 3A",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    varies=frozenset({"v_p0"}),
)
