"""Figures of axisymmetric steady states, branches and phase diagrams, on given axes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.axisymmetric.phase_diagram import REGIONS
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.figures import (
    as_drawn,
    axes_for,
    new_figure,
    own_settings,
    write_drawing,
    write_figure,
)
from amoeboid.plotting.palette import COLOR_MAP, INK, PURPLE, STABLE, UNSTABLE
from amoeboid.studies import observed
from amoeboid.studies.branch import HOPF, Branch, SpecialPoint
from amoeboid.studies.columns import magnitude, text, unit
from amoeboid.studies.phase_diagram import PhaseDiagram
from amoeboid.studies.states import SteadyState, SteadyStates

CONCENTRATION = "filament concentration $c$"
REGION_COLORS = ("#f2f2f2", "#8fc1d9", "#f3d38c", "#e3a79b", "#bbbbbb")
MAX_LABELED = 4
"""Special points of one kind that get a line of the legend each."""

MAX_OUTLINES = 8
"""Outlines that are drawn side by side."""

BESIDE = 2.6
"""Distance of two outlines side by side, in units of R0."""


def draw_state(state: SteadyState, ax: Any = None) -> Any:
    """The outline of a state, colored by c, front up; returns the axes."""
    axes = axes_for(ax)
    image = _outline(axes, state, _highest([state]))
    _scale_bar(axes, state, 0.0)
    axes.set_title(_caption(state, "\n"), fontsize=10, color=_color(state))
    _color_bar(axes, image, state.parameters)
    return axes


def draw_outlines(states: SteadyStates, ax: Any = None) -> Any:
    """The outlines of states side by side on one pair of axes, colored by c, front up."""
    axes = axes_for(ax)
    highest = _highest(states)
    image: Any = None
    for k, state in enumerate(states[:MAX_OUTLINES]):
        image = _outline(axes, state, highest, BESIDE * k)
        _, z = _meridian(state)
        top = float(np.max(np.abs(z)))
        axes.text(
            _length(state, BESIDE * k * state.parameters.R0),
            1.1 * top,
            _caption(state, "\n"),
            ha="center",
            va="bottom",
            fontsize=8,
            color=_color(state),
        )
    if len(states):
        _scale_bar(axes, states[0], 0.0)
        left_out = len(states) - MAX_OUTLINES
        if left_out > 0:
            axes.set_title(f"and {left_out} more states", loc="right", fontsize=8)
        axes.set_ylim(top=1.9 * _length(states[0], states.parameters.R0))
        _color_bar(axes, image, states.parameters)
    return axes


@own_settings()
def write_states(states: SteadyStates, path: Path) -> None:
    """A file with the outlines of states, and profiles of c and u below them."""
    figure = new_figure(3.0 * len(states) + 0.8, 5.6)
    grid = figure.add_gridspec(2, len(states), height_ratios=(1.5, 1.0))
    highest = _highest(states)
    image: Any = None
    first: Any = None
    outlines = []
    for k, state in enumerate(states):
        first = figure.add_subplot(grid[0, k], sharex=first, sharey=first)
        image = _outline(first, state, highest)
        _scale_bar(first, state, 0.0)
        first.set_title(_caption(state, ", "), fontsize=10, color=_color(state))
        outlines.append(first)
    p = states.parameters
    label = f"{CONCENTRATION} {_in(p, 'N/L^2')}"
    figure.colorbar(image, ax=outlines, label=label, shrink=0.85)
    fastest = max(_number(state, "max_retrograde_speed") for state in states)
    for k, state in enumerate(states):
        below = figure.add_subplot(grid[1, k])
        beside = below.twinx()
        _profile(below, beside, state)
        below.set_ylim(0.0, 1.05 * highest)
        beside.set_ylim(0.0, 1.05 * fastest if fastest > 0 else 1.0)
        if k == 0:
            below.set_ylabel(label, color=STABLE)
        else:
            below.tick_params(labelleft=False)
        if k == len(states) - 1:
            beside.set_ylabel(f"retrograde flow $|u|$ {_in(p, 'L/T')}", color=UNSTABLE)
        else:
            beside.tick_params(labelright=False)
    write_figure(figure, path, dpi=150)


def _number(state: SteadyState, name: str) -> float:
    """An observable as it is drawn: a number in the unit of its label."""
    value = state.number(name)
    return float(magnitude(state.parameters, value, observed.dimension(name)))


def _length(state: SteadyState, value: Any) -> Any:
    return magnitude(state.parameters, value, "L")


def _highest(states: Any) -> float:
    return max((_number(state, "c_rear") for state in states), default=1.0)


def _color(state: SteadyState) -> str:
    return STABLE if state.stable else UNSTABLE


def _caption(state: SteadyState, between: str) -> str:
    speed = _number(state, "max_retrograde_speed")
    word = "stable" if state.stable else "unstable"
    return f"$v_0$ = {speed:.4g} {_in(state.parameters, 'L/T')}{between}{word}"


def _meridian(state: SteadyState) -> tuple[Any, Any]:
    r, z = state.solution.outline(300)
    return _length(state, r), _length(state, z)


def _outline(axes: Any, state: SteadyState, highest: float, at: float = 0.0) -> Any:
    """The outline around `at` radii from the left end of the axes, and the circle of radius R0."""
    x = np.linspace(0.0, np.pi, 300)
    r, z = _meridian(state)
    c = magnitude(state.parameters, state.solution.concentration(x), "N/L^2")
    if c[0] > c[-1]:  # front up
        z = -z
    radius = float(_length(state, state.parameters.R0))
    middle = at * radius
    limits = {"vmin": 0.0, "vmax": highest, "cmap": COLOR_MAP, "s": 9}
    for side in (r, -r):  # pale colors need an edge
        axes.plot(middle + side, z, color="0.55", lw=4.2, solid_capstyle="butt")
    image = axes.scatter(middle + r, z, c=c, zorder=3, **limits)
    axes.scatter(middle - r, z, c=c, zorder=3, **limits)
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.plot(middle + radius * np.sin(angle), radius * np.cos(angle), ":", color="0.6", lw=0.8)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return image


def _scale_bar(axes: Any, state: SteadyState, at: float) -> None:
    p, radius = state.parameters, float(_length(state, state.parameters.R0))
    _, z = _meridian(state)
    low = 1.15 * min(-radius, -float(np.max(np.abs(z))))
    axes.plot([at, at + radius], [low, low], color=INK, lw=2)
    words = f"$R_0$ = {radius:.4g} {_in(p, 'L')}"
    axes.text(at + 0.5 * radius, low - 0.05 * radius, words, ha="center", va="top", fontsize=8)
    axes.set_ylim(bottom=low - 0.3 * radius)


def _color_bar(axes: Any, image: Any, p: Parameters) -> None:
    label = f"{CONCENTRATION} {_in(p, 'N/L^2')}"
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.85)


def _profile(axes: Any, beside: Any, state: SteadyState) -> None:
    x, p = np.linspace(0.0, np.pi, 300), state.parameters
    c = magnitude(p, state.solution.concentration(x), "N/L^2")
    u = np.abs(magnitude(p, state.solution.flow(x), "L/T"))
    if c[0] > c[-1]:
        c, u = c[::-1], u[::-1]
    axes.plot(x / np.pi, c, color=STABLE)
    beside.plot(x / np.pi, u, color=UNSTABLE, ls="--")
    axes.set_xlabel("arclength from front to rear,\nas a share of the whole", fontsize=9)
    axes.grid(alpha=0.25)


def draw_branch(branch: Branch, ax: Any = None, observable: str = "max_retrograde_speed") -> Any:
    """An observable along the branch, solid where stable, with its special points."""
    axes = axes_for(ax)
    p = branch.parameters
    dimension = p.dimension(branch.name)
    for states, stable in _pieces(branch):
        axes.plot(
            [_value(branch, state) for state in states],
            [_along(branch, state, observable) for state in states],
            color=STABLE if stable else UNSTABLE,
            ls="-" if stable else "--",
            lw=1.8,
        )
    axes.plot([], [], color=STABLE, lw=1.8, label="stable")
    axes.plot([], [], color=UNSTABLE, lw=1.8, ls="--", label="unstable")
    _markers(axes, branch, observable)
    if observable == "max_retrograde_speed":
        axes.axhline(0.0, color="0.5", lw=0.8, label="homogeneous sphere")
    axes.set_xlabel(_label(p, branch.name, dimension))
    axes.set_ylabel(_label(p, observable, branch.dimension(observable)))
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, fontsize=9)
    return axes


def write_branch(branch: Branch, path: Path) -> None:
    """A file with the branch."""
    write_drawing(branch, draw_branch, path, 6.4, 4.4)


def _along(branch: Branch, state: Any, observable: str) -> float:
    """An observable of a state of a branch, as it is drawn."""
    number, dimension = state.number(observable), branch.dimension(observable)
    return float(magnitude(branch.parameters, number, dimension))


def _value(branch: Branch, state: Any) -> float:
    number, dimension = (
        state.parameters.value(branch.name),
        branch.parameters.dimension(branch.name),
    )
    return float(magnitude(branch.parameters, number, dimension))


def _pieces(branch: Branch) -> list[tuple[list[Any], bool]]:
    """The branch cut where its stability changes: at folds and bifurcations."""
    drawn: list[tuple[list[Any], bool]] = []
    special = (*branch.folds, *branch.bifurcations)
    events = {id(s.state) for s in special}
    for number, (states, lengths) in enumerate(zip(branch.pieces, branch.lengths, strict=True)):
        inner = [(s.length, s.state) for s in special if s.piece == number]
        along = sorted([*zip(lengths, states, strict=True), *inner], key=lambda entry: entry[0])
        first = True
        for a, b in pairwise([state for _, state in along]):
            stable = a.stable if id(a) not in events else b.stable
            if not first and drawn[-1][1] == stable:
                drawn[-1][0].append(b)
            else:
                drawn.append(([a, b], stable))
            first = False
    return drawn


def _markers(axes: Any, branch: Branch, observable: str) -> None:
    p = branch.parameters
    dimension = p.dimension(branch.name)
    if observable == "max_retrograde_speed":
        for k, origin in enumerate(branch.origins):
            label = as_drawn(f"threshold {text(p, origin, dimension, '.5g')}")
            at = float(magnitude(p, origin, dimension))
            axes.plot(at, 0.0, "o", color=INK, label=label if k < MAX_LABELED else None)
    for k, fold in enumerate(branch.folds):
        label = as_drawn(f"fold {text(p, fold.number, dimension)}")
        _mark(axes, branch, fold, observable, "s", INK, label if k < MAX_LABELED else None)
    for k, point in enumerate(branch.bifurcations):
        number = as_drawn(text(p, point.number, dimension, ".5g"))
        mode = "" if point.m is None else f", m = {point.m}"
        label = f"{point.kind}{mode}, {number}"
        sign = "^" if point.kind == HOPF else "D"
        _mark(axes, branch, point, observable, sign, PURPLE, label if k < MAX_LABELED else None)


def _mark(
    axes: Any,
    branch: Branch,
    point: SpecialPoint,
    observable: str,
    sign: str,
    color: str,
    label: str | None,
) -> None:
    at = _value(branch, point.state), _along(branch, point.state, observable)
    axes.plot(*at, sign, color=color, label=label)


def draw_phase_diagram(diagram: PhaseDiagram, ax: Any = None) -> Any:
    """Regions as colors, the threshold and the fold line as curves, their meeting point."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    axes = axes_for(ax)
    p, name, found = diagram.parameters, diagram.name, diagram.solution
    dimension = p.dimension(name)

    def curve(pairs: Any) -> tuple[Any, Any]:
        table = np.array(pairs, dtype=float).reshape(-1, 2)
        return magnitude(p, table[:, 0], dimension), magnitude(p, table[:, 1], "L/T")

    values, speeds = magnitude(p, found.values, dimension), magnitude(p, found.speeds, "L/T")
    axes.pcolormesh(
        values,
        speeds,
        found.regions,
        cmap=ListedColormap(REGION_COLORS),
        norm=BoundaryNorm(np.arange(len(REGIONS) + 1) - 0.5, len(REGIONS)),
        shading="nearest",
    )
    handles: list[Any] = []
    if found.threshold_line:
        handles += axes.plot(*curve(found.threshold_line), color=STABLE, lw=2, label="threshold")
    for k, line in enumerate(found.fold_lines):
        label = "fold" if k == 0 else None
        drawn = axes.plot(*curve(line), color=UNSTABLE, lw=2, ls="--", label=label)
        handles += drawn if k == 0 else []
    for tip in found.tips:
        label = as_drawn(f"super/subcritical, {text(p, tip[0], dimension, '.4g')}")
        handles += axes.plot(*curve([tip]), "o", color=INK, label=label)
    present = np.unique(found.regions)
    handles += [
        Patch(facecolor=REGION_COLORS[k], edgecolor="0.7", label=REGIONS[k]) for k in present
    ]
    axes.set_xlim(values[0], values[-1])
    axes.set_ylim(speeds[0], speeds[-1])
    axes.set_xlabel(_label(p, name, dimension))
    axes.set_ylabel(_label(p, "v_p0", "L/T"))
    axes.legend(handles=handles, fontsize=8, loc="upper left", framealpha=0.9)
    return axes


def write_phase_diagram(diagram: PhaseDiagram, path: Path) -> None:
    """A file with the phase diagram."""
    write_drawing(diagram, draw_phase_diagram, path, 6.8, 4.8)


SYMBOLS = {
    "R0": "radius $R_0$",
    "delta_P": r"pressure difference $\Delta P$",
    "eta_s": r"shear viscosity $\eta_s$",
    "eta_b": r"bulk viscosity $\eta_b$",
    "c0": "homeostatic concentration $c_0$",
    "c_r": "reference concentration $c_r$",
    "beta": r"turnover rate $\beta$",
    "D": "diffusion coefficient $D$",
    "v_p0": "polymerization speed $v_p^0$",
    "alpha": r"elastic resistance $\alpha$",
    "chi": r"contractility $\chi$",
    "kappa": r"bending stiffness $\kappa$",
    "gamma_t": r"friction along the surface $\gamma_t$",
    "gamma_n": r"friction along the normal $\gamma_n$",
    "gamma_c": r"friction of the cortex $\gamma_c$",
    "gamma_share": "share of the friction that follows $c$",
    "max_retrograde_speed": "maximal retrograde speed $v_0$",
}


def _label(p: Parameters, name: str, dimension: str | None) -> str:
    """The label of an axis: what it shows, and in which unit."""
    return f"{SYMBOLS.get(name, name)} {_in(p, dimension)}"


def _in(p: Parameters, dimension: str | None) -> str:
    """The unit of a dimension for the label of an axis; that of docs/notation.md without units."""
    return f"[{as_drawn(unit(p, dimension) or '1')}]"
