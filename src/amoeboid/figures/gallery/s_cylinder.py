"""SI figure `fig_cyliner`: a cortex of finite thickness against the thin shell."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.closed_forms.thick_cortex import (
    Cortex,
    cylinder_surface_stresses,
    cylinder_velocity,
    sphere_surface_stresses,
    sphere_velocity,
    thin_cylinder_stresses,
    thin_sphere_stresses,
)
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.model.units import magnitude
from amoeboid.plotting.palette import BLUE, GREEN, INK, PALE, PURPLE

THICKNESS = "190 nm"
OTHERS = (0.0, 20.0)  # lambda/mu besides that of the cell
THICKEST = 0.3  # h/R0
PROFILE = 0.3  # h/R0 of the profiles
COLORS = (GREEN, PURPLE)  # of the others; the cell is blue
CYLINDER, SPHERE = "cylinder", "sphere"
SHAPES: dict[str, tuple[Callable[..., Any], ...]] = {
    CYLINDER: (cylinder_surface_stresses, thin_cylinder_stresses, cylinder_velocity),
    SPHERE: (sphere_surface_stresses, thin_sphere_stresses, sphere_velocity),
}
SHARE = {CYLINDER: 3.0, SPHERE: 5.0}
"""First order of the hoop stress: (SHARE lambda + 2 mu)/(2 (lambda + 2 mu)) h/R0."""


def viscosity_ratio_3d(p: Parameters) -> float | None:
    """lambda/mu of the layer whose thin shell has eta_b/eta_s [1]; None if there is no such layer.

    From SI `eq2DViscosities3D`, eta_b/eta_s = 2 lambda/(lambda + 2 mu) < 2.
    """
    ratio = p.eta_b / p.eta_s
    return 2 * ratio / (2 - ratio) if ratio < 2 else None


def first_order(shape: str, ratio: float) -> float:
    """Coefficient of h/R0 in exact over thin-shell hoop stress, at lambda/mu = `ratio` [1]."""
    return (SHARE[shape] * ratio + 2) / (2 * (ratio + 2))


def stress_ratio(shape: str, t: Array, ratio: float) -> Array:
    """Exact hoop stress, integrated over the thickness t = h/R0, over that of the thin shell."""
    exact, thin, _ = SHAPES[shape]
    cortex = Cortex(R0=1.0, h=t, lambda_3d=ratio, mu_3d=1.0)
    return np.asarray(exact(cortex).hoop / thin(cortex).hoop)


def compute(p: Parameters, results: Results) -> FigureData:
    """Stress over thickness and the velocity inside the layer, for three viscosity ratios."""
    own = viscosity_ratio_3d(p)
    ratios = sorted({*OTHERS, *(() if own is None else (own,))})
    t = np.linspace(0.002, THICKEST, 200)
    stresses: dict[str, list[Any]] = {k: [] for k in ("shape", "lambda_over_mu", "h_over_R0")}
    stresses |= {k: [] for k in ("stress_ratio", "first_order")}
    profiles: dict[str, list[Any]] = {k: [] for k in ("shape", "lambda_over_mu", "r_over_R0")}
    profiles |= {"v_r_over_v_p": []}
    r = np.linspace(1 - PROFILE, 1.0, 61)
    for shape, (*_, velocity) in SHAPES.items():
        for ratio in ratios:
            line = 1 + first_order(shape, ratio) * t
            rows = (t, stress_ratio(shape, t, ratio), line)
            _add(stresses, (shape, ratio), rows)
            layer = Cortex(R0=1.0, h=PROFILE, lambda_3d=ratio, mu_3d=1.0)
            _add(profiles, (shape, ratio), (r, velocity(layer, r)))
    return FigureData(
        parameters=p,
        tables={
            "stress": _table("integrated hoop stress over that of the thin shell", p, stresses),
            "profile": _table(f"velocity in a layer of h/R0 = {PROFILE}, `eqvR`", p, profiles),
            "cell": _cell(p, own),
        },
        notes=_notes(p, own),
    )


def _add(columns: dict[str, list[Any]], labels: tuple[str, float], rows: tuple[Any, ...]) -> None:
    """Append rows that share their labels to columns in order."""
    for column, value in zip(columns.values(), (*labels, *rows), strict=True):
        column.extend(np.broadcast_to(value, np.shape(rows[0])).tolist())


def _table(about: str, p: Parameters, columns: dict[str, list[Any]]) -> Table:
    return Table(about, {name: column_of(p, values) for name, values in columns.items()})


def _thickness(p: Parameters) -> float | None:
    """h/R0 of the parameter table; None for a cell without physical units."""
    if p.units is None:
        return None
    return magnitude(THICKNESS, "m") / (p.R0 * p.units.length)


def _cell(p: Parameters, own: float | None) -> Table:
    """The layer of the cell: thickness, viscosities, and how far off its thin shell is."""
    t = _thickness(p)
    rows = [] if own is None or t is None else [(shape, t, own) for shape in SHAPES]
    found = [float(stress_ratio(shape, np.array(at), ratio)) for shape, at, ratio in rows]
    columns = {
        "shape": column_of(p, [shape for shape, *_ in rows]),
        "h_over_R0": column_of(p, [at for _, at, _ in rows]),
        "lambda_over_mu": column_of(p, [ratio for *_, ratio in rows]),
        "stress_ratio": column_of(p, found),
    }
    return Table(f"the cell with h = {THICKNESS}; without rows if it is not known", columns)


def _notes(p: Parameters, own: float | None) -> tuple[str, ...]:
    if own is None:
        return (
            f"eta_b/eta_s = {p.eta_b / p.eta_s:.6g} is not below 2: no layer of a viscous fluid "
            "with lambda > 0 is this thin shell (SI `eq2DViscosities3D`)",
        )
    orders = ", ".join(f"{first_order(shape, own):.6g} ({shape})" for shape in SHAPES)
    notes = [f"lambda/mu = {own:.6g}; exact over thin-shell stress is 1 + k h/R0, k = {orders}"]
    cell = _cell(p, own)
    if len(cell):
        found = ", ".join(
            f"{100 * (value - 1):.3g} % ({shape})"
            for shape, value in zip(cell["shape"], cell["stress_ratio"], strict=True)
        )
        at = cell["h_over_R0"][0]
        notes.append(
            f"h/R0 = {at:.4g} ({THICKNESS}): exact stress above the thin shell's by {found}"
        )
    return tuple(notes)


def draw(data: FigureData, axes: Any) -> None:
    """Stress over thickness above, velocity over radius below."""
    above, below = axes
    stress, profile, cell = data["stress"], data["profile"], data["cell"]
    ratios = sorted(set(stress["lambda_over_mu"].tolist()))
    for shape, style in ((CYLINDER, "-"), (SPHERE, "--")):
        for ratio in ratios:
            color = _color(ratio)
            rows = (stress["shape"] == shape) & (stress["lambda_over_mu"] == ratio)
            t = stress["h_over_R0"][rows]
            above.plot(t, stress["stress_ratio"][rows], style, color=color)
            above.plot(t, stress["first_order"][rows], ":", color=color, lw=0.8)
            rows = (profile["shape"] == shape) & (profile["lambda_over_mu"] == ratio)
            r, v = profile["r_over_R0"][rows], profile["v_r_over_v_p"][rows]
            below.plot(r, v, style, color=color)
    if len(cell):
        above.axvline(cell["h_over_R0"][0], color=PALE, lw=2.0, zorder=0)
    above.set_xlim(0.0, THICKEST)
    above.set_ylim(bottom=1.0)
    above.set_xlabel("cortex thickness $h/R_0$")
    above.set_ylabel("hoop stress,\nexact / thin shell")
    below.set_xlim(1 - PROFILE, 1.0)
    below.set_xlabel(f"radius $r/R_0$, at $h/R_0 = {PROFILE}$")
    below.set_ylabel("velocity $v_r/v_p$")
    _legends(above, below, ratios, bool(len(cell)))


def _color(ratio: float) -> str:
    return COLORS[OTHERS.index(ratio)] if ratio in OTHERS else BLUE


def _legends(above: Any, below: Any, ratios: list[float], marked: bool) -> None:
    """Colors and styles, explained once each."""
    from matplotlib.lines import Line2D

    colors = [Line2D([], [], color=_color(ratio), label=f"$λ/μ = {ratio:.4g}$") for ratio in ratios]
    styles = [
        Line2D([], [], color=INK, ls="-", label=CYLINDER),
        Line2D([], [], color=INK, ls="--", label=SPHERE),
        Line2D([], [], color=INK, ls=":", lw=0.8, label="first order"),
    ]
    if marked:
        styles.append(Line2D([], [], color=PALE, lw=2.0, label=f"$h$ = {THICKNESS}"))
    above.legend(handles=styles, loc="upper left", bbox_to_anchor=(0.06, 1.0))
    below.legend(handles=colors, loc="lower right")


FIGURE = Figure(
    name="s_cylinder",
    title="cortex of finite thickness and thin shell",
    source="SI, thick cortex",
    parameters=Parameters.physical(),
    compute=compute,
    draw=draw,
    size=(3.4, 4.2),
    panels=(2, 1),
)
