"""Figure 3A: the supercritical bifurcation of the retrograde flow, D = 0.03."""

from __future__ import annotations

from typing import Any

from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures import computed, drawing
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData
from amoeboid.model.parameters import Parameters
from amoeboid.studies.columns import text

SUBDIVISIONS = 3  # the paper's 642 nodes
LOW, HIGH = 0.97, 1.13  # window of v_p0, in thresholds
RUNS = (0.98, 0.99, 1.005, 1.01, 1.02, 1.035, 1.05, 1.07, 1.09, 1.11, 1.125)


def compute(p: Parameters, results: Results) -> FigureData:
    """The theory, the axisymmetric branch and 3D runs, in a window around the threshold."""
    threshold = float(critical_speed(p))
    low, high = LOW * threshold, HIGH * threshold
    branch = results.of(
        computed.branch_points, p, "v_p0", low, high, 0.05, task="axisymmetric branch"
    )
    speeds = [share * threshold for share in RUNS]
    runs = computed.mesh_runs(p, results, speeds, SUBDIVISIONS, computed.WEAK * p.c0)
    return FigureData(
        parameters=p,
        tables={
            "theory": computed.theory_table(p, computed.spread(low, threshold, high)),
            "branch": computed.branch_table(p, "v_p0", branch),
            "threshold": computed.threshold_table(p, threshold),
            "runs": computed.runs_table(p, "v_p0", speeds, runs, SUBDIVISIONS),
        },
        notes=(
            f"threshold v_p^c = {text(p, threshold, 'L/T', '#.8g')}",
            *computed.jumps(p, speeds, runs, "from the weak start"),
        ),
        problems=(*branch["problems"], *computed.not_steady(p, speeds, runs)),
    )


def draw(data: FigureData, axes: Any) -> None:
    """The retrograde flow over the polymerization speed."""
    drawing.draw_theory(axes, data["theory"])
    drawing.draw_branch(axes, data["branch"])
    drawing.draw_runs(axes, data["runs"], f"3D, {computed.nodes(SUBDIVISIONS)}")
    drawing.mark_threshold(axes, data["threshold"])
    drawing.name_axes(axes, data["runs"], "v_p0", "max_retrograde_speed")
    drawing.show_window(axes, data["theory"]["v_p0"])
    drawing.legend_above(axes)


FIGURE = Figure(
    name="fig3a",
    title="supercritical bifurcation",
    source="figure 3A",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(3.4, 2.8),
    varies=frozenset({"v_p0"}),
)
