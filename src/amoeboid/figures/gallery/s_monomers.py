"""SI section `sec_estimate_monomer_competition`: growth that is slowed for lack of monomers."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.closed_forms.monomers import (
    ExponentialDecay,
    growth_speed,
    monomer_ratio,
    speed_coefficients,
)
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.model.polymerization import Exponential, Inverse
from amoeboid.model.units import magnitude
from amoeboid.plotting.palette import BLUE, GREEN, INK, ORANGE
from amoeboid.studies.columns import Column

# Ref. colin2023recycling, as the SI quotes it; the thickness is that of the parameter table.
B, C, MU_0 = "1.184 um/min", "1.248 / h", "3 umol/l"
THICKNESS = "190 nm"
FILAMENTS_IN_VITRO = "560 / um^2"
FILAMENTS_UNROUNDED = "6700 / (12 um^2)"  # the count from which the SI rounds
HIGHEST = 1.5  # of mu_bar on the picture, in ratios in vivo
SPEED, RATIO, TIME = "nm/s", "mu_bar", "min"


def decay() -> ExponentialDecay:
    """The fit of SI `eq_vp_lit` in micrometers, seconds and single monomers."""
    return ExponentialDecay(
        B=magnitude(B, "um/s"), C=magnitude(C, "1/s"), mu_0=magnitude(MU_0, "1/um^3")
    )


def in_vitro(filaments: str) -> tuple[float, float]:
    """mu_bar of the experiment, and V_1 [um/s], with this many filaments per area."""
    h, c = magnitude(THICKNESS, "um"), magnitude(filaments, "1/um^2")
    return float(monomer_ratio(decay().mu_0, h, c)), speed_coefficients(decay(), h, c)[1]


def compute(p: Parameters, results: Results) -> FigureData:
    """The line of the experiment, and both laws of the cell through its point in vivo."""
    ratio, V_1 = in_vitro(FILAMENTS_IN_VITRO)
    exact_ratio, exact_V_1 = in_vitro(FILAMENTS_UNROUNDED)
    in_vivo = float(monomer_ratio(p.c_r, 1.0, p.c0))  # c_r = mu h
    mu_bar = np.linspace(0.0, HIGHEST * max(in_vivo, ratio), 151)
    line = 1e3 * V_1 * mu_bar
    columns = {RATIO: column_of(p, mu_bar), "experiment": Column(line, SPEED)}
    for law in (Inverse(), Exponential()):
        # An empty cortex has no ratio: the limits of both laws for mu_bar -> 0 are 0.
        speed = np.zeros_like(mu_bar)
        speed[1:] = law.derivatives(1.0 / mu_bar[1:], 1.0, 1.0, 0)[0]
        (there,) = law.derivatives(1.0 / in_vivo, 1.0, 1.0, 0)
        columns[law.name] = Column(1e3 * V_1 * in_vivo * speed / there, SPEED)
    places = np.array([ratio, in_vivo])
    points = {
        "where": column_of(p, ["in vitro", "in vivo"]),
        RATIO: column_of(p, places),
        "v_p": Column(1e3 * V_1 * places, SPEED),
    }
    t = np.linspace(0.0, magnitude("120 min", "s"), 121)
    comet = {
        "t": Column(t / magnitude("1 min", "s"), TIME),
        "v_p": Column(1e3 * growth_speed(decay(), t), SPEED),
    }
    return FigureData(
        parameters=p,
        tables={
            "laws": Table("growth speed over monomers per filament", columns),
            "points": Table("the experiment and the cell", points),
            "comet": Table("growth speed of the comet, SI `eq_vp_lit`", comet),
        },
        notes=(
            f"V_1 = {1e3 * V_1:.4f} nm/s, mu_bar = {ratio:.4f} in vitro with {FILAMENTS_IN_VITRO} "
            f"(the paper: 32.2 nm/s, 0.61); not rounded, {FILAMENTS_UNROUNDED}: "
            f"{1e3 * exact_V_1:.4f} nm/s, {exact_ratio:.4f}",
            f"mu_bar = c_r/c0 = {in_vivo:.4f} in the cell (the paper in vivo: 0.71), "
            f"v_p = {1e3 * V_1 * in_vivo:.4f} nm/s",
            "both laws are scaled to the speed of the experiment at the ratio in the cell",
        ),
    )


def draw(data: FigureData, axes: Any) -> None:
    """Speed over monomers per filament."""
    laws, points = data["laws"], data["points"]
    axes.plot(laws[RATIO], laws["exponential"], color=ORANGE, label="exponential law")
    axes.plot(laws[RATIO], laws["inverse"], color=BLUE, label="inverse law")
    axes.plot(laws[RATIO], laws["experiment"], ":", color=INK, label=r"experiment, $V_1\barμ$")
    for k, (marker, color) in enumerate((("s", INK), ("o", GREEN))):
        axes.plot(
            points[RATIO][k],
            points["v_p"][k],
            marker,
            color=color,
            ms=4.5,
            zorder=4,
            label=points["where"][k],
        )
    axes.set_xlim(0.0, laws[RATIO][-1])
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(r"monomers per filament $\barμ = μh/c$")
    axes.set_ylabel(f"polymerization speed $v_p$ [{laws.unit('experiment')}]")
    axes.legend(loc="upper left")


FIGURE = Figure(
    name="s_monomers",
    title="polymerization speed limited by monomers",
    source="SI, monomers",
    parameters=Parameters.physical(),
    compute=compute,
    draw=draw,
)
