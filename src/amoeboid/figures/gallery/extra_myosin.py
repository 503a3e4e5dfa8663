"""Myosin and polymerization: which polarizes the cell, and what inhibition of either does."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.linear import critical_slope, critical_speed
from amoeboid.closed_forms.points import points
from amoeboid.figures import computed
from amoeboid.figures.drawing import SYMBOLS, name_axes
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of, label
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, GRAY, INK, ORANGE
from amoeboid.studies.columns import text

STIFFNESS = "M L^2/(T^2 N)"
HIGH = 1.5  # of the window, in thresholds of either motor alone
# v_p0 and chi of two cells, in the same units: both motors are needed, or polymerization is enough
CELLS = {"both needed": (0.8, 0.5), "polymerization enough": (1.2, 0.3)}
COLORS = {"both needed": BLUE, "polymerization enough": ORANGE}
MOTORS = {"chi": "myosin", "v_p0": "polymerization"}
REGIONS = (
    ("at rest", 0.25, 0.12),
    ("both\nneeded", 0.78, 0.62),
    ("polymerization\nenough", 1.25, 0.55),
    ("myosin enough", 0.5, 1.25),
    ("either enough", 1.25, 1.25),
)


def alone(p: Parameters) -> tuple[float, float]:
    """v_p0 and chi from which on polymerization, and myosin, polarizes the cell alone."""
    quiet = p.replace(chi=0.0, v_p0=0.0)
    viscosity = 2 * (p.eta_s + p.eta_b)
    return float(critical_speed(quiet)), -float(critical_slope(quiet)) * viscosity / p.R0


def compute(p: Parameters, results: Results) -> FigureData:
    """The threshold in (v_p0, chi), and branches of two cells as either motor is inhibited."""
    speed, contractility = alone(p)
    chi = np.linspace(0.0, contractility * (1 - 1e-9), 61)
    line = {
        "v_p0": column_of(p, critical_speed(points(p, chi=chi)), "L/T"),
        "chi": column_of(p, chi, STIFFNESS),
    }
    own = {
        "v_p0": column_of(p, [speed], "L/T"),
        "chi": column_of(p, [contractility], STIFFNESS),
    }
    tables = {
        "threshold": Table("where both together polarize the cell", line),
        "alone": Table("where polymerization alone, and myosin alone, polarizes it", own),
    }
    problems, notes = (
        [],
        [
            f"polymerization alone from v_p0 = {text(p, speed, 'L/T', '.6g')}",
            f"myosin alone from chi = {text(p, contractility, STIFFNESS, '.6g')}",
        ],
    )
    for name, shares in CELLS.items():
        cell = p.replace(v_p0=shares[0] * speed, chi=shares[1] * contractility)
        for motor, words in MOTORS.items():
            full = cell.value(motor)
            ends = (0.0, full) if motor == "v_p0" else (full, 0.0)
            found = results.of(
                computed.branch_points, cell, motor, *ends, task=f"{name}, less {words}"
            )
            tables[f"{name}, less {words}"] = computed.branch_table(p, motor, found)
            problems += found["problems"]
        notes.append(
            f"{name}: v_p0 = {text(p, cell.v_p0, 'L/T', '.4g')}, "
            f"chi = {text(p, cell.chi, STIFFNESS, '.4g')}"
        )
    return FigureData(p, tables, tuple(notes), tuple(problems))


def remaining(data: FigureData, name: str, motor: str) -> tuple[Array, Array]:
    """Share of a motor that is left, descending from 1, and the flow of the stable cell there.

    From the full motor down to where the polarized state ends, then 0.
    """
    table = data[f"{name}, less {MOTORS[motor]}"]
    full = CELLS[name][0 if motor == "v_p0" else 1] * float(data["alone"][motor][0])
    stable = np.asarray(table["stable"], dtype=bool)
    share = table[motor][stable] / full
    order = np.argsort(-share)
    share, flow = share[order], table["max_retrograde_speed"][stable][order]
    inside = (share <= 1 + 1e-9) & (share >= 0)
    share, flow = share[inside], flow[inside]
    if share[-1] > 1e-9:
        share, flow = np.append(share, [share[-1], 0.0]), np.append(flow, [0.0, 0.0])
    return share, flow


def draw(data: FigureData, axes: Any) -> None:
    """The diagram above; below, the flow as either motor is inhibited."""
    above, below = axes
    line, (speed, contractility) = data["threshold"], (data["alone"][k][0] for k in ("v_p0", "chi"))
    right, top = HIGH * float(speed), HIGH * float(contractility)
    above.plot(line["v_p0"], line["chi"], color=INK)
    above.plot([speed, speed], [0.0, top], "--", color=GRAY, lw=0.8)
    above.plot([0.0, right], [contractility, contractility], "--", color=GRAY, lw=0.8)
    for words, x, y in REGIONS:
        above.text(x * speed, y * contractility, words, ha="center", va="center", fontsize=6.5)
    for name, shares in CELLS.items():
        x, y = shares[0] * speed, shares[1] * contractility
        above.plot(x, y, "o", color=COLORS[name], zorder=5)
        for end in ((x, 0.0), (0.0, y)):
            above.annotate(
                "", end, (x, y), arrowprops={"arrowstyle": "->", "color": COLORS[name], "lw": 0.7}
            )
    above.set_xlim(0.0, right)
    above.set_ylim(0.0, top)
    name_axes(above, line, "v_p0", "chi")
    above.set_ylabel(label(r"contractility $\chi$", line.unit("chi")))
    for name in CELLS:
        for motor, style in (("chi", "-"), ("v_p0", "--")):
            share, flow = remaining(data, name, motor)
            words = f"{name}: less {MOTORS[motor]}"
            below.plot(100 * (1 - share), flow, style, color=COLORS[name], label=words)
    unit = data[f"{next(iter(CELLS))}, less myosin"].unit("max_retrograde_speed")
    below.set_xlabel("inhibition [%]")
    below.set_ylabel(label(SYMBOLS["max_retrograde_speed"], unit))
    below.set_xlim(0.0, 100.0)
    below.set_ylim(bottom=0.0)
    low, high = below.get_ylim()
    below.set_ylim(low, 1.5 * high)
    below.legend(loc="upper right", fontsize=6)


FIGURE = Figure(
    name="extra_myosin",
    title="polymerization, myosin, their inhibition",
    source="not in the paper",
    parameters=Parameters(D=0.1),
    compute=compute,
    draw=draw,
    size=(3.4, 5.0),
    panels=(2, 1),
    varies=frozenset({"v_p0", "chi"}),
)
