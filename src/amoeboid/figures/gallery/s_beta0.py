"""The retrograde flow without turnover, beta = 0: a subcritical bifurcation."""

from __future__ import annotations

from typing import Any

from amoeboid.figures import computed, drawing
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData
from amoeboid.model.parameters import Parameters

SUBDIVISIONS = 3  # the paper's 642 nodes


def compute(p: Parameters, results: Results) -> FigureData:
    """The axisymmetric branch and 3D runs from both starts; the filament number is conserved."""
    return computed.hysteresis(p, results, SUBDIVISIONS)


def draw(data: FigureData, axes: Any) -> None:
    """The retrograde flow over the polymerization speed, and the threshold as a line."""
    drawing.draw_hysteresis(axes, data, f"3D, {computed.nodes(SUBDIVISIONS)}")
    drawing.draw_threshold_line(axes, data["threshold"])


FIGURE = Figure(
    name="s_beta0",
    title="bifurcation without turnover, beta = 0",
    source="SI, beta = 0",
    parameters=Parameters(beta=0.0),
    compute=compute,
    draw=draw,
    size=(3.4, 3.0),
    varies=frozenset({"v_p0", "beta"}),
)
