"""Shape, fold and type of the bifurcation against the pressure, with the physical range."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.axisymmetric.criticality import criticality
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.linear import critical_speed, growth_rate
from amoeboid.closed_forms.points import points
from amoeboid.figures import computed
from amoeboid.figures.drawing import mark_range
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import BLUE, GRAY, GREEN, INK, ORANGE
from amoeboid.studies.branch import branch
from amoeboid.studies.columns import quantity, text
from amoeboid.validation import InvalidInput

LOW, HIGH = 1.0, 300.0  # window of delta_P R0/(eta_s beta)
PHYSICAL = ("300 Pa", "700 Pa")  # the paper's range, of the cell of its parameter table
MARGIN = 1.12  # of the window in the picture
BROKEN = 4.0  # of the window: nu diverges where modes 1 and 2 share a threshold
FOLDS = 9  # pressures at which a fold is sought
AT, NU = "delta_P R0/(eta_s beta)", "nu c_r^2/beta"


def compute(p: Parameters, results: Results) -> FigureData:
    """The polarized cell at v_p0 along the pressure, and its threshold, fold and nu."""
    unit = pressure_unit(p)
    found = results.of(shapes, p, LOW * unit, HIGH * unit, task="cells along the pressure")
    pressures = np.geomspace(LOW, HIGH, FOLDS) * unit
    onsets = [
        results.of(onset, p.replace(delta_P=float(value)), task=f"folds: {k} of {FOLDS}")
        for k, value in enumerate(pressures, 1)
    ]
    fine = np.geomspace(LOW, HIGH, 81) * unit
    nu = cubic_coefficient(points(p, delta_P=fine)) * nu_unit(p)
    threshold = float(critical_speed(p))
    physical = [float(Parameters.physical(delta_P=value).delta_P) for value in PHYSICAL]
    return FigureData(
        p,
        {
            "shape": _table(p, found.pop("delta_P"), found, "the polarized cell at v_p0"),
            "onset": _onset_table(p, pressures, threshold, onsets),
            "theory": _table(p, fine, {NU: nu}, "cubic coefficient, weakly nonlinear"),
            "physical": Table("range of the paper's cell", {AT: column_of(p, physical)}),
        },
        (
            f"threshold v_p^c = {text(p, threshold, 'L/T', '#.8g')} at every pressure",
            f"physical cells: {AT} = {physical[0]:.3g} to {physical[1]:.3g}",
        ),
        tuple(
            f"branch at {AT} = {value / unit:.4g}: {problem}"
            for value, entry in zip(pressures, onsets, strict=True)
            for problem in entry["problems"]
        ),
    )


def pressure_unit(p: Parameters) -> float:
    """eta_s beta/R0 [M/(L T^2)]. Raises InvalidInput without turnover."""
    if p.beta == 0:
        raise InvalidInput(
            "beta must be > 0 here, got 0: the unit of the pressure is eta_s beta/R0"
        )
    return p.eta_s * p.beta / p.R0


def nu_unit(p: Parameters) -> float:
    """c_r^2/beta, which makes nu dimensionless as in the SI."""
    return p.c_r**2 / p.beta


def shapes(p: Parameters, low: float, high: float) -> dict[str, list[Any]]:
    """The fastest polarized cell between two pressures: its deformation, aspect and stability."""
    ends = [quantity(p, value, p.dimension("delta_P")) for value in (high, low)]
    pieces = branch(p, "delta_P", *ends).pieces
    states = max(pieces, key=lambda piece: piece[0].number("max_retrograde_speed"))
    outlines = [state.solution.outline(400) for state in states]
    return {
        "delta_P": [state.parameters.delta_P for state in states],
        "deformation": [state.number("deformation") for state in states],
        "aspect": [float(np.ptp(z) / (2 * np.max(r))) for r, z in outlines],
        "stable": [bool(state.stable) for state in states],
        "kind": [computed.STATE for _ in states],
        "piece": [0 for _ in states],
    }


def onset(p: Parameters) -> dict[str, Any]:
    """The fold below the threshold [L/T], and nu by the solver and its branch near the onset."""
    threshold = float(critical_speed(p))
    found = computed.branch_points(p, "v_p0", 0.0, 1.05 * threshold, 0.2)
    curvature = criticality(p)
    slope = (growth_rate(p.replace(v_p0=1.001 * threshold), 1)) / (0.001 * threshold)
    return {
        "fold": min((f for f in found["folds"] if f < threshold), default=None),
        "nu": None if curvature is None else -curvature * float(slope),
        "problems": found["problems"],
    }


def _table(p: Parameters, pressure: Any, values: dict[str, Any], about: str) -> Table:
    columns = {
        "delta_P": column_of(p, pressure, p.dimension("delta_P")),
        AT: column_of(p, np.asarray(pressure) / pressure_unit(p)),
    }
    columns |= {key: column_of(p, v) for key, v in values.items()}
    return Table(about, columns)


def _onset_table(p: Parameters, pressure: Any, threshold: float, found: list[Any]) -> Table:
    fold, nu = (
        np.array([np.nan if e[key] is None else e[key] for e in found]) for key in ("fold", "nu")
    )
    values = {"fold_in_thresholds": fold / threshold, NU: nu * nu_unit(p)}
    return _table(p, pressure, values, "fold and cubic coefficient, axisymmetric solver")


def draw(data: FigureData, panels: Any) -> None:
    """Shape, fold and nu over the pressure; the range of physical cells is shaded."""
    onset_, theory = data["onset"], data["theory"]
    above, middle, below = panels
    _draw_shape(above, data["shape"])
    middle.axhline(1.0, color=INK, lw=0.8, label="threshold")
    middle.plot(onset_[AT], onset_["fold_in_thresholds"], "s-", color=ORANGE, ms=3, label="fold")
    middle.set_ylabel("speed $v_p^0/v_p^c$")
    lowest = float(np.nanmin([*onset_["fold_in_thresholds"], 0.93]))
    middle.set_ylim(1.0 - 1.15 * (1.0 - lowest), 1.08)
    middle.legend(loc="best")
    below.axhline(0.0, color=INK, lw=0.8, ls="--", label=r"$\nu = 0$, subcritical above")
    highest = _largest(onset_[NU]) or _largest(theory[NU]) or 1.0
    shown = np.where(np.abs(theory[NU]) < BROKEN * highest, theory[NU], np.nan)
    below.plot(theory[AT], shown, color=BLUE, label="theory")
    below.plot(onset_[AT], onset_[NU], "o", mfc="none", color=INK, label="axisymmetric")
    below.set_ylabel(r"coefficient $\nu\, c_r^2/β$")
    below.set_xlabel(r"pressure $\Delta P\, R_0/(η_s β)$")
    below.set_ylim(-(0.25 if np.nanmin(theory[NU]) > 0 else 1.1) * highest, 1.1 * highest)
    below.legend(loc="best")
    for axes in panels:
        mark_range(axes, data["physical"][AT])
        axes.set_xscale("log")
        axes.set_xlim(LOW / MARGIN, HIGH * MARGIN)
        if axes is not below:
            axes.tick_params(labelbottom=False)
    low, high = data["physical"][AT]
    above.text(
        float(np.sqrt(low * high)), 1.01, "physical cells", ha="center", va="bottom", fontsize=6.5,
        transform=above.get_xaxis_transform(),
    )  # fmt: skip


def _largest(values: Any) -> float:
    """The largest absolute value of a column, without those that are not known; 0 without any."""
    return float(np.nanmax(np.abs(values), initial=0.0))


def _draw_shape(axes: Any, table: Table) -> None:
    """Largest deviation from the sphere and length over width, in percent."""
    for key, values, color in (
        ("deformation", table["deformation"], BLUE),
        ("length/width − 1", table["aspect"] - 1.0, GREEN),
    ):
        for rows, stable in computed.pieces(table):
            axes.plot(table[AT][rows], 100 * values[rows], "-" if stable else "--", color=color)
        axes.plot([], [], color=color, label=key)
    axes.plot([], [], "--", color=GRAY, label="unstable")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.3 * (high - low))  # room for the legend
    axes.set_ylabel("shape [%]")
    axes.legend(loc="upper right")


FIGURE = Figure(
    name="extra_pressure",
    title="bifurcation and shape against the pressure",
    source="not in the paper",
    parameters=Parameters(D=0.4, v_p0=6.0),
    compute=compute,
    draw=draw,
    size=(3.4, 4.6),
    panels=(3, 1),
    varies=frozenset({"delta_P"}),
)
