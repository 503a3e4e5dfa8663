"""The retrograde flow with the exponential and with the inverse polymerization law."""

from __future__ import annotations

from typing import Any

from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures import computed, drawing
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, GREEN
from amoeboid.studies.columns import text

LAWS = ("exponential", "inverse")
COLORS = dict(zip(LAWS, (BLUE, GREEN), strict=True))
# Of the paper's formulas: SI `eq_vMig_inv` has the prefactor at v_p^c, the exponential one at v_p0.
PREFACTORS = dict(zip(LAWS, ("", computed.AT_THRESHOLD_PREFACTOR), strict=True))
LOW, HIGH = 0.9, 1.25  # window of v_p0, in thresholds


def compute(p: Parameters, results: Results) -> FigureData:
    """The theory and the axisymmetric branch of each law, in a window around its threshold."""
    tables, notes, problems = {}, [], []
    for law in LAWS:
        q = p.replace(law=law)
        threshold = float(critical_speed(q))
        low, high = LOW * threshold, HIGH * threshold
        branch = results.of(
            computed.branch_points, q, "v_p0", low, high, 0.05, task=f"axisymmetric branch, {law}"
        )
        tables[f"theory-{law}"] = computed.theory_table(q, computed.spread(low, threshold, high))
        tables[f"branch-{law}"] = computed.branch_table(q, "v_p0", branch)
        tables[f"threshold-{law}"] = computed.threshold_table(q, threshold)
        notes.append(f"threshold v_p^c, {law} law = {text(q, threshold, 'L/T', '#.8g')}")
        problems += branch["problems"]
    return FigureData(p, tables, tuple(notes), tuple(problems))


def draw(data: FigureData, axes: Any) -> None:
    """The theory as in the paper, dotted, and the branch of each law."""
    for law in LAWS:
        theory, color = data[f"theory-{law}"], COLORS[law]
        speed = theory[f"at_infinite_pressure{PREFACTORS[law]}"]
        axes.plot(theory["v_p0"], speed, color=color, ls=":", label=f"{law}, theory")
        drawing.draw_branch(axes, data[f"branch-{law}"], words=law, color=color)
        drawing.mark_threshold(axes, data[f"threshold-{law}"], first=law == LAWS[0])
    drawing.name_axes(axes, data[f"branch-{LAWS[0]}"], "v_p0", "max_retrograde_speed")
    ends = [data[f"theory-{law}"]["v_p0"][[0, -1]] for law in LAWS]
    drawing.show_window(axes, [min(e[0] for e in ends), max(e[1] for e in ends)])
    drawing.legend_above(axes)


FIGURE = Figure(
    name="s_inverse",
    title="exponential and inverse polymerization law",
    source="SI, inverse law",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(3.4, 2.7),
    varies=frozenset({"v_p0", "law"}),
)
