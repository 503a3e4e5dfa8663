"""Growth rates lambda_l of the sphere, at finite and at infinite pressure; SI `lambdal`."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.closed_forms.linear import (
    critical_pressure,
    critical_speed,
    mode_onsets,
    slowest_rate,
)
from amoeboid.closed_forms.points import Points, infinite_pressure, points
from amoeboid.figures import drawing
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.sections import amount
from amoeboid.figures.tables import FigureData, Table, column_of, label
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, GRAY, GREEN, INK, ORANGE, PURPLE, SKY, YELLOW
from amoeboid.studies.columns import text

L_MAX = 6
MODES = np.arange(1, L_MAX + 1)
COLORS = (BLUE, ORANGE, GREEN, PURPLE, SKY, YELLOW)
HIGH = 1.5  # window of v_p0, in thresholds
SHARE = 0.5  # of delta_P*, where mode 2 goes unstable before mode 1, and higher ones may too
OWN, LOW, INFINITE = "delta_P", "low delta_P", "infinite delta_P"


def pressures(p: Parameters) -> dict[str, Points]:
    """The cell at its pressure, at SHARE of delta_P*, and as a rigid sphere."""
    at = points(p)
    low = SHARE * critical_pressure(at)
    return {OWN: at, LOW: at.at_pressure(low), INFINITE: infinite_pressure(at)}


def compute(p: Parameters, results: Results) -> FigureData:
    """Growth rates over v_p0 and where each mode goes unstable, at three pressures."""
    threshold = float(critical_speed(p))
    speeds = np.linspace(0.0, HIGH * threshold, 121)
    found = pressures(p)
    columns = {"v_p0": column_of(p, speeds, "L/T")}
    for name, at in found.items():
        for l in MODES:
            rate = slowest_rate(at.at_speed(speeds), l)
            columns[f"lambda_{l} at {name}"] = column_of(p, rate, "1/T")
    onsets = {name: mode_onsets(at, L_MAX) for name, at in found.items()}
    star = critical_pressure(p)
    return FigureData(
        parameters=p,
        tables={
            "rates": Table(
                "growth rates of the sphere, the larger real part of each mode", columns
            ),
            "onsets": _onsets(p, onsets),
            "pressures": Table(
                "the pressures of the other tables; below delta_P* mode 2 precedes mode 1",
                {
                    "pressure": column_of(p, [OWN, LOW, "delta_P*"]),
                    "value": column_of(
                        p, [p.delta_P, SHARE * float(star), float(star)], "M/(L T^2)"
                    ),
                },
            ),
        },
        notes=_notes(p, threshold, float(star), onsets),
    )


def _onsets(p: Parameters, onsets: dict[str, dict[int, float]]) -> Table:
    """v_p0 at which each mode goes unstable, empty where it never does."""
    columns = {"l": column_of(p, MODES)}
    for name, found in onsets.items():
        speeds = [found.get(int(l), np.nan) for l in MODES]
        columns[f"v_p0 at {name}"] = column_of(p, speeds, "L/T")
    return Table("where each mode goes unstable as v_p0 grows", columns)


def _notes(
    p: Parameters, threshold: float, star: float, onsets: dict[str, dict[int, float]]
) -> tuple[str, ...]:
    notes = [
        f"threshold v_p^c = {text(p, threshold, 'L/T', '#.8g')} (l = 1, any pressure)",
        f"below delta_P* = {text(p, star, 'M/(L T^2)')} mode 2 goes unstable before mode 1; "
        f"delta_P = {text(p, p.delta_P, 'M/(L T^2)')}",
    ]
    for name, found in onsets.items():
        first = min(found, key=lambda l: found[l])
        notes.append(f"first at {name}: l = {first}, v_p0 = {text(p, found[first], 'L/T')}")
    return tuple(notes)


def draw(data: FigureData, axes: Any) -> None:
    """Growth rates over v_p0: at the pressure of the cell above, below delta_P* below."""
    above, below = axes
    rates, onsets = data["rates"], data["onsets"]
    for l, color in zip(MODES, COLORS, strict=True):
        for panel, name, style in (
            (above, OWN, "-"),
            (above, INFINITE, "--"),
            (below, LOW, "-"),
            (below, INFINITE, "--"),
        ):
            value = rates[f"lambda_{l} at {name}"]
            panel.plot(
                rates["v_p0"],
                value,
                style,
                color=color,
                lw=1.3 if style == "-" else 0.8,
                label=f"$l = {l}$" if style == "-" else None,
            )
    low, high = (data["pressures"]["value"][k] for k in (1, 0))
    unit = data["pressures"].unit("value")
    for panel, name, pressure in ((above, OWN, high), (below, LOW, low)):
        panel.axhline(0.0, color=INK, lw=0.6, zorder=0)
        speeds = onsets[f"v_p0 at {name}"]
        inside = speeds <= rates["v_p0"][-1]
        panel.plot(speeds[inside], 0 * speeds[inside], "o", color=INK, ms=2.5, zorder=4)
        panel.set_xlim(0.0, rates["v_p0"][-1])
        panel.set_title(f"$ΔP$ = {amount(float(pressure), unit)}", loc="left", pad=3)
        panel.set_ylabel(label(r"growth rate $λ_l$", rates.unit("lambda_1 at delta_P")))
    below.plot([], [], "--", color=GRAY, lw=0.8, label=r"$ΔP → \infty$")
    below.set_xlabel(label(drawing.SYMBOLS["v_p0"], rates.unit("v_p0")))
    low, high = below.get_ylim()
    below.set_ylim(low, high + 0.3 * (high - low))
    below.legend(loc="upper left", ncols=3)


FIGURE = Figure(
    name="extra_modes",
    title="growth rates of the modes l of the sphere",
    source="not in the paper",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(3.4, 4.4),
    panels=(2, 1),
    varies=frozenset({"v_p0"}),
)
