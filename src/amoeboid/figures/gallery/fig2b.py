"""Figure 2B: velocity perturbations of the polarization mode l = 1 on a cross-section."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.closed_forms.flow import sphere_velocities
from amoeboid.closed_forms.points import points as theory_points
from amoeboid.figures import sections
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.style import COLUMN
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.palette import INK, ORANGE, PURPLE, YELLOW
from amoeboid.studies.columns import Column, text
from amoeboid.validation import InvalidInput

POINTS = 16  # around the cross-section
SHARE = 0.5  # of v_p(c0) by which the polymerization speed changes at the poles
SHIFT = 0.3  # of the cell in the time shown [R0]
FIELDS = {"v_p": ORANGE, "v_c": PURPLE, "v": YELLOW}
NAMES = {"v_p": r"$\delta v_p$", "v_c": r"$\delta v_c$", "v": r"$\delta v$"}


def amplitude(p: Parameters) -> float:
    """dc_1 > 0 that changes v_p by SHARE v_p(c0), to first order [N/L^2].

    The theory is linear: any small amplitude has the same fields. Raises InvalidInput where v_p
    does not depend on c, or is 0.
    """
    f0, f1 = (float(f) for f in theory_points(p).v_p_derivatives(p.c0, 1))
    if f0 * f1 == 0.0:
        raise InvalidInput(
            "v_p and its slope must not be 0 at c0 for a perturbation of the velocities, got "
            f"v_p(c0) = {f0:g}, slope {f1:g}; choose another v_p0 or law"
        )
    return SHARE * abs(f0 / f1)


def compute(p: Parameters, results: Results) -> FigureData:
    """Fields at points of the cross-section; main text `deltavp`, SI `infinitan`."""
    a = amplitude(p)
    theta = np.arange(POINTS) * (2.0 * np.pi / POINTS)
    found = sphere_velocities(p, a, theta)
    migration = float(found.migration)
    time = SHIFT * p.R0 / abs(migration)
    e_r = np.column_stack([np.cos(theta), np.sin(theta)])
    e_theta = np.column_stack([-np.sin(theta), np.cos(theta)])
    columns = {"theta": Column(theta, "rad")}
    columns |= {k: column_of(p, p.R0 * e_r[:, i], "L") for i, k in enumerate("zx")}
    columns["dc"] = column_of(p, a * np.cos(theta), "N/L^2")
    for name in FIELDS:
        radial, along = getattr(found, name).T
        v = radial[:, None] * e_r + along[:, None] * e_theta
        columns |= {f"{name}_{k}": column_of(p, v[:, i], "L/T") for i, k in enumerate("zx")}
    cell = {
        "R0": column_of(p, [p.R0], "L"),
        "dc_1": column_of(p, [a], "N/L^2"),
        "migration_z": column_of(p, [migration], "L/T"),
        "time": column_of(p, [time], "T"),
        "shift_z": column_of(p, [migration * time], "L"),
    }
    return FigureData(
        parameters=p,
        tables={
            "fields": Table(
                "perturbations in the plane of z, the axis, and x; c is highest at +z", columns
            ),
            "cell": Table(
                "size, amplitude of c, migration, and displacement in the time shown", cell
            ),
        },
        notes=(
            f"migration velocity {text(p, migration, 'L/T')} along z for dc_1 = "
            f"{text(p, a, 'N/L^2')}; the theory is linear, only the ratio of the two matters",
            f"arrows: displacement in the time {text(p, time, 'T')}; dashed: the cell after this "
            f"time in the laboratory frame, shifted by {SHIFT:g} R0",
        ),
    )


def draw(data: FigureData, axes: Any) -> None:
    """The cross-section with the axis to the right, towards the pole of high c."""
    fields, cell = data["fields"], data["cell"]
    R0, time, shift = (float(cell[name][0]) for name in ("R0", "time", "shift_z"))
    at = sections.points(fields, "z", "x")
    sections.draw_circle(axes, (shift, 0.0), R0, color=INK, ls="--", lw=0.8)
    sections.draw_circle(axes, (0.0, 0.0), R0, color=INK, lw=1.2)
    axes.plot(*at.T, "o", color=INK, ms=2.2, zorder=5)
    for name, color in FIELDS.items():
        by = time * sections.points(fields, f"{name}_z", f"{name}_x")
        by[np.hypot(*by.T) < 1e-9 * R0] = 0.0
        sections.draw_arrows(axes, at, by, color)
        axes.plot([], [], color=color, lw=2.0, label=NAMES[name])
    axes.plot([], [], color=INK, ls="--", lw=0.8, label=_after(cell))
    for sign, place in (("+", 0.45), ("$-$", -0.45)):
        axes.text(place * R0, 0.0, sign, fontsize=14, ha="center", va="center")
    way = np.array([[np.copysign(0.4 * R0, shift), 0.0]])
    sections.draw_arrows(axes, np.array([[0.0, 0.36 * R0]]) - 0.5 * way, way, INK, width=0.02)
    axes.text(0.0, 0.43 * R0, r"$\delta v_\mathrm{mig}$", ha="center", va="bottom")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, 0.04), ncols=4, handlelength=1.2, columnspacing=1.2
    )
    sections.draw_scale_bar(axes, (1.72 * R0, -1.12 * R0), R0, cell.unit("R0"))
    sections.to_scale(axes, (-1.72 * R0, -1.4 * R0), (1.72 * R0, 1.1 * R0))


def _after(cell: Table) -> str:
    return f"after {sections.amount(float(cell['time'][0]), cell.unit('time'))}"


FIGURE = Figure(
    name="fig2b",
    title="velocity perturbations of the mode l = 1",
    source="figure 2B",
    parameters=Parameters(),
    compute=compute,
    draw=draw,
    size=(COLUMN, 2.75),
)
