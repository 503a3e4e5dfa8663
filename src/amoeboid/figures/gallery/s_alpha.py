"""The threshold against the elastic resistance of the cortex, as printed and as derived."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import points
from amoeboid.figures import computed
from amoeboid.figures.drawing import SYMBOLS
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of, label
from amoeboid.model.parameters import Parameters
from amoeboid.model.physical import PAPER_CELL
from amoeboid.model.units import measured
from amoeboid.plotting.palette import BLUE, GRAY, INK, ORANGE
from amoeboid.studies.columns import text

SUBDIVISIONS = 3
NODES = computed.nodes(SUBDIVISIONS)
STIFFNESS = "M L^2/(T^2 N)"
SHEAR_MODULUS, THICKNESS = 300.0, 190e-9
"""The paper's estimate of G [Pa] and h [m]."""

PRINTED = "1.4e-19 Pa m^3"
"""What the paper prints for G h/c0; see docs/errata.md."""

HIGHEST = 0.42  # end of the window, in units of the alpha that doubles the threshold
SOLVED = (0.0, 0.06, 0.105, 0.2, 0.3, 0.4)  # where the axisymmetric solver and the shell are asked
ON_MESH = (0.0, 0.2, 0.4)


def compute(p: Parameters, results: Results) -> FigureData:
    """Both formulas, the thresholds of both solvers, and the paper's two estimates."""
    unit = doubling(p)
    alpha = np.linspace(0.0, HIGHEST * unit, 61)
    tables = {"formula": _formulas(p, alpha, "thresholds by the formulas")}
    solved = [p.replace(alpha=share * unit) for share in SOLVED]
    thresholds = [
        results.of(computed.solver_threshold, q, task="axisymmetric thresholds") for q in solved
    ]
    tables["axisymmetric"] = _thresholds(p, solved, thresholds, "axisymmetric solver, sphere")
    meshed = [p.replace(alpha=share * unit) for share in ON_MESH]
    thresholds = [
        results.of(computed.mesh_threshold, q, SUBDIVISIONS, task="growth rates of the 3D shell")
        for q in meshed
    ]
    tables["shell"] = _thresholds(p, meshed, thresholds, f"growth rates of the 3D shell, {NODES}")
    notes = [f"threshold without stiffness = {text(p, float(critical_speed(_soft(p))), 'L/T')}"]
    if p.units is not None:
        estimate = SHEAR_MODULUS * THICKNESS / measured("c0", PAPER_CELL["c0"], "N/L^2", "1 / um^2")
        misprint = measured("alpha", PRINTED, STIFFNESS, PRINTED)
        values = np.array([estimate, misprint]) / p.units.of(STIFFNESS)
        tables["estimates"] = _formulas(
            p, values, "G h/c0 with the paper's c0, and what the paper prints for it"
        )
        notes += [
            f"alpha = {text(p, value, STIFFNESS, '.3g')}: {text(p, right, 'L/T', '.4g')} as "
            f"derived, {text(p, wrong, 'L/T', '.4g')} as printed"
            for value, right, wrong in zip(values, *_both(p, values), strict=True)
        ]
    return FigureData(p, tables, tuple(notes))


def doubling(p: Parameters) -> float:
    """The alpha that doubles the threshold: alpha c0 R0/(2 S) = D/R0 + beta R0/2."""
    return float(2 * (p.eta_s + p.eta_b) * (p.D / p.R0 + p.beta * p.R0 / 2) / (p.c0 * p.R0))


def _soft(p: Parameters) -> Parameters:
    return p.replace(alpha=0.0)


def _both(p: Parameters, alpha: Any) -> tuple[Any, Any]:
    """The threshold at alpha as derived, and as printed: with twice the share of alpha."""
    derived = critical_speed(points(p, alpha=alpha))
    return derived, 2 * derived - critical_speed(_soft(p))


def _formulas(p: Parameters, alpha: Any, about: str) -> Table:
    derived, printed = _both(p, alpha)
    columns = {
        "alpha": column_of(p, alpha, STIFFNESS),
        "derived": column_of(p, derived, "L/T"),
        "printed": column_of(p, printed, "L/T"),
    }
    return Table(about, columns)


def _thresholds(p: Parameters, cells: list[Parameters], found: list[Any], about: str) -> Table:
    columns = {
        "alpha": column_of(p, [q.alpha for q in cells], STIFFNESS),
        "threshold": column_of(p, [np.nan if v is None else v for v in found], "L/T"),
    }
    return Table(about, columns)


def draw(data: FigureData, axes: Any) -> None:
    """The threshold over alpha: lines by the formulas, marks by the solvers and of the paper."""
    formula = data["formula"]
    shown, unit = _tidy(formula.unit("alpha"))
    axes.plot(formula["alpha"] * shown, formula["derived"], color=BLUE, label="as derived")
    axes.plot(formula["alpha"] * shown, formula["printed"], "--", color=ORANGE, label="as printed")
    for key, words, style in (
        ("axisymmetric", "axisymmetric solver", {"marker": "o", "mfc": "none", "color": INK}),
        ("shell", f"3D shell, {NODES}", {"marker": "x", "color": INK}),
    ):
        table = data[key]
        axes.plot(
            table["alpha"] * shown, table["threshold"], ls="", label=words, clip_on=False, **style
        )
    if "estimates" in data:
        _draw_estimates(axes, data["estimates"], shown)
    axes.set_xlabel(label(SYMBOLS["alpha"], unit))
    axes.set_ylabel(label("threshold $v_p^c$", formula.unit("derived")))
    axes.set_xlim(left=0.0)
    axes.legend(loc="upper left")


def _draw_estimates(axes: Any, table: Table, shown: float) -> None:
    """The paper's 1.77 um/s, and what its estimate of alpha gives by the derived formula."""
    estimate, misprint = (float(value) * shown for value in table["alpha"])
    low = axes.get_ylim()[0]
    for key, place, side in (("printed", (-3, 2), "right"), ("derived", (3, -9), "left")):
        value = float(table[key][0])
        axes.plot(estimate, value, "s", color=INK, zorder=6)
        axes.annotate(f"{value:.3g}", (estimate, value), place, textcoords="offset points", ha=side)
    for at, top, words, style in (
        (estimate, table["printed"][0], "$G h/c_0$", "-"),
        (misprint, table["printed"][1], "$G h/c_0$ as printed", "--"),
    ):
        axes.plot([at, at], [low, float(top)], style, color=GRAY, lw=0.7, zorder=0)
        axes.annotate(
            words, (at, low), (-3, 4), textcoords="offset points", ha="right", color=GRAY,
            fontsize=6.5,
        )  # fmt: skip
    axes.set_ylim(bottom=low)


def _tidy(unit: str) -> tuple[float, str]:
    """Factor and unit in which ticks have few digits."""
    return (1e20, f"10^-20 {unit}") if unit == "Pa m^3" else (1.0, unit)


FIGURE = Figure(
    name="s_alpha",
    title="threshold against the stiffness of the cortex",
    source="SI, equation 72",
    parameters=Parameters.physical(),
    compute=compute,
    draw=draw,
    size=(3.4, 2.7),
    varies=frozenset({"v_p0", "alpha"}),
)
