"""Measured profiles with the fit and its standard error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.fitting.result import Fit
from amoeboid.plotting.figures import (
    axes_for,
    new_figure,
    own_settings,
    with_unit,
    write_figure,
)
from amoeboid.plotting.palette import BLUE, INK

LABELS = {"u": "retrograde flow $u$", "c": "filament concentration $c$"}
BAND = 0.25


def draw_profile(fit: Fit, ax: Any = None, name: str = "u") -> Any:
    """One measured profile, the fit and a band of one standard error; returns the axes."""
    axes = axes_for(ax)
    q = fit.quantity(name)
    assumed = fit.errors_used(name)
    theta = np.rad2deg(np.asarray(q.theta))
    axes.errorbar(theta, q.values, assumed, fmt=".", color=INK, lw=1, label="measured")
    curve = fit.profile(name)
    x, y, error = (curve[key].values for key in ("theta", name, f"{name}_error"))
    axes.plot(x, y, color=BLUE, label="fit")
    axes.fill_between(x, y - error, y + error, color=BLUE, alpha=BAND, lw=0)
    pole = "the front" if fit.orientation is None else "the first pole"
    axes.set_xlabel(f"angle from {pole} [deg]")
    axes.set_ylabel(with_unit(LABELS[name], q.unit or str(q.dimension)))
    axes.set_xlim(0, 180)
    axes.legend(frameon=False)
    return axes


@own_settings()
def write_fit(fit: Fit, path: Path) -> None:
    """A file with all measured profiles side by side."""
    figure = new_figure(4.5 * len(fit.profiles), 3.5)
    for k, name in enumerate(fit.profiles):
        draw_profile(fit, figure.add_subplot(1, len(fit.profiles), k + 1), name)
    write_figure(figure, path, dpi=150)
