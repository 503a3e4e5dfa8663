"""Figures of axisymmetric steady states, branches and phase diagrams."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.axisymmetric.branches import Branch, BranchPoint
from amoeboid.axisymmetric.phase_diagram import REGIONS, PhaseDiagram
from amoeboid.axisymmetric.steady import SteadyState
from amoeboid.model.parameters import Parameters
from amoeboid.plotting.figures import new_figure, own_settings, write_figure

STABLE, UNSTABLE, MARK, EDGE = "#0b6e99", "#c8553d", "#222222", "#6b4fa0"
CONCENTRATION = "filament concentration $c$"
UNITS = {f.name: f.metadata["unit"] for f in fields(Parameters) if "unit" in f.metadata}
REGION_COLORS = ("#f2f2f2", "#8fc1d9", "#f3d38c", "#e3a79b", "#bbbbbb")


@own_settings()
def draw_states(states: Sequence[tuple[SteadyState, bool]], path: Path) -> None:
    """Outlines colored by c, front up, and profiles of c and u; (state, stable) pairs."""
    figure = new_figure(3.0 * len(states) + 0.8, 5.6)
    grid = figure.add_gridspec(2, len(states), height_ratios=(1.5, 1.0))
    highest = max(s.c_rear for s, _ in states)
    image: Any = None
    first: Any = None
    outlines = []
    for k in range(len(states)):
        first = figure.add_subplot(grid[0, k], sharex=first, sharey=first)
        outlines.append(first)
    for axes, (state, stable) in zip(outlines, states, strict=True):
        image = _outline(axes, state, highest)
        word = "stable" if stable else "unstable"
        axes.set_title(
            f"$v_0$ = {state.max_retrograde_speed:.4g} {_in('L/T')}, {word}",
            fontsize=10,
            color=STABLE if stable else UNSTABLE,
        )
    figure.colorbar(image, ax=outlines, label=f"{CONCENTRATION} {_in('N/L^2')}", shrink=0.85)
    fastest = max(s.max_retrograde_speed for s, _ in states)
    for k, (state, _) in enumerate(states):
        below = figure.add_subplot(grid[1, k])
        beside = below.twinx()
        _profile(below, beside, state)
        below.set_ylim(0.0, 1.05 * highest)
        beside.set_ylim(0.0, 1.05 * fastest if fastest > 0 else 1.0)
        if k == 0:
            below.set_ylabel(f"{CONCENTRATION} {_in('N/L^2')}", color=STABLE)
        else:
            below.tick_params(labelleft=False)
        if k == len(states) - 1:
            beside.set_ylabel(f"retrograde flow $|u|$ {_in('L/T')}", color=UNSTABLE)
        else:
            beside.tick_params(labelright=False)
    write_figure(figure, path, dpi=150)


def _outline(axes: Any, state: SteadyState, highest: float) -> Any:
    x = np.linspace(0.0, np.pi, 300)
    r, z = state.position(x)
    c = state.concentration(x)
    if c[0] > c[-1]:  # front up
        z = -z
    limits = {"vmin": 0.0, "vmax": highest, "cmap": "viridis", "s": 9}
    image = axes.scatter(r, z, c=c, **limits)
    axes.scatter(-r, z, c=c, **limits)
    radius = state.parameters.R0
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.plot(radius * np.sin(angle), radius * np.cos(angle), ":", color="0.6", lw=0.8)
    low = 1.15 * min(-radius, float(np.min(z)))
    axes.plot([0.0, radius], [low, low], color=MARK, lw=2)
    text = f"$R_0$ = {radius:.4g} {_in('L')}"
    axes.text(0.5 * radius, low - 0.05 * radius, text, ha="center", va="top", fontsize=8)
    axes.set_ylim(bottom=low - 0.3 * radius)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return image


def _profile(axes: Any, beside: Any, state: SteadyState) -> None:
    x = np.linspace(0.0, np.pi, 300)
    c, u = state.concentration(x), np.abs(state.flow(x))
    if c[0] > c[-1]:
        c, u = c[::-1], u[::-1]
    axes.plot(x / np.pi, c, color=STABLE)
    beside.plot(x / np.pi, u, color=UNSTABLE, ls="--")
    axes.set_xlabel("arclength from front to rear,\nas a share of the whole", fontsize=9)
    axes.grid(alpha=0.25)


@own_settings()
def draw_branch(branch: Branch, path: Path) -> None:
    """Maximal retrograde speed along the branch, solid where stable, with its special points."""
    figure = new_figure(6.4, 4.4)
    axes = figure.add_subplot()
    for points, stable in _pieces(branch):
        axes.plot(
            [b.value for b in points],
            [b.state.max_retrograde_speed for b in points],
            color=STABLE if stable else UNSTABLE,
            ls="-" if stable else "--",
            lw=1.8,
        )
    axes.plot([], [], color=STABLE, lw=1.8, label="stable")
    axes.plot([], [], color=UNSTABLE, lw=1.8, ls="--", label="unstable")
    _markers(axes, branch)
    axes.axhline(0.0, color="0.5", lw=0.8, label="homogeneous sphere")
    axes.set_xlabel(_label(branch.name))
    axes.set_ylabel(f"maximal retrograde speed $v_0$ {_in('L/T')}")
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, fontsize=9)
    write_figure(figure, path, dpi=150)


def _pieces(branch: Branch) -> list[tuple[list[BranchPoint], bool]]:
    """The branch cut where its stability changes: at folds and crossings."""
    special = {id(b) for b in (*branch.folds, *(c.at for c in branch.crossings))}
    drawn: list[tuple[list[BranchPoint], bool]] = []
    for number, piece in enumerate(branch.pieces):
        inner = [c.at for c in branch.crossings if c.piece == number]
        ordered = sorted((*piece, *inner), key=lambda b: b.point.length)
        first = True
        for a, b in pairwise(ordered):
            stable = a.stable if id(a) not in special else b.stable
            if not first and drawn[-1][1] == stable:
                drawn[-1][0].append(b)
            else:
                drawn.append(([a, b], stable))
            first = False
    return drawn


def _markers(axes: Any, branch: Branch) -> None:
    for origin in branch.origins:
        axes.plot(origin, 0.0, "o", color=MARK, label=f"threshold {origin:.5g}")
    for fold in branch.folds:
        axes.plot(
            fold.value,
            fold.state.max_retrograde_speed,
            "s",
            color=MARK,
            label=f"fold {fold.value:.6g}",
        )
    for crossing in branch.crossings:
        kind = "Hopf point" if crossing.oscillating else "bifurcation"
        axes.plot(
            crossing.at.value,
            crossing.at.state.max_retrograde_speed,
            "^" if crossing.oscillating else "D",
            color=EDGE,
            label=f"{kind}, m = {crossing.m}, {crossing.at.value:.5g}",
        )


@own_settings()
def draw_phase_diagram(diagram: PhaseDiagram, path: Path) -> None:
    """Regions as colors, the threshold and the fold line as curves, their meeting point."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    figure = new_figure(6.8, 4.8)
    axes = figure.add_subplot()
    axes.pcolormesh(
        diagram.values,
        diagram.speeds,
        diagram.regions,
        cmap=ListedColormap(REGION_COLORS),
        norm=BoundaryNorm(np.arange(len(REGIONS) + 1) - 0.5, len(REGIONS)),
        shading="nearest",
    )
    threshold = [(c.value, c.threshold) for c in diagram.columns if c.threshold is not None]
    handles: list[Any] = []
    if threshold:
        handles += axes.plot(*zip(*threshold, strict=True), color=STABLE, lw=2, label="threshold")
    for k, line in enumerate(diagram.fold_lines):
        label = "fold" if k == 0 else None
        drawn = axes.plot(*zip(*line, strict=True), color=UNSTABLE, lw=2, ls="--", label=label)
        handles += drawn if k == 0 else []
    for tip in diagram.tips:
        handles += axes.plot(*tip, "o", color=MARK, label=f"super/subcritical, {tip[0]:.4g}")
    present = np.unique(diagram.regions)
    handles += [
        Patch(facecolor=REGION_COLORS[k], edgecolor="0.7", label=REGIONS[k]) for k in present
    ]
    axes.set_xlim(diagram.values[0], diagram.values[-1])
    axes.set_ylim(diagram.speeds[0], diagram.speeds[-1])
    axes.set_xlabel(_label(diagram.name))
    axes.set_ylabel(_label("v_p0"))
    axes.legend(handles=handles, fontsize=8, loc="upper left", framealpha=0.9)
    write_figure(figure, path, dpi=150)


def _label(name: str) -> str:
    symbols = {
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
    }
    return f"{symbols.get(name, name)} {_in(UNITS[name])}" if name in UNITS else name


def _in(unit: str) -> str:
    """A dimension as in docs/notation.md, for the label of an axis."""
    return "[" + re.sub(r"\^([0-9]+)", r"$^{\1}$", unit) + "]"
