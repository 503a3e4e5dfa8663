"""Figure 3B: the subcritical bifurcation of the retrograde flow with its hysteresis, D = 0.4."""

from __future__ import annotations

from typing import Any

from amoeboid.figures import computed, drawing
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData
from amoeboid.model.parameters import Parameters

SUBDIVISIONS = 3  # the paper's 642 nodes


def compute(p: Parameters, results: Results) -> FigureData:
    """The theory, the axisymmetric branch, and 3D runs from both starts of the paper."""
    return computed.hysteresis(p, results, SUBDIVISIONS)


def draw(data: FigureData, axes: Any) -> None:
    """The retrograde flow over the polymerization speed."""
    drawing.draw_theory(axes, data["theory"])
    drawing.draw_hysteresis(axes, data, f"3D, {computed.nodes(SUBDIVISIONS)}")


FIGURE = Figure(
    name="fig3b",
    title="subcritical bifurcation, with hysteresis",
    source="figure 3B",
    parameters=Parameters(D=0.4),
    compute=compute,
    draw=draw,
    size=(3.4, 3.0),
    varies=frozenset({"v_p0"}),
)
