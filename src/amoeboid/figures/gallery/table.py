"""The parameter table `tab_params`: what the paper prints, the cell, and what follows from both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.closed_forms.amplitude import bifurcation
from amoeboid.closed_forms.dimensionless import (
    dimensionless,
    dimensionless_cubic_coefficient,
    viscosity_ratio,
)
from amoeboid.closed_forms.linear import critical_pressure, critical_speed
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of, drawn_unit, unit_of
from amoeboid.model.parameters import DIMENSIONS, Parameters
from amoeboid.plotting.palette import GRAY, INK
from amoeboid.studies.columns import magnitude
from amoeboid.validation import InvalidInput

NUMBER = "1"
Value = Callable[[Parameters], Any]


@dataclass(frozen=True)
class Row:
    """A line: what it is, its symbol, its value, and what the paper prints in its two columns."""

    name: str
    symbol: str
    value: Value | None
    dimension: str
    simulation: str = ""
    physical: str = ""


def _parameter(name: str, words: str, symbol: str, *printed: str) -> Row:
    return Row(words, symbol, lambda p: p.value(name), DIMENSIONS[name], *printed)


PARAMETERS = (
    _parameter("R0", "cell radius", "$R_0$", "1", "10 um"),
    _parameter("delta_P", "pressure drop across membrane", "$ΔP$", "300", "300 to 700 Pa"),
    _parameter("eta_s", "cortex shear viscosity", "$η_s$", "1", "2.7 mPa s m"),
    _parameter("eta_b", "cortex bulk viscosity", "$η_b$", "1"),
    _parameter("c0", "homeostatic filament concentration", "$c_0$", "3", "100 to 1400 /um^2"),
    Row("cortex thickness", "$h$", None, "L", "", "190 nm"),
    Row("monomer concentration", "$μ$", None, "N/L^3", "", "8.5 to 1200 umol/l"),
    _parameter("c_r", "reference filament concentration", "$c_r$", "1"),
    _parameter("beta", "filament turnover rate", "$β$", "1", "0.1 /s"),
    _parameter("D", "filament diffusion coefficient", "$D$", "0.03", "0.03 um^2/s"),
    _parameter("v_p0", "polymerization speed", "$v_p^0$", "3.8", "0.005 to 3 um/s"),
)
DERIVED = (
    Row("concentration", "$c_0/c_r$", lambda p: dimensionless(p).c0, NUMBER, "3"),
    Row("diffusion coefficient", "$D/(R_0^2 β)$", lambda p: dimensionless(p).D, NUMBER, "0.03"),
    Row("viscosity ratio", "$η_s/η_b$", viscosity_ratio, NUMBER, "1"),
    Row(
        "polymerization speed", "$v_p(c_0)/(R_0 β)$", lambda p: dimensionless(p).v_p, NUMBER, "0.19"
    ),
    Row("pressure", "$ΔP R_0/(η_s β)$", lambda p: dimensionless(p).delta_P, NUMBER),
    Row(
        "pressure below which mode 2 precedes 1",
        "$ΔP^* R_0/(η_s β)$",
        lambda p: dimensionless(p.replace(delta_P=float(critical_pressure(p)))).delta_P,
        NUMBER,
    ),
    Row("threshold", "$v_p^c$", critical_speed, "L/T", "", "1.5 um/s"),
    Row("speed over threshold", "$v_p^0/v_p^c$", lambda p: p.v_p0 / critical_speed(p), NUMBER),
    Row(
        "cubic coefficient, infinite pressure",
        r"$ν c_r^2/β$, $ΔP → \infty$",
        lambda p: dimensionless_cubic_coefficient(infinite_pressure(p)),
        NUMBER,
    ),
    Row("cubic coefficient", "$ν c_r^2/β$", dimensionless_cubic_coefficient, NUMBER),
    Row("bifurcation", "", lambda p: str(bifurcation(p)), "", "", "supercritical"),
)


def compute(p: Parameters, results: Results) -> FigureData:
    """All rows for the cell and for the paper's cell with its physical units."""
    cells = {"cell": p, "physical_cell": Parameters.physical()}
    rows = (*PARAMETERS, *DERIVED)
    notes: list[str] = []
    columns = {
        "quantity": column_of(p, [row.name for row in rows]),
        "symbol": column_of(p, [row.symbol.replace("$", "") for row in rows]),
        "derived": column_of(p, [row in DERIVED for row in rows]),
        "paper_simulation": column_of(p, [row.simulation for row in rows]),
        "paper_physical": column_of(p, [row.physical for row in rows]),
    }
    for name, cell in cells.items():
        values = [_value(row, cell, notes) for row in rows]
        units = [_unit(row, cell) for row in rows]
        columns[name] = column_of(p, np.array(values, dtype=object))
        columns[f"{name}_unit"] = column_of(p, units)
    return FigureData(
        parameters=p,
        tables={"parameters": Table("parameters and what follows from them", columns)},
        notes=(
            "paper_simulation and paper_physical: as printed; physical_cell: that of the paper's "
            "estimates, `Parameters.physical()`",
            *dict.fromkeys(notes),
        ),
    )


def _value(row: Row, cell: Parameters, notes: list[str]) -> float | str | None:
    """The value of a row as the cell shows it; None, and why, where it has none."""
    if row.value is None:
        return None
    try:
        found = row.value(cell)
    except InvalidInput as error:
        notes.append(f"{row.name}: {error}")
        return None
    if isinstance(found, str):
        return found
    return float(magnitude(cell, found, row.dimension))


def _unit(row: Row, cell: Parameters) -> str:
    return "" if row.value is None else unit_of(cell, row.dimension)


COLUMNS = (0.0, 0.3, 0.455, 0.605, 0.72, 0.875)
HEADINGS = ("", "symbol", "paper, simulation", "this cell", "paper, physical", "paper's cell")


def draw(data: FigureData, axes: Any) -> None:
    """The table as in print: rules above, between and below, numbers with their units."""
    table = data["parameters"]
    derived = table["derived"]
    lines = len(table) + 1.9
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(lines, 0.0)
    for x, heading in zip(COLUMNS, HEADINGS, strict=True):
        axes.text(x, 0.7, heading, va="center", fontsize=7.0, weight="bold")
    y, rules = 2.0, [1.4]
    for k in range(len(table)):
        if k and derived[k] and not derived[k - 1]:
            rules.append(y - 0.3)
            y += 0.4
        for x, text in zip(COLUMNS, _texts(data, k), strict=True):
            axes.text(x, y, text, va="center", fontsize=7.0, color=INK)
        y += 1.0
    for rule in (0.0, *rules, lines):
        axes.plot([0, 1], [rule, rule], color=GRAY if rule in rules else INK, lw=0.7, clip_on=False)


def _texts(data: FigureData, k: int) -> tuple[str, ...]:
    """A row as it is drawn."""
    table = data["parameters"]
    symbol = (*PARAMETERS, *DERIVED)[k].symbol
    shown = []
    for name, physical in (("cell", data.parameters.units is not None), ("physical_cell", True)):
        unit = table[f"{name}_unit"][k] if physical else ""
        shown.append(_shown(table[name][k], str(unit)))
    printed = [_printed(str(table[key][k])) for key in ("paper_simulation", "paper_physical")]
    return (str(table["quantity"][k]), symbol, printed[0], shown[0], printed[1], shown[1])


def _shown(value: Any, unit: str) -> str:
    if value is None:
        return "\N{EN DASH}"
    if isinstance(value, str):
        return value
    number = f"{value:.4g}".replace("-", "\N{MINUS SIGN}")
    return f"{number} {drawn_unit(unit)}".rstrip()


def _printed(text: str) -> str:
    return drawn_unit(text).replace(" to ", "\N{EN DASH}") if text else "\N{EN DASH}"


FIGURE = Figure(
    name="table",
    title="parameters, thresholds, dimensionless numbers",
    source="SI, table",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(7.0, 3.7),
)
