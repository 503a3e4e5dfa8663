"""How figures look: one column of a journal wide, vector text, colors of `plotting.palette`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from amoeboid.extras import needed
from amoeboid.plotting.figures import DRAWING, own_settings

COLUMN = 3.4
"""Width of a column of a journal [inches]."""

DPI = 300

SETTINGS = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
}


@contextmanager
def print_style() -> Iterator[None]:
    """The settings of matplotlib for these figures, whatever the user's are."""
    matplotlib = needed("matplotlib", DRAWING)
    with own_settings():
        matplotlib.rcParams.update(SETTINGS)
        yield
